"""A series of files of one arm in the configuration: a data set for each, and what is ambiguous."""

from __future__ import annotations

import textwrap
from pathlib import Path

import pytest
from complaints import complaints

from kinacc.checks.configuration import load

MARCH, MAY, JUNE = (f"tracker-2026-0{month}" for month in ("3-01", "5-04", "6-02"))
SERIES = """\
      - {path: june.csv, date: 2026-06-02, base: moved, tool: same}
      - {path: march.csv, date: '2026-03-01'}
      - {path: may.csv, date: 2026-05-04, base: same, tool: same}
"""


@pytest.fixture
def written(tmp_path, monkeypatch):
    """Write a configuration of one arm with these lines of a series, and call from its folder."""
    monkeypatch.chdir(tmp_path)
    for name in ("march", "may", "june"):
        (tmp_path / f"{name}.csv").write_text("q1_deg,x_mm\n")

    def write(series: str, own: str = "", top: str = "") -> str:
        text = f"""\
        {top}
        datasets:
          tracker:
            robot: ur10
            measurements: {{source: file, file: {{joint_unit: deg}}}}
            evaluation: {{space: measured}}
            {own}
            series:
        """
        text = textwrap.dedent(text) + series
        Path("tracker.yaml").write_text(text)
        return "tracker.yaml"

    return write


def test_every_line_is_a_data_set_and_the_arm_is_its_newest(written):
    loaded = load([written(SERIES)])
    assert sorted(loaded) == ["tracker", MARCH, MAY, JUNE]
    paths = {name: each["measurements"]["file"]["path"] for name, each in loaded.items()}
    assert paths == {
        "tracker": "june.csv",
        MARCH: "march.csv",
        MAY: "may.csv",
        JUNE: "june.csv",
    }
    flags = [(line["name"], line["base"], line["tool"]) for line in loaded["tracker"]["series"]]
    assert flags == [(MARCH, None, None), (MAY, "same", "same"), (JUNE, "moved", "same")]


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("{path: may.csv, date: 2026-05-04, tool: same}", "how"),
        ("{path: may.csv, date: 2026-05-04, base: same}", "how"),
        ("{path: may.csv}", "has no date"),
        ("{path: may.csv, date: 4.5.2026, base: same, tool: same}", "'4.5.2026' should be"),
        ("{path: may.csv, date: 2026-02-30, base: same, tool: same}", "'2026-02-30' should be"),
        ("{path: may.csv, date: 2026-03-01, base: same, tool: same}", "the date of two lines"),
        ("{path: march.csv, date: 2026-05-04, base: same, tool: same}", "stands in two lines"),
        ("{path: gone.csv, date: 2026-05-04, base: same, tool: same}", "does not exist"),
        ("{path: may.csv, date: 2026-05-04, base: shifted, tool: same}", "'shifted' should be"),
        ("{path: may.csv, date: 2026-05-04, bas: same, tool: same, base: same}", "mean base?"),
        ("{date: 2026-05-04, base: same, tool: same}", "has no path"),
        ("may.csv", "should be a valid dictionary"),
    ],
)
def test_what_a_line_leaves_open_or_says_wrongly_is_told_with_its_place(written, line, told):
    first = "      - {path: march.csv, date: 2026-03-01}\n"
    (found,) = complaints(written(f"{first}      - {line}\n"))
    assert told.replace("how", "does not say whether") in found
    assert "datasets.tracker.series[1]" in found
    assert found.startswith("tracker.yaml:10")


def test_a_series_beside_what_is_of_one_file_is_a_contradiction(written):
    series = "      - {path: march.csv, date: 2026-03-01}\n"
    own = "calibration: {base_and_tool: estimated}"
    top = "measurements: {file: {path: march.csv, exclude: [{lines: 2, reason: bumped}]}}"
    found = complaints(written(series, own, top))
    assert any("of another file, beside a series" in each for each in found)


def test_a_series_given_in_two_files_is_refused(written, tmp_path):
    path = written(SERIES)
    (tmp_path / "other.yaml").write_text(Path(path).read_text())
    assert any("given in two files" in each for each in complaints(path, "other.yaml"))

"""``kinacc add``: new readings become a line of the series, or it is said why not."""

from __future__ import annotations

import json
import os
from datetime import date
from pathlib import Path

import pytest
from command_line import call
from shared_data import SHIPPED

from kinacc.checks.configuration import load
from kinacc.config.edit import with_added
from kinacc.errors import InputError

MEASURED = SHIPPED / "ur10_tmac" / "series_B.csv"
HERE = """\
# One arm, measured with a tracker.
datasets:
  tracker:
    robot: ur10   # in cell 3
    measurements:
      source: file
      file:
        path: data/march.csv  # the first
        joint_unit: deg
        orientation: {kind: euler, convention: XYZ}
      folds: 2

    # what is fitted
    calibration:
      base_and_tool: estimated
      vec: {order: 1}
      dh: {fit_to: measurements, hayati_joints: [2, 3]}
    evaluation: {space: measured}
"""
JUNE = ("--date", "2026-06-02", "--base", "moved", "--tool", "same")
FIRST = ("--first-date", "2026-03-01")
SERIES = ("june.csv", *JUNE, *FIRST)


@pytest.fixture
def cell(tmp_path, monkeypatch):
    """A folder with a configuration and some files of the same arm, called from."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").mkdir()
    names, *rows = MEASURED.read_text().splitlines()
    for number, name in enumerate(("data/march", "june", "may")):
        part = [names, *rows[60 * number : 60 * number + 60]]
        Path(f"{name}.csv").write_text("\n".join(part) + "\n")
    Path("tracker.yaml").write_text(HERE)
    return tmp_path


def added(*words: str, code: int = 0):
    return call("add", *words, "--to", "tracker.yaml", code=code)


def test_a_second_file_makes_a_series_of_the_first_and_comments_stay(cell):
    added(*SERIES)
    text = Path("tracker.yaml").read_text()
    assert text == HERE + (
        "    series:\n"
        "      - {path: data/march.csv, date: 2026-03-01}\n"
        "      - {path: june.csv, date: 2026-06-02, base: moved, tool: same}\n"
    )
    assert [*load(["tracker.yaml"])] == ["tracker", "tracker-2026-03-01", "tracker-2026-06-02"]


def test_a_third_file_is_one_more_line_and_the_file_keeps_its_permissions(cell):
    added(*SERIES)
    os.chmod("tracker.yaml", 0o640)
    done = added("may.csv", "--date", "2026-07-04", "--base", "same", "--tool", "same", "--json")
    (line,) = json.loads(done.output)["written"]
    assert Path("tracker.yaml").read_text().endswith(f"      - {line}\n")
    assert os.stat("tracker.yaml").st_mode & 0o777 == 0o640


@pytest.mark.parametrize(
    ("words", "option"),
    [(JUNE[:4], "--tool"), (JUNE[2:], "--date"), (JUNE, "--first-date")],
)
def test_what_is_not_said_is_named(cell, words, option):
    done = added("june.csv", *words, code=2)
    assert option in done.output
    assert Path("tracker.yaml").read_text() == HERE


def test_a_file_of_known_readings_is_refused(cell):
    Path("june.csv").write_text(Path("data/march.csv").read_text())
    done = added(*SERIES, code=2)
    assert "holds the readings of" in done.output
    added("may.csv", *SERIES[1:])
    done = added("june.csv", "--date", "2026-07-04", *JUNE[2:], code=2)
    assert "holds the readings of" in done.output


def test_another_target_is_refused_where_the_tool_is_the_same(cell):
    text = Path("june.csv").read_text()
    for name in ("x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg"):
        text = text.replace(name, f"probe_{name}")
    Path("june.csv").write_text(text)
    added(*SERIES, code=2)
    added("june.csv", *JUNE[:4], "--tool", "moved", *FIRST)


@pytest.mark.parametrize("day", ["2026-05-04", "2026-06-02", "June"])
def test_a_line_that_is_not_the_newest_is_not_written(cell, day):
    added(*SERIES)
    text = Path("tracker.yaml").read_text()
    added("may.csv", "--date", day, "--base", "same", "--tool", "same", code=2)
    assert Path("tracker.yaml").read_text() == text


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (
            "datasets: {t: {series: [{path: a.csv, date: 2026-03-01}]}}\n",
            "datasets: {t: {series: [{path: a.csv, date: 2026-03-01}, NEW]}}\n",
        ),
        (
            "datasets:\r\n  t:\r\n    series:\r\n    - path: a.csv\r\n      date: 2026-03-01 #\r\n"
            "    # end\r\n    seed: 1\r\n",
            "datasets:\r\n  t:\r\n    series:\r\n    - path: a.csv\r\n      date: 2026-03-01 #\r\n"
            "    - NEW\r\n    # end\r\n    seed: 1\r\n",
        ),
        (
            "datasets:\n  t:\n    series:\n      - {path: a.csv, date: 2026-03-01}",
            "datasets:\n  t:\n    series:\n      - {path: a.csv, date: 2026-03-01}\n      - NEW\n",
        ),
        ("datasets:\n  t: &t\n    series: [{path: a.csv}]\n  u: *t\n", None),
    ],
)
def test_a_line_goes_where_the_others_stand_however_they_are_written(before, after):
    new = {"path": "june 2.csv", "date": date(2026, 6, 2), "base": "same", "tool": "moved"}
    where = ("datasets", "t", "series")
    if after is None:
        with pytest.raises(InputError, match="add by hand"):
            with_added(before, where, [new], "own.yaml")
        return
    told = "{path: june 2.csv, date: 2026-06-02, base: same, tool: moved}"
    assert with_added(before, where, [new], "own.yaml") == after.replace("NEW", told)

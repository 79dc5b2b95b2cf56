"""An arm measured again and again: each file calibrated once, and a history of them all.

Files are parts of the measured UR10 of the examples. What the history says is tested in
`tests/deployment`; here it is held to what it was made from, and to what is made anew.
"""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from preloaded import python
from shared_data import SHIPPED
from shared_work import once

from kinacc.tables.store import digest_of, read

MEASURED = SHIPPED / "ur10_tmac"
# Series D has another base and another tool than B.
FILES = {"march": ("B", 0, 80), "may": ("B", 300, 90), "june": ("D", 0, 100)}
LINES = {
    "march": "{path: march.csv, date: 2026-03-01}",
    "may": "{path: may.csv, date: 2026-05-04, base: same, tool: same}",
    "june": "{path: june.csv, date: 2026-06-02, base: moved, tool: moved}",
}
MARCH, MAY, JUNE = "tracker-2026-03-01", "tracker-2026-05-04", "tracker-2026-06-02"


def configured(folder: Path, names: Iterable[str]) -> Path:
    """A configuration with the lines of some files, in this order."""
    lines = "\n".join(f"      - {LINES[name]}" for name in names)
    path = folder / "tracker.yaml"
    path.write_text(f"""\
datasets:
  tracker:
    robot: ur10
    measurements:
      source: file
      file: {{joint_unit: deg, orientation: {{kind: euler, convention: XYZ}}}}
      folds: 3
    calibration:
      base_and_tool: estimated
      vec: {{order: 1}}
      dh: {{fit_to: measurements, hayati_joints: [2, 3]}}
    evaluation: {{space: measured}}
    series:
{lines}
figures: {{formats: [svg]}}
""")
    return path


@pytest.fixture(scope="module")
def two_lines(tmp_path_factory):
    """The folder of an arm measured in March and June."""

    def make(folder: Path) -> None:
        for name, (series, first, count) in FILES.items():
            names, *rows = (MEASURED / f"series_{series}.csv").read_text().splitlines()
            text = "\n".join([names, *rows[first : first + count]])
            (folder / f"{name}.csv").write_text(f"{text}\n")
        configured(folder, ["march", "june"])
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(folder)
            patch.setattr(sys, "executable", python())  # of the workflow that is started
            call("calibrate", "tracker.yaml", "--cores", "2", code=0)

    return once(tmp_path_factory, "two_lines", make)


@pytest.fixture
def arm(two_lines, tmp_path, monkeypatch):
    """A copy of that folder, called from."""
    shutil.copytree(two_lines, tmp_path / "arm")
    monkeypatch.chdir(tmp_path / "arm")
    monkeypatch.setattr(sys, "executable", python())
    return tmp_path / "arm"


def test_a_history_has_a_row_for_every_line_made_of_its_own_tables(arm):
    history = read("results/tracker/history.parquet")
    assert list(history["series"]) == [MARCH, JUNE]
    assert next(iter(history["verdict"])) == "first"
    assert list(history["base"]) == [None, "moved"]
    assert list(history["in_force"])[:2] == [None, MARCH]
    for row, line in enumerate(history["series"]):
        measured = f"results/{line}/measurements.parquet"
        assert history["digest"][row] == digest_of("measurements", read(measured))
        assert history["rows"][row] == len(read(measured)["pose"])
        stated = read(measured)["temperature_c"]
        assert history["temperature_c"][row] == pytest.approx(np.nanmean(stated))
        summary = read(f"results/{line}/summary.parquet")
        known = (summary["topic"] == "held_out_error") & (summary["item"] == history["model"][row])
        for name in ("mean", "quantile_99", "largest"):
            of_summary = summary["value"][known & (summary["statistic"] == name)]
            assert history[f"held_out_{name}_mm"][row] == pytest.approx(of_summary, rel=1e-12)


def test_a_line_that_is_added_makes_itself_and_the_history_alone(arm, capfd):
    configured(arm, ["march", "june", "may"])
    call("calibrate", "tracker.yaml", "--", "--dry-run", "--quiet", "reason", code=0)
    jobs = re.findall(r"^Job \d+: ([\w-]+): (.*)", capfd.readouterr().out, re.M)
    assert {name for name, _ in jobs} == {"tracker", MAY}
    (history,) = (text for name, text in jobs if name == "tracker")
    assert history.startswith("holding the calibrations of the series")

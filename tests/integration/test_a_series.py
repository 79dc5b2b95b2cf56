"""An arm measured again and again: each file calibrated once, and a history of them all.

Files are parts of the measured UR10 of the examples. What the history says is tested in
`tests/deployment`; here it is held to what it was made from, and to what is made anew.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from shared_work import once

from kinacc.artifacts.store import read, stated_digest
from kinacc.workflow.catalogue import STAGES
from kinacc.workflow.plan import Plan, planned
from kinacc.workflow.runner import is_done, perform

MEASURED = Path(__file__).parents[2] / "examples" / "data" / "ur10_tmac"
# Series D has another base and another tool than B.
FILES = {"march": ("B", 0, 80), "may": ("B", 300, 90), "june": ("D", 0, 100)}
LINES = {
    "march": "{path: march.csv, date: 2026-03-01}",
    "may": "{path: may.csv, date: 2026-05-04, base: same, tool: same}",
    "june": "{path: june.csv, date: 2026-06-02, base: moved, tool: moved}",
}
MARCH, MAY, JUNE = "tracker-2026-03-01", "tracker-2026-05-04", "tracker-2026-06-02"
REPORTED = ("history", "history_over_time")


def configured(folder: Path, names: Iterable[str], more: str = "") -> Path:
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
{more}
figures: {{formats: [svg]}}
""")
    return path


def made(plan: Plan) -> list[tuple[str, str]]:
    """Make what is not up to date of lines and history, and say what that was."""
    ran = []
    for dataset in (*plan.lines("tracker"), "tracker"):
        for name in plan.stages(dataset):
            wanted = dataset != "tracker" or name in REPORTED
            if wanted and not is_done(job := plan.job(name, dataset)):
                perform(job)
                ran.append((name, dataset))
    return ran


@pytest.fixture(scope="module")
def two_lines(tmp_path_factory):
    """The folder of an arm measured in March and June."""

    def make(folder: Path) -> None:
        for name, (series, first, count) in FILES.items():
            names, *rows = (MEASURED / f"series_{series}.csv").read_text().splitlines()
            text = "\n".join([names, *rows[first : first + count]])
            (folder / f"{name}.csv").write_text(f"{text}\n")
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(folder)
            made(planned([configured(folder, ["march", "june"])]))

    return once(tmp_path_factory, "two_lines", make)


@pytest.fixture
def arm(two_lines, tmp_path, monkeypatch):
    """A copy of that folder, called from."""
    shutil.copytree(two_lines, tmp_path / "arm")
    monkeypatch.chdir(tmp_path / "arm")
    return tmp_path / "arm"


def contents(arm: Path, *datasets: str) -> dict[Path, tuple[bytes, int]]:
    """Content and time of all files of data sets."""
    files = [path for name in datasets for path in (arm / "results" / name).rglob("*.*")]
    return {each: (each.read_bytes(), each.stat().st_mtime_ns) for each in files if each.is_file()}


def test_a_history_has_a_row_for_every_line_made_of_its_own_tables(arm):
    history = read("results/tracker/history.parquet")
    assert list(history["series"]) == [MARCH, JUNE]
    assert next(iter(history["verdict"])) == "first"
    assert list(history["base"]) == [None, "moved"]
    assert list(history["in_force"])[:2] == [None, MARCH]
    for row, line in enumerate(history["series"]):
        measured = f"results/{line}/measurements.parquet"
        assert history["digest"][row] == stated_digest(measured)
        assert history["rows"][row] == len(read(measured)["pose"])
        stated = read(measured)["temperature_c"]
        assert history["temperature_c"][row] == pytest.approx(np.nanmean(stated))
        summary = read(f"results/{line}/summary.parquet")
        known = (summary["topic"] == "held_out_error") & (summary["item"] == history["model"][row])
        for name in ("mean", "quantile_99", "largest"):
            of_summary = summary["value"][known & (summary["statistic"] == name)]
            assert history[f"held_out_{name}_mm"][row] == pytest.approx(of_summary, rel=1e-12)


def test_a_line_that_is_added_makes_itself_and_the_history_alone(arm):
    before = contents(arm, MARCH, JUNE)
    ran = made(planned([configured(arm, ["march", "june", "may"])]))
    assert {dataset for _, dataset in ran} == {MAY, "tracker"}
    assert [name for name, dataset in ran if dataset == "tracker"] == [*REPORTED]
    assert contents(arm, MARCH, JUNE) == before
    table = Path("results/tracker/history.parquet")
    assert list(read(table)["series"]) == [MARCH, MAY, JUNE]
    # Whatever order the lines are written in, and whatever else is configured.
    content = table.read_bytes()
    more = "  other: {robot: mh180, measurements: {synthetic: {poses: 80}}}\n"
    plan = planned([configured(arm, ["june", "may", "march"], more)])
    assert made(plan) == []
    table.unlink()
    perform(plan.job("history", "tracker"))
    assert table.read_bytes() == content


def test_a_history_is_checked_against_the_lines_it_was_made_from(arm):
    checked = call("check-results", "results/tracker", "--config", "tracker.yaml")
    assert "history" not in "".join(
        line for line in checked.output.splitlines() if line.startswith("  - ")
    )
    shutil.copy(f"results/{MARCH}/frames.parquet", f"results/{JUNE}/frames.parquet")
    checked = call("check-results", "results/tracker", "--config", "tracker.yaml")
    assert "history.parquet: was made from another tracker-2026-06-02/frames" in checked.output


def test_a_changed_number_of_a_history_is_found(arm):
    from kinacc.artifacts import records, store

    path = Path("results/tracker/history.parquet")
    history, marks = store.read(path), store.read_metadata(path)
    history["held_out_mean_mm"][1] *= 0.5
    table = store.to_table("history", history, marks)
    record = records.read(records.place("results/tracker", "history"))
    digest = table.schema.metadata[store.COLUMNS_DIGEST.encode()].decode()
    place = records.place("results/tracker", "history")
    records.leave(place, record, {str(path): (store.content_of(table), digest)})
    perform(planned(["tracker.yaml"]).job("history_over_time", "tracker"))
    checked = call("check-results", "results/tracker", "--config", "tracker.yaml")
    assert "history.parquet, column held_out_mean_mm" in checked.output


def test_single_stages_say_which_data_sets_they_cannot_be_of(arm):
    done = call("run", "study", "--config", "tracker.yaml", "--dataset", MARCH)
    assert done.exit_code == 2
    assert "a line of the series of tracker is calibrated only" in done.output
    assert "study" not in planned(["tracker.yaml"]).stages(JUNE)
    assert STAGES["history"].of_lines

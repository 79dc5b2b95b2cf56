"""A campaign on a measured series of a UR10: held-out poses, the calibration's own frame."""

from __future__ import annotations

import json

import numpy as np
import pytest
import shared_data
from command_line import call
from measured_worlds import measured_world
from stages_by_hand import run_stage

from kinacc.assess.single_shot import SingleShot
from kinacc.assess.world import conduct
from kinacc.campaign import folder as campaigns
from kinacc.tables import store

SERIES = "ur10_tmac/series_D.csv"
DATA = shared_data.place(SERIES)
pytestmark = shared_data.needed(SERIES)
SIGMA_MM = 0.05


@pytest.fixture(scope="module")
def ur10_d(tmp_path_factory):
    """Results of half of the series with one fold in two held out, and the held-out rows."""
    base = tmp_path_factory.mktemp("ur10")
    config, series = base / "ur10.yaml", base / "series.csv"
    head, *rows = DATA.read_text().splitlines()
    series.write_text("\n".join([head, *rows[::2]]) + "\n")
    config.write_text(
        "datasets: {ur10_d: {robot: ur10}}\n"
        f"measurements: {{source: file, folds: 2, file: {{path: '{series}'}}}}\n"
        "calibration: {base_and_tool: estimated, vec: {order: 1},"
        " dh: {fit_to: measurements, hayati_joints: [2, 3]}}\nevaluation: {space: measured}\n"
    )
    for stage in ("measurements", "vec", "dh", "residuals"):
        done = run_stage(stage, "--config", config, "--results", base / "results")
        assert done.exit_code == 0, done.output
    results = base / "results" / "ur10_d"
    seen = store.read(results / "measurements.parquet")
    held = np.flatnonzero(seen["subset"] == "validation")
    head = ["pose", *(f"q{i}_rad" for i in range(1, 7)), "x_mm", "y_mm", "z_mm"]
    columns = [seen["pose"], *(seen[f"q{i}"] for i in range(1, 7)),
               *(seen[f"{axis}_mm"] for axis in "xyz")]  # fmt: skip
    lines = [",".join(repr(each[row].item()) for each in columns) for row in held]
    file = base / "held_out.csv"
    file.write_text("\n".join([",".join(head), *lines]) + "\n")
    return results, file, len(held)


def start(ur10_d, folder, *more, candidates=20):
    return call("campaign", "start", folder, "--calibration", ur10_d[0], "--model", "dh",
                "--candidates", candidates, "--noise-mm", SIGMA_MM, *more)  # fmt: skip


def test_a_box_of_joints_that_was_hardly_measured_is_asked_about(ur10_d, tmp_path):
    """In all poses of the series the flange points the same way, in hardly any of the box."""
    folder = tmp_path / "campaign"
    done = start(ur10_d, folder, "--region", "fitted")
    assert done.exit_code == 2
    assert "candidates: 20 of 20" in done.output
    assert "--region measured" in done.output
    assert not folder.exists()
    done = start(ur10_d, folder, "--region", "fitted", "--sure", "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["far_from_data"] == 20


def test_candidates_of_a_thin_series_are_drawn_where_it_was_measured(ur10_d, tmp_path):
    plans = []
    for name, more in (("one", ()), ("same", ()), ("other", ("--seed", 1))):
        done = start(ur10_d, tmp_path / name, "--json", *more)
        assert done.exit_code == 0, done.output
        assert json.loads(done.stdout)["far_from_data"] == 0
        assert not done.stderr
        plans.append(campaigns.open_(tmp_path / name).plan)
    assert plans[0].about["candidates"] == "drawn between neighbouring measured poses"
    one, same, other = (plan.points.joints for plan in plans)
    np.testing.assert_array_equal(one, same)
    assert not np.isin(one, other).any()
    # Forearm and upper arm are parallel to a plane that the flange keeps to: q2 + q3 + q4 is fixed.
    measured = store.read(ur10_d[0] / "measurements.parquet")
    wanted = sum(measured[f"q{joint}"] for joint in (2, 3, 4))
    found = one[:, 1:4].sum(axis=1)
    assert wanted.min() - 0.01 < found.min() <= found.max() < wanted.max() + 0.01


def test_the_series_itself_imported_whole_says_what_it_says_in_memory(ur10_d, tmp_path):
    folder, (_, file, points) = tmp_path / "campaign", ur10_d
    more = ("--robot", "ur10", "--assessor", "single_shot", "--budget", points)
    for done in (start(ur10_d, folder, *more, candidates=file),
                 call("campaign", "record", folder, file)):  # fmt: skip
        assert done.exit_code == 0, done.output
    state = campaigns.open_(folder).state
    assert len(state.used) == points
    errors = np.array([each.error_mm for each in state.used])
    # These are the held-out residuals of the calibration itself, in another frame.
    columns = store.read(ur10_d[0] / "residuals.parquet")
    row = (columns["comparison"] == "dh_vs_measured") & (columns["subset"] == "validation")
    row &= (columns["quantity"] == "position") & (columns["fold"] == 0)
    sizes = np.linalg.norm(errors, axis=1)
    assert sizes.max() == pytest.approx(columns["max"][row][0], rel=1e-6)
    assert np.sqrt(np.mean(sizes**2)) == pytest.approx(columns["rms"][row][0], rel=1e-6)
    wanted = conduct(SingleShot(measurements=len(errors)), measured_world(
        errors, np.zeros((len(errors), 0, 3)), SIGMA_MM))  # fmt: skip
    # Bounds at equal points stand once.
    (bound,) = json.loads(call("campaign", "status", folder, "--json").stdout)["bounds"]
    (stated,) = (each for each in wanted.statements() if each.target == bound["target"])
    for name in ("value_mm", "lower_mm", "upper_mm"):
        assert bound[name] == pytest.approx(getattr(stated, name), abs=1e-7)

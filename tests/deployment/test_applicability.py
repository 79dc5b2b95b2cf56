"""Whether a pose lies where the calibration was measured, where joints were measured together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shared_data
from small_arms import calibrated, joints, measured, measured_at, results_of
from stages_by_hand import run_stage

from kinacc.deployment import folder
from kinacc.deployment.applicability import is_measured_there, share_of_box
from kinacc.deployment.folder import calibration
from kinacc.kinematics import robot
from kinacc.kinematics.model import JointState

SERIES = "ur10_tmac/series_D.csv"


@pytest.mark.parametrize("model", ["dh", "vec"])
def test_a_gap_between_two_clusters_of_poses_is_not_where_it_was_measured(model):
    rng, middle = np.random.default_rng(5), np.deg2rad([-50.0, -90.0, 30.0, -60.0, -60.0, 10.0])
    sides = np.where(rng.random(200) < 0.5, -0.85, 0.85)[:, None]
    seen = measured_at("ur10", middle + sides + rng.uniform(-0.35, 0.35, (200, 6)))
    found = calibration(results_of("ur10", seen), robot.load("ur10"), model, "ur10")
    found = replace(found, fitted=JointState(seen.q_rad))
    between = middle + rng.uniform(-0.3, 0.3, (100, 6))
    assert not found.outside_range(between).any()
    assert not is_measured_there(found, JointState(between)).any()
    assert is_measured_there(found, JointState(seen.q_rad)).mean() > 0.9


@pytest.fixture(scope="module")
def part_of_the_series(tmp_path_factory):
    """Results of the 60 % of a series that are nearest to its first pose, and the other rows."""
    base = tmp_path_factory.mktemp("part")
    lines = shared_data.path_of(SERIES).read_text(encoding="utf-8").splitlines()
    table = np.genfromtxt(lines, delimiter=",", names=True)
    q_deg = np.stack([table[f"q{i}_deg"] for i in range(1, 7)], axis=1)
    far = np.linalg.norm(q_deg - q_deg[0], axis=1)
    kept = far <= np.quantile(far, 0.6)
    rows = [line for line, there in zip(lines[1:], kept, strict=True) if there]
    (base / "part.csv").write_text("\n".join([lines[0], *rows]) + "\n")
    (base / "part.yaml").write_text(
        "datasets: {part: {robot: ur10}}\n"
        "measurements: {source: file, folds: 5, file: {path: part.csv, orientation: {kind: euler,"
        " convention: XYZ, unit: deg}}}\n"
        "calibration: {base_and_tool: estimated, vec: {order: 1},"
        " dh: {fit_to: measurements, hayati_joints: [2, 3]}}\nevaluation: {space: measured}\n"
    )
    for stage in ("measurements", "data_check", "vec", "dh", "residuals", "summary"):
        done = run_stage(stage, "--config", base / "part.yaml", "--results", base / "results")
        assert done.exit_code == 0, done.output
    seen = np.stack([table[f"{axis}_mm"] for axis in "xyz"], axis=1)
    return base / "results" / "part", np.deg2rad(q_deg[~kept]), seen[~kept]


@shared_data.needed(SERIES)
def test_errors_are_the_usual_ones_where_it_was_measured_and_larger_elsewhere(part_of_the_series):
    results, q_rad, seen_mm = part_of_the_series
    arm = folder.recorded_robot(results)
    found = folder.calibration(folder.read_tables(results), arm, "dh")
    at = JointState(arm.dh_joints(q_rad))
    off_mm = np.linalg.norm(found.pose(at, "instrument").position_mm - seen_mm, axis=1)
    inside = is_measured_there(found, at)
    assert 10 < inside.sum() < len(inside) - 100
    usual, there, elsewhere = found.residual.position_mm, off_mm[inside], off_mm[~inside]
    assert np.sqrt(np.mean(there**2)) < 1.3 * usual
    assert np.sqrt(np.mean(elsewhere**2)) > 2.0 * usual


def test_a_box_that_was_measured_everywhere_is_where_it_was_measured():
    found = replace(calibrated("ur10"), fitted=JointState(measured("ur10").q_rad))
    low, high = joints("ur10", 2000).min(axis=0), joints("ur10", 2000).max(axis=0)
    assert share_of_box(found, low, high) > 0.9
    beyond = found.robot.dh_joints(np.stack([low, high + 1.0]))
    assert not is_measured_there(found, JointState(beyond))[1]

"""Several sessions of one arm: a base each, one robot and one tool."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from measured_files import write_readings
from scipy.spatial.transform import Rotation
from simulated import POINT, POSE, THREE, disturbed, fit, joints, measure
from stages_by_hand import run_stages

from kinacc.calibration.dh_estimator import free_parameters
from kinacc.kinematics import robot
from kinacc.kinematics.robot import forward
from kinacc.tables import store

ARM = robot.load("ur10")
FREE = free_parameters(6, (2, 3))


def observed(kind, sessions, count=120):
    rng = np.random.default_rng(0)
    return measure(disturbed(ARM.dh, FREE, rng), joints(ARM, count, rng), kind, rng, 0.02, sessions)


@pytest.mark.parametrize(("kind", "noise_mm"), [(POINT, 0.02), (THREE, 0.02), (POSE, 0.037)])
def test_sessions_share_the_arm_and_not_the_base(kind, noise_mm):
    seen = observed(kind, 4)
    found = fit(seen, ARM.dh, FREE)
    assert np.sqrt(found.solution.variance) == pytest.approx(noise_mm, rel=0.15)
    assert found.frames.sessions == 4
    # All sessions tell of one arm: together they know it better than the first alone.
    first = replace(seen.select(seen.session == 0), session_names=(None,))
    alone = fit(first, ARM.dh, FREE)
    assert np.nanmedian(found.std / alone.std) == pytest.approx(0.5, abs=0.2)


def test_a_dh_model_that_follows_the_vec_model_is_of_all_sessions(tmp_path):
    rng = np.random.default_rng(2)
    arm = replace(ARM, dh=disturbed(ARM.dh, np.ones((6, 5), dtype=bool), rng))
    q = joints(ARM, 60, rng)
    pose = forward(arm, q)
    session = np.arange(60) // 30
    at = pose.position_mm + session[:, None] * [900.0, -400.0, 50.0]
    turned = Rotation.from_matrix(pose.rotation)
    write_readings(tmp_path / "file.csv", q, at, turned, session=session)
    (tmp_path / "arm.yaml").write_text(
        "datasets: {arm: {robot: ur10, measurements: {source: file, file: {path: file.csv,"
        " orientation: {kind: quaternion}}}, calibration: {"
        "base_and_tool: estimated, vec: {order: 0}, dh: {fit_to: vec}}, "
        "evaluation: {space: measured}}}\n"
    )
    results = run_stages(
        ("measurements", "vec", "dh"), [tmp_path / "arm.yaml"], tmp_path / "results"
    )
    frames = store.read(results / "frames.parquet")
    bases = [
        (frames["model"] == "dh") & (frames["frame"] == "base") & (frames["session"] == name)
        for name in ("0", "1")
    ]
    first, second = (np.array([frames[f"{a}_mm"][row][0] for a in "xyz"]) for row in bases)
    np.testing.assert_allclose(second - first, [900.0, -400.0, 50.0], atol=0.5)

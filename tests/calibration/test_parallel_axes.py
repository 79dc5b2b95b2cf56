"""An arm of parallel axes: base and tool stay where they were along what no pose shows."""

from dataclasses import replace

import numpy as np
import pytest

from kinacc.calibration import fitting
from kinacc.calibration.constraints import free_parameters
from kinacc.calibration.observations import full_poses
from kinacc.geometry import Pose, compose, exp_so3
from kinacc.kinematics import dh
from kinacc.kinematics.dh import DHModel

SCARA = DHModel(
    np.zeros(4),
    [300.0, 0.0, 0.0, 50.0],
    [350.0, 250.0, 0.0, 0.0],
    np.radians([0.0, 180.0, 0.0, 0.0]),
    np.zeros(4),
    [False, False, True, False],
)
BASE = Pose(exp_so3(np.array([0.3, -1.1, 2.0])), np.array([900.0, 20.0, 950.0]))
LOW, HIGH = np.array([-2.4, -2.5, 0.0, -6.0]), np.array([2.4, 2.5, 200.0, 6.0])


def fitted(whole, tool_z_mm=0.0):
    """Fit of the nominal arm and of all DH parameters to the same 300 readings of an arm askew."""
    rng = np.random.default_rng(4)
    errors = np.tile([1e-3, 0.3, 0.3, 1e-3, 1e-3], 4) * rng.normal(size=20)
    # Beta of the last joint is a turn of the tool.
    errors[-1] = 0.0
    arm = SCARA.with_parameters(SCARA.start + errors)
    q_rad = LOW + rng.uniform(size=(300, 4)) * (HIGH - LOW)
    tool = Pose(np.eye(3), np.array([40.0, 30.0, tool_z_mm]))
    seen = compose(BASE, compose(dh.forward(arm, q_rad), tool))
    noise = rng.normal(size=(300, 6))
    turned = exp_so3(1e-4 * noise[:, 3:]) @ seen.rotation
    observations = full_poses(q_rad, Pose(turned, seen.position_mm + 0.05 * noise[:, :3]))
    if not whole:
        nothing = np.full_like(turned, np.nan)
        observations = replace(observations, rotation=nothing)
    fit = fitting.fit(
        observations,
        SCARA,
        free=free_parameters(4, (1, 2, 3)),
        rotation_weight_mm_per_rad=500.0,
        threshold=1e-2,
    )
    nominal = fitting.fit_frames(observations, SCARA, rotation_weight_mm_per_rad=500.0)
    return fit, nominal


@pytest.mark.parametrize("whole", [False, True], ids=["positions", "poses"])
def test_base_and_tool_stay_along_the_axes_all_joints_share(whole):
    fit, nominal = fitted(whole)
    assert abs(nominal.tool.position_mm[2]) < 1e-6
    assert abs(fit.frames.tool.position_mm[2]) < 2.0
    moved = fit.frames.base.position_mm - nominal.base.position_mm
    assert np.linalg.norm(moved) < 2.0
    assert not np.isfinite(fit.solution.std[2])  # which is not to say that it is known


@pytest.mark.parametrize("tool_z_mm", [0.0, 200.0])
def test_holding_them_costs_nothing(tool_z_mm):
    fit, _ = fitted(False, tool_z_mm)
    assert fit.solution.variance == pytest.approx(0.05**2, rel=0.2)

"""An arm of parallel axes: base and tool stay where they were along what no pose shows."""

from __future__ import annotations

import numpy as np
import pytest
from kinematics.inverse.arms import SCARA
from simulated import POINT, POSE, disturbed, fit, joints, measure

from kinacc.calibration import fitting
from kinacc.calibration.dh_estimator import free_parameters
from kinacc.geometry import Pose, exp_so3

BASE = Pose(exp_so3(np.array([[0.3, -1.1, 2.0]])), np.array([[900.0, 20.0, 950.0]]))


@pytest.mark.parametrize(("kind", "tool_z_mm"), [(POINT, 0.0), (POINT, 200.0), (POSE, 0.0)])
def test_base_and_tool_stay_along_the_axes_all_joints_share(kind, tool_z_mm):
    """Fit of the nominal arm and of all DH parameters to the same 300 readings of an arm askew."""
    rng = np.random.default_rng(4)
    off = np.ones((4, 5))
    off[-1, -1] = 0.0  # beta of the last joint is a turn of the tool
    arm = disturbed(SCARA.dh, off, rng, 1e-3, 0.3)
    tool = Pose(np.eye(3)[None], np.array([[40.0, 30.0, tool_z_mm]]))
    seen = measure(arm, joints(SCARA, 300, rng), kind, rng, frames=(BASE, tool))
    found = fit(seen, SCARA.dh, free_parameters(4, (1, 2, 3)), threshold=1e-2)
    nominal = fitting.fit_frames(seen, SCARA.dh, rotation_weight_mm_per_rad=500.0)
    assert abs(nominal.tool.position_mm[2]) < 1e-6
    assert abs(found.frames.tool.position_mm[2]) < 2.0
    moved = found.frames.base.position_mm - nominal.base.position_mm
    assert np.linalg.norm(moved) < 2.0 + tool_z_mm
    assert not np.isfinite(found.solution.std[2])  # which is not to say that it is known
    if kind == POINT:  # holding them costs nothing
        assert found.solution.variance == pytest.approx(0.05**2, rel=0.2)

"""Whether readings of the candidates can be judged against the calibration at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinacc.calibration.uncertainty import Uncertainty
from kinacc.campaign import begin
from kinacc.campaign.slips import far_from_data, of_candidates
from kinacc.deployment.planning import spread
from kinacc.deployment.predict import predict
from kinacc.deployment.record import Residual
from kinacc.kinematics.model import JointState


@pytest.fixture(scope="module")
def points(arm):
    return begin.points_of(arm, spread(arm.robot, 30), [str(i) for i in range(30)])


@pytest.fixture(scope="module")
def calibrated(arm):
    """The nominal arm with a deviation of the first joint's zero, and directions nobody saw."""
    names = arm.model.names

    def make(std_rad, blind_per_unit=0.0):
        covariance = np.zeros((len(names), len(names)))
        place = names.index("j1.theta_offset_rad")
        covariance[place, place] = std_rad**2
        undetermined = np.zeros((1 if blind_per_unit else 0, len(names)))
        if blind_per_unit:
            undetermined[0, names.index("j1.d_mm")] = blind_per_unit
        known = Uncertainty(names, covariance, undetermined)
        return replace(arm, known=known, residual=Residual(0.3, 0.001, "validation"))

    return make


def test_an_arm_that_was_never_fitted_is_not_judged(arm, points):
    assert not far_from_data(arm, points, None).any()


def test_candidates_known_less_well_than_the_poses_of_the_fit_are_counted(calibrated, points):
    assert not far_from_data(calibrated(1e-5), points, None).any()
    arm = calibrated(1e-3)
    std = predict(arm, points.joints).std_position_mm
    # A turn of the base by 1 mrad moves a point by 1 mm per metre from the axis.
    np.testing.assert_allclose(std, 1e-3 * np.hypot(*points.modelled_mm[:, :2].T), rtol=1e-6)
    near = arm.robot.dh_joints(points.joints[np.argsort(std)[:15]])
    arm = replace(arm, fitted=JointState(near))
    # The last of the fifteen is beyond what 99 % of them keep.
    assert far_from_data(arm, points, None).sum() == 16
    (problem,) = of_candidates(arm, points, None)
    assert f"{std.max():.3g} mm" in problem.what

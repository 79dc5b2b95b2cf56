"""Covariance of a fit in coordinates that outlive it, and the directions it cannot see."""

import numpy as np
from deployment.small_arms import joints, moved, results_of, seen_of
from pose_checks import movement

from kinacc.calibration.uncertainty import scale_of
from kinacc.deployment.folder import calibration
from kinacc.kinematics import robot


def test_undetermined_directions_move_no_measured_pose():
    seen = seen_of(robot.load("mh180").dh, joints("mh180", 60))
    tables, at = results_of("mh180", seen), seen.at
    arm = calibration(tables, "dh")
    known = arm.known
    rank = tables["dh_fit"]["value"][tables["dh_fit"]["quantity"] == "rank"]
    assert len(known.undetermined) == 24 - rank.item() > 3
    unit = np.array([scale_of(name) for name in known.names])
    for direction in known.undetermined:
        assert np.linalg.norm(direction) >= 1.0 - 1e-9
        # Small enough that the second order, 1e-6 of the arm's length per mrad squared, is nothing.
        after = moved(arm, dict(zip(known.names, 1e-3 * direction * unit, strict=True)))
        apart = np.abs(movement(arm.pose(at, "instrument"), after.pose(at, "instrument")))
        assert apart[:, :3].max() < 1e-5
        assert apart[:, 3:].max() < 1e-8
    # Where nothing is known of a parameter, nothing is said of it.
    assert np.isfinite(known.covariance).all()
    assert not known.determined[known.names.index("j1.d_mm")]
    columns = tables["dh_covariance"]
    unknown = (columns["parameter"] == "j1.d_mm") | (columns["other"] == "j1.d_mm")
    assert np.isnan(columns["correlation"][unknown]).all()

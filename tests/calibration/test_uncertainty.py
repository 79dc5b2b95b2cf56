"""Covariance of a fit in coordinates that outlive it, and the directions it cannot see."""

from __future__ import annotations

import numpy as np
from simulated import POSE, fit, measure

from kinacc.calibration import frames, tables, uncertainty
from kinacc.calibration.dh_estimator import free_parameters
from kinacc.geometry import Pose, compose, exp_so3, log_so3
from kinacc.kinematics import dh, robot

ARM = robot.load("mh180")


def moved(fit, names, step, q_rad):
    """Poses of a fit whose parameters are displaced by ``step``, in their units."""
    of = dict(zip(names, step, strict=True))

    def frame(pose, name):
        motion = np.array([of[f"{name}.{component}"] for component in frames.MOTIONS])
        return Pose(exp_so3(motion[3:]) @ pose.rotation, pose.position_mm + motion[:3])

    change = np.array([of.get(name, 0.0) for name in fit.model.names])
    model = fit.model.with_parameters(fit.model.start + change)
    base, tool = frame(fit.frames.base, "base"), frame(fit.frames.tool, "t0")
    return compose(base, compose(dh.forward(model, q_rad), tool))


def test_undetermined_directions_move_no_measured_pose():
    share = np.random.default_rng(5).uniform(0.3, 0.7, (60, 6))
    q = ARM.q_min_rad + share * (ARM.q_max_rad - ARM.q_min_rad)
    seen = measure(ARM.dh, q, POSE, np.random.default_rng(0))
    found = fit(seen, ARM.dh, free_parameters(6))
    known = uncertainty.of_fit(found)
    assert len(known.undetermined) == 24 - found.solution.spectrum.rank > 3
    unit = np.array([uncertainty.scale_of(name) for name in known.names])
    before = moved(found, known.names, 0.0 * unit, q)
    for direction in known.undetermined:
        assert np.linalg.norm(direction) >= 1.0 - 1e-9
        # Small enough that the second order, 1e-6 of the arm's length per mrad squared, is nothing.
        after = moved(found, known.names, 1e-3 * direction * unit, q)
        assert np.abs(after.position_mm - before.position_mm).max() < 1e-5
        assert np.abs(log_so3(after.rotation @ np.swapaxes(before.rotation, 1, 2))).max() < 1e-8
    # Where nothing is known of a parameter, nothing is said of it.
    assert np.isfinite(known.covariance).all()
    assert not known.determined[known.names.index("j1.d_mm")]
    columns = tables.covariance_columns(known)
    unknown = (columns["parameter"] == "j1.d_mm") | (columns["other"] == "j1.d_mm")
    assert np.isnan(columns["correlation"][unknown]).all()

"""Covariance of a fit in coordinates that outlive it, and the directions it cannot see."""

import numpy as np
import pytest

from kinacc.calibration import fitting, frames, tables, uncertainty
from kinacc.calibration.constraints import free_parameters
from kinacc.calibration.frames import Frames
from kinacc.calibration.observations import full_poses
from kinacc.geometry import Pose, compose, exp_so3, log_so3
from kinacc.kinematics import dh, robot

BASE = Pose(exp_so3(np.array([0.3, -1.1, 2.0])), np.array([2500.0, -900.0, 400.0]))
TOOL = Pose(exp_so3(np.array([-0.4, 0.2, 0.7])), np.array([30.0, -20.0, 150.0]))
NOISE_MM = 0.05


def measured(arm, poses=60, seed=0, noise_mm=NOISE_MM, q_seed=5):
    share = np.random.default_rng(q_seed).uniform(0.3, 0.7, (poses, 6))
    q_rad = arm.q_min_rad + share * (arm.q_max_rad - arm.q_min_rad)
    seen = compose(BASE, compose(dh.forward(arm.dh, q_rad), TOOL))
    noise = np.random.default_rng(seed).normal(0.0, 1.0, (poses, 6))
    turned = exp_so3(noise[:, 3:] * noise_mm / 500.0) @ seen.rotation
    return full_poses(q_rad, Pose(turned, seen.position_mm + noise_mm * noise[:, :3]))


def fitted(arm, observations, threshold=1e-3):
    return fitting.fit(
        observations,
        arm.dh,
        free=free_parameters(6),
        rotation_weight_mm_per_rad=500.0,
        threshold=threshold,
    )


def moved_arm(fit, names, direction, size):
    """Model and frames displaced along a direction in mm and mrad."""
    step = size * direction * np.where([uncertainty.is_angle(n) for n in names], 1e-3, 1.0)
    of = dict(zip(names, step, strict=True))

    def frame(pose, name):
        motion = np.array([of[f"{name}.{m}"] for m in frames.MOTIONS])
        return Pose(exp_so3(motion[3:]) @ pose.rotation, pose.position_mm + motion[:3])

    vector = fit.model.start.copy()
    for index, name in enumerate(fit.model.names):
        vector[index] += of.get(name, 0.0)
    tool = frame(fit.frames.tool, "tool")
    base = frame(fit.frames.base, "base")
    return fit.model.with_parameters(vector), Frames(base, frames.known(tool=tool).targets)


def seen_by(model, frames_, q_rad):
    return compose(frames_.base, compose(dh.forward(model, q_rad), frames_.tool))


def test_undetermined_directions_move_no_measured_pose():
    arm = robot.load("mh180")
    observations = measured(arm)
    fit = fitted(arm, observations)
    known = uncertainty.of_fit(fit, ("tool",))
    assert len(known.undetermined) == 24 - fit.solution.spectrum.rank > 3
    before = seen_by(fit.model, fit.frames, observations.q_rad)
    for direction in known.undetermined:
        assert np.linalg.norm(direction) >= 1.0 - 1e-9
        # Small enough that the second order, 1e-6 of the arm's length per mrad squared, is nothing.
        model, moved = moved_arm(fit, known.names, direction, 1e-3)
        after = seen_by(model, moved, observations.q_rad)
        assert np.abs(after.position_mm - before.position_mm).max() < 1e-5
        assert np.abs(log_so3(after.rotation @ np.swapaxes(before.rotation, 1, 2))).max() < 1e-8
    # Where nothing is known of a parameter, nothing is said of it.
    assert np.isfinite(known.covariance).all()
    assert not known.determined[known.names.index("j1.d_mm")]
    columns = tables.covariance_columns(known)
    blind = (columns["parameter"] == "j1.d_mm") | (columns["other"] == "j1.d_mm")
    assert np.isnan(columns["correlation"][blind]).all()


def test_predicted_spread_is_that_of_repeated_fits():
    """Fit the same poses under forty draws of the noise: predictions scatter as the covariance."""
    arm = robot.load("mh180")
    q_far = measured(arm, poses=8, q_seed=9, noise_mm=0.0).q_rad
    fits = [fitted(arm, measured(arm, poses=40, seed=seed)) for seed in range(40)]
    seen = np.array([seen_by(f.model, f.frames, q_far).position_mm for f in fits])
    scatter = seen.var(axis=0, ddof=1).sum(axis=1)
    known = uncertainty.of_fit(fits[0], ("tool",))
    units = np.where([uncertainty.is_angle(n) for n in known.names], 1e-3, 1.0)
    values, vectors = np.linalg.eigh(known.covariance / np.outer(units, units))
    root = units[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    variance = np.zeros(8)
    here = seen_by(fits[0].model, fits[0].frames, q_far).position_mm
    for column in root.T:
        model, moved = moved_arm(fits[0], known.names, column / units, 1.0)
        variance += np.sum((seen_by(model, moved, q_far).position_mm - here) ** 2, axis=1)
    # 40 draws of 3 components: the variance itself is known to one part in seven; pooled, better.
    assert scatter.mean() / variance.mean() == pytest.approx(1.0, abs=0.3)
    assert (scatter / variance).max() < 2.0
    assert (scatter / variance).min() > 0.5

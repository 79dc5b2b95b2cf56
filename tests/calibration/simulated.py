"""Simulated calibration data of any arm: disturbed, carried somewhere, seen by some instrument."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinacc.calibration import fitting
from kinacc.calibration.frames import Frames
from kinacc.calibration.observations import full_poses
from kinacc.geometry import Pose, compose, exp_so3
from kinacc.kinematics import dh
from kinacc.kinematics.model import JointState

POINT, THREE, POSE = "point", "three", "pose"  # what the instrument sees of every pose
ORIENTATION_NOISE_RAD = 1e-4


def joints(arm, count, rng):
    """DH joints (n, k) all over the limits, one turn at most."""
    turn = np.where(arm.dh.prismatic, np.inf, np.pi)
    low, high = np.maximum(arm.q_min_rad, -turn), np.minimum(arm.q_max_rad, turn)
    return rng.uniform(low, high, (count, arm.dh.joints)) @ arm.joint_map.T


def disturbed(model, free, rng, angle_rad=1e-3, length_mm=0.5):
    """The model with its ``free`` (k, 5) parameters off as a calibration finds them."""
    size = np.array([angle_rad, length_mm, length_mm, angle_rad, angle_rad])
    table = model.start.reshape(-1, 5)
    return model.with_parameters((table + free * size * rng.normal(size=table.shape)).ravel())


def far_off(model, free, rng):
    """Free (k, 5) parameters up to 5 degrees and 20 mm off; parallel axes (Hayati) a degree."""
    size = np.array([np.deg2rad(5.0), 20.0, 20.0, np.deg2rad(5.0), np.deg2rad(5.0)])
    shift = size * rng.uniform(-1, 1, free.shape) * free
    shift[free[:, 4], 3:] *= 0.2
    return model.with_parameters(model.start + shift.ravel())


def anywhere(rng, distance_mm, count=None):
    shape = (3,) if count is None else (count, 3)
    return Pose(exp_so3(rng.normal(size=shape)), distance_mm * rng.normal(size=shape))


def frames_of(bases, targets):
    return Frames(Pose(*map(np.concatenate, zip(bases, targets, strict=True))), len(bases[0]))


def measure(
    model, q_rad, kind, rng, noise_mm=0.05, sessions=1, frames=None, noise_rad=ORIENTATION_NOISE_RAD
):
    """Observations of ``kind`` of an arm of any model at DH joints (n, k), dealt over sessions.

    ``frames``: poses of bases and targets, anywhere if not stated.
    """
    poses, targets = len(q_rad), 3 if kind == THREE else 1
    bases, tools = frames or (anywhere(rng, 1500.0, sessions), anywhere(rng, 80.0, targets))
    pose, target = np.repeat(np.arange(poses), targets), np.tile(np.arange(targets), poses)
    session = pose % sessions
    flange = model.pose(JointState(q_rad[pose]))
    carried = compose(flange, Pose(tools.rotation[target], tools.position_mm[target]))
    seen = compose(Pose(bases.rotation[session], bases.position_mm[session]), carried)
    rotation = np.full((len(pose), 3, 3), np.nan)
    if kind == POSE:
        rotation = exp_so3(noise_rad * rng.normal(size=(len(pose), 3))) @ seen.rotation
    position_mm = seen.position_mm + noise_mm * rng.normal(size=(len(pose), 3))
    return replace(
        full_poses(q_rad[pose], Pose(rotation, position_mm)),
        pose=pose,
        target=target,
        fold=pose % 5,
        target_names=tuple(f"t{number}" for number in range(targets)),
        session=session,
        session_names=(None,) if sessions == 1 else tuple(f"s{i}" for i in range(sessions)),
    )


def fit(observations, nominal, free, **settings):
    """A DH fit of full weight of rotations, truncated at 1e-3 unless ``settings`` say otherwise."""
    settings = {"rotation_weight_mm_per_rad": 500.0, "threshold": 1e-3} | settings
    return fitting.fit(observations, nominal, free=free, **settings)


def predicted(fit, q_rad):
    """Poses (n, ...) of the first target by a fit."""
    return compose(fit.frames.base, compose(dh.forward(fit.model, q_rad), fit.frames.tool))

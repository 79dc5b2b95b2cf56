"""Simulated calibration data of any arm: disturbed, carried somewhere, seen by some instrument."""

from __future__ import annotations

import numpy as np

from kinacc.calibration.observations import Observations
from kinacc.geometry import Pose, compose, exp_so3
from kinacc.kinematics import dh

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


def far_off(model, rng, angle_deg=5.0, length_mm=20.0):
    """The model with joint offsets and lengths anywhere within these distances."""
    table = model.start.reshape(-1, 5).copy()
    table[:, 0] += np.deg2rad(angle_deg) * rng.uniform(-1, 1, len(table))
    table[:, 1:3] += length_mm * rng.uniform(-1, 1, (len(table), 2))
    return model.with_parameters(table.ravel())


def anywhere(rng, distance_mm, count=None):
    shape = (3,) if count is None else (count, 3)
    return Pose(exp_so3(rng.normal(size=shape)), distance_mm * rng.normal(size=shape))


def measure(model, q_rad, kind, rng, noise_mm=0.05, sessions=1):
    """Observations of ``kind`` of an arm ``model`` at DH joints (n, k), dealt over sessions."""
    poses, targets = len(q_rad), 3 if kind == THREE else 1
    bases, tools = anywhere(rng, 1500.0, sessions), anywhere(rng, 80.0, targets)
    pose, target = np.repeat(np.arange(poses), targets), np.tile(np.arange(targets), poses)
    session = pose % sessions
    flange = dh.forward(model, q_rad[pose])
    carried = compose(flange, Pose(tools.rotation[target], tools.position_mm[target]))
    seen = compose(Pose(bases.rotation[session], bases.position_mm[session]), carried)
    rotation = np.full((len(pose), 3, 3), np.nan)
    if kind == POSE:
        turn = exp_so3(ORIENTATION_NOISE_RAD * rng.normal(size=(len(pose), 3)))
        rotation = turn @ seen.rotation
    zeros = np.zeros(len(pose), dtype=int)
    return Observations(
        q_rad=q_rad[pose],
        s=np.zeros((len(pose), q_rad.shape[1]), np.int8),
        position_mm=seen.position_mm + noise_mm * rng.normal(size=(len(pose), 3)),
        rotation=rotation,
        pose=pose,
        target=target,
        repeat=zeros,
        fold=pose % 5,
        target_names=tuple(f"t{number}" for number in range(targets)),
        session=session,
        session_names=(None,) if sessions == 1 else tuple(f"s{i}" for i in range(sessions)),
    )

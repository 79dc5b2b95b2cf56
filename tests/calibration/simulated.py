"""Simulated calibration data of any arm: disturbed, carried somewhere, seen by some instrument."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd

from kinacc.calibration import fitting
from kinacc.calibration.frames import Frames
from kinacc.calibration.observations import full_poses
from kinacc.geometry import Pose, compose, exp_so3, quaternion_from_rotation
from kinacc.kinematics import dh
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.model import ErrorModel, JointState

POINT, THREE, POSE = "point", "three", "pose"  # what the instrument sees of every pose
ORIENTATION_NOISE_RAD = 1e-4


@dataclass(frozen=True)
class Ripple(ErrorModel):
    """DH parameters, and a sine and a cosine of every joint's angle added to it."""

    dh: DHModel
    waves: np.ndarray = field(default_factory=lambda: np.zeros((6, 2)))
    kind = "ripple"

    @property
    def names(self):
        waves = [f"j{i}.{name}_rad" for i in range(1, 7) for name in ("sine", "cosine")]
        return (*self.dh.names, *waves)

    @property
    def units(self):
        return (*self.dh.units, *["rad"] * 12)

    @property
    def start(self):
        return np.concatenate([self.dh.start, self.waves.ravel()])

    @property
    def prior_std(self):
        return np.concatenate([self.dh.prior_std, np.full(12, 1e-3)])

    def with_parameters(self, x):
        return type(self)(self.dh.with_parameters(x[:-12]), x[-12:].reshape(6, 2))

    def pose(self, at):
        q = at.q_rad
        turned = self.waves[:, 0] * np.sin(q) + self.waves[:, 1] * np.cos(q)
        return self.dh.pose(at.moved(q + turned))


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


def wavy(plain, rng):
    """A VEC model without errors, given some of a tenth of a millimetre and of a milliradian."""
    size = np.array([0.1] * 3 + [1e-4] * 3)[:, None]
    coefficients = size * rng.normal(size=plain.coefficients.shape)
    offsets = 1e-4 * rng.normal(size=plain.direction_offsets_rad.shape)
    return replace(plain, coefficients=coefficients, direction_offsets_rad=offsets)


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


def columns_of(seen):
    """The columns of ``measurements``, by name, of an arm whose joints are those of its table."""
    joints = [f"{letter}{number}" for letter in "qs" for number in range(1, seen.joints + 1)]
    turned = quaternion_from_rotation(seen.rotation)
    table = pd.DataFrame(
        np.hstack([seen.q_rad, seen.s, seen.position_mm, turned]),
        columns=[*joints, "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"],
    )
    names = np.array(seen.target_names, dtype=object)[seen.target]
    table = table.assign(pose=seen.pose, repeat=seen.repeat, target=names, subset="train")
    return {name: column.to_numpy() for name, column in table.items()}


def fit(observations, nominal, free, **settings):
    """A DH fit of full weight of rotations, truncated at 1e-3 unless ``settings`` say otherwise."""
    settings = {"rotation_weight_mm_per_rad": 500.0, "threshold": 1e-3} | settings
    return fitting.fit(observations, nominal, free=free, **settings)


def predicted(fit, q_rad):
    """Poses (n, ...) of the first target by a fit."""
    return compose(fit.frames.base, compose(dh.forward(fit.model, q_rad), fit.frames.tool))

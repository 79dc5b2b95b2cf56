"""Models and poses as the plain arrays ``kernels`` works on."""

from __future__ import annotations

import numpy as np

from kinacc.geometry import Pose
from kinacc.kinematics import dh as _dh
from kinacc.kinematics.dh import DHModel


def rows_of(model: DHModel) -> np.ndarray:
    """A row (k, 8) a joint: theta, d, a, cos and sin of alpha and of beta, 1 where it slides."""
    turns = [
        part(angle) for angle in (model.alpha_rad, model.beta_rad) for part in (np.cos, np.sin)
    ]
    first = model.theta_offset_rad, model.d_mm, model.a_mm
    return np.stack([*first, *turns, model.prismatic], axis=1, dtype=float)


def targets_of(pose: Pose) -> np.ndarray:
    """Poses (n, ...) as (n, 3, 4): rotation and position (mm)."""
    return np.concatenate([pose.rotation, pose.position_mm[..., None]], axis=2)


def part_of(model: DHModel, joints: slice) -> DHModel:
    """The model of some of the joints only."""
    return DHModel(*(getattr(model, name)[joints] for name in (*_dh.PARAMETERS, "prismatic")))


def behind_first(model: DHModel, value: float) -> Pose:
    """The frame behind the first joint where that stands at ``value``."""
    frame = _dh.forward(part_of(model, slice(0, 1)), np.array([[value]]))
    return Pose(frame.rotation[0], frame.position_mm[0])

"""A serial arm whose joints give way to gravity, by the derivative of its potential energy.

Gravity turns joint j by -dU/dq_j, U the potential energy of everything that hangs on the arm. The
derivative is a complex step: exact to rounding, and no axis, lever or cross product is ever formed.
A DH table is a sequence of rows (theta_offset_rad, d_mm, a_mm, alpha_rad, beta_rad); gravity is a
direction in the first DH frame, centres of gravity stand in the DH frame that carries them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .kinematics import dh_forward, dh_frames

STANDARD_GRAVITY = 9.80665  # m/s^2
_STEP = 1e-30


@dataclass(frozen=True)
class Body:
    """A mass with its centre of gravity in the frame that carries it."""

    mass_kg: float
    centre_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)


NOTHING = Body(0.0)


@dataclass(frozen=True)
class Arm:
    """DH rows, what each link weighs (none where nobody knows), and how much joints give way.

    ``compliance`` (rad per N m) answers the moment of all that hangs beyond the joint and is known
    to weigh something; ``lever`` (rad per mm) the horizontal distance of the last DH frame alone.
    Both by joint, from 1.
    """

    table: tuple[tuple[float, ...], ...]
    links: tuple[Body, ...] = ()
    compliance: Mapping[int, float] = field(default_factory=dict)
    lever: Mapping[int, float] = field(default_factory=dict)
    gravity: tuple[float, float, float] = (0.0, 0.0, -1.0)


def height_mm(arm: Arm, frame: np.ndarray, centre_mm: Sequence[float]) -> complex:
    """How far a point of a frame lies against gravity."""
    size = math.hypot(*arm.gravity)
    point = frame @ np.array([*centre_mm, 1.0])
    return -sum(g / size * x for g, x in zip(arm.gravity, point[:3], strict=True))


def energy_j(arm: Arm, q: Sequence[complex], payload: Body) -> complex:
    """Potential energy in joule of links and payload."""
    _, *at = dh_frames(arm.table, q)
    bodies = [*zip(at, arm.links, strict=False), (at[-1], payload)]
    return sum(
        body.mass_kg * STANDARD_GRAVITY * 1e-3 * height_mm(arm, frame, body.centre_mm)
        for frame, body in bodies
    )


def _stepped(q: Sequence[float], joint: int) -> np.ndarray:
    return q + 1j * _STEP * np.eye(len(q))[joint - 1]


def moment_nm(arm: Arm, q: Sequence[float], joint: int, payload: Body = NOTHING) -> float:
    """Moment in N m by which gravity turns a joint, positive as its angle counts."""
    return -complex(energy_j(arm, _stepped(q, joint), payload)).imag / _STEP


def lever_mm(arm: Arm, q: Sequence[float], joint: int) -> float:
    """How fast the last DH frame sinks with a joint, in mm per rad."""
    last = dh_forward(arm.table, _stepped(q, joint))
    return -complex(height_mm(arm, last, (0.0, 0.0, 0.0))).imag / _STEP


def deflections(arm: Arm, q: Sequence[float], payload: Body = NOTHING) -> np.ndarray:
    """By what angle (rad) each joint gives way, moments taken at the joints ``q`` themselves."""
    given = np.zeros(len(arm.table))
    for joint, per_nm in arm.compliance.items():
        given[joint - 1] += per_nm * moment_nm(arm, q, joint, payload)
    for joint, per_mm in arm.lever.items():
        given[joint - 1] += per_mm * lever_mm(arm, q, joint)
    return given


def flange(arm: Arm, q: Sequence[float], payload: Body = NOTHING) -> np.ndarray:
    """Pose (4, 4) of the last DH frame of the bent arm, to first order."""
    return dh_forward(arm.table, np.asarray(q) + deflections(arm, q, payload))


def disturbed(arm: Arm, rng: np.random.Generator, hayati_joints: Sequence[int] = ()) -> Arm:
    """The arm as it was built: theta, d, a and alpha a little off, beta for d at joints named."""
    size = np.tile([5e-4, 0.3, 0.3, 5e-4, 0.0], (len(arm.table), 1))
    for joint in hayati_joints:
        size[joint - 1] = [5e-4, 0.0, 0.3, 5e-4, 5e-4]
    table = np.array(arm.table) + size * rng.normal(size=size.shape)
    return replace(arm, table=tuple(tuple(row) for row in table.tolist()))

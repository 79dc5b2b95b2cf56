"""DH chain of an arm whose axes are known as lines in space.

Crossing and skew axes are joined by their common normal, which is unique. For (nearly) parallel
axes it is not, or lies kilometres away: there the next frame sits where the next axis crosses the
plane of the last one (d = 0) and a Hayati angle beta takes up what alpha cannot, so every parameter
stays of the arm's own size and no digits are lost.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinacc.geometry import Pose, compose, invert, rotation_x, rotation_y, rotation_z
from kinacc.kinematics.dh import PARAMETERS, DHModel

NEARLY_PARALLEL = 0.02  # sine of the angle between two axes below which a Hayati angle is used
_ON_AXIS_MM = 1e-10
_TIE = 1e-9
_ROUND_OFF_RAD = 1e-15


class Axes(NamedTuple):
    """Axes of k joints at zero joints, in the base frame.

    Attributes
    ----------
    point_mm : numpy.ndarray
        A point of each axis, shape (k, 3).
    direction : numpy.ndarray
        Unit directions, shape (k, 3).
    """

    point_mm: np.ndarray
    direction: np.ndarray


def chain_of(
    axes: Axes, flange: Pose, prismatic: np.ndarray, nearly_parallel: float = NEARLY_PARALLEL
) -> tuple[Pose, DHModel, Pose]:
    """DH chain of an arm with known axes: ``base chain(q) flange`` is its forward kinematics.

    Axes are joined by their common normal, or with a Hayati angle where they are nearly parallel
    (Hayati and Mirmirani 1985).

    Parameters
    ----------
    axes : Axes
        Axes of k joints.
    flange : Pose
        Flange at zero joints in the base frame, mm.
    prismatic : numpy.ndarray
        Joints that slide, shape (k,).
    nearly_parallel : float
        Sine of the angle between two axes below which a Hayati angle is used.

    Returns
    -------
    base : Pose
        First DH frame in the base frame, mm; identity where axis 1 is the base z axis.
    chain : DHModel
        The arm.
    flange : Pose
        Flange in the last DH frame, mm; identity where the last row can reach it by itself.
    """
    frame = base = _first_frame(axes.point_mm[0], axes.direction[0])
    rows = []
    for joint in range(1, len(axes.direction)):
        axis = _first_frame(axes.point_mm[joint], axes.direction[joint])
        rows.append(_row(frame, axis, nearly_parallel))
        frame = compose(frame, _across(rows[-1]))
    rows.append(_row(frame, flange, NEARLY_PARALLEL, last=True))
    frame = compose(frame, _across(rows[-1]))
    rest = compose(invert(frame), flange)
    columns = np.array(rows).T + 0.0  # no negative zeros
    return (
        base,
        DHModel(**dict(zip(PARAMETERS, columns, strict=True)), prismatic=prismatic),
        _without_round_off(rest),
    )


def _first_frame(point: np.ndarray, direction: np.ndarray) -> Pose:
    """Frame with z along axis 1, as close to the base frame as that allows."""
    if np.abs(direction - [0.0, 0.0, 1.0]).max() < 1e-15:
        rotation = np.eye(3)
    else:
        aside = np.eye(3)[0 if abs(direction[0]) < 0.9 else 1]
        y = np.cross(direction, aside)
        y /= np.linalg.norm(y)
        rotation = np.stack([np.cross(y, direction), y, direction], axis=1)
    return Pose(rotation, point - (point @ direction) * direction)


def _row(
    frame: Pose, target: Pose, nearly_parallel: float, last: bool = False
) -> tuple[float, ...]:
    """theta, d, a, alpha, beta from a frame on an axis to the axis z of ``target``.

    The last row ends at the origin of ``target``, as far as it can, and at its x axis where this
    lies on the axis before.
    """
    w, facing = (frame.rotation.T @ target.rotation[:, 2 - 2 * i] for i in range(2))
    p = frame.rotation.T @ (target.position_mm - frame.position_mm)
    sine, d = np.hypot(w[0], w[1]), 0.0
    parallel = sine < nearly_parallel
    end = p if last or not parallel else p - p[2] / w[2] * w
    length = np.hypot(end[0], end[1])
    on_axis = parallel and length < _ON_AXIS_MM
    if on_axis:
        x, y = (facing if last else np.eye(3)[0])[:2]
    else:
        # Direction of the common normal. Of the two senses the one that keeps theta within a
        # quarter turn, so that an arm drawn in its zero pose has the table people draw up for it.
        x, y = end[:2] / length if parallel else np.array([-w[1], w[0]]) / sine
        if x < -_TIE or (abs(x) <= _TIE and y < 0.0):
            x, y = -x, -y
    theta = np.arctan2(y, x)
    u = rotation_z(theta).T @ w
    alpha, beta = np.arctan2(-u[1], u[2]), np.arctan2(u[0], np.hypot(u[1], u[2]))
    if not parallel:
        d = p[2] - (p[1] * x - p[0] * y) / -np.sin(alpha) * w[2]
    elif last:
        d = p[2]
    a = 0.0 if on_axis else end[0] * x + end[1] * y
    return theta, d, a, alpha, beta if abs(beta) > _ROUND_OFF_RAD else 0.0


def _across(row: tuple[float, ...]) -> Pose:
    theta, d, a, alpha, beta = row
    turn = rotation_z(theta)
    return Pose(
        turn @ rotation_x(alpha) @ rotation_y(beta), turn @ np.array([a, 0.0, 0.0]) + [0, 0, d]
    )


def _without_round_off(pose: Pose) -> Pose:
    """Identity where nothing but rounding is left."""
    turned = np.abs(pose.rotation - np.eye(3)).max() > 1e-14
    moved = np.abs(pose.position_mm).max() > 1e-11
    return Pose(pose.rotation if turned else np.eye(3), pose.position_mm if moved else np.zeros(3))

"""Poses of DH and VEC models (eqs. 3 to 6) in 50 digits, with mpmath; mm and rad.

A float is taken for exactly what its bits say. Everything runs within ``mpmath.workdps(DIGITS)``.
"""

from __future__ import annotations

import mpmath as mp

DIGITS = 50


def turn(axis: int, angle) -> mp.matrix:
    """Rotation (4, 4) about an axis."""
    found, second, third = mp.eye(4), (axis + 1) % 3, (axis + 2) % 3
    found[second, second] = found[third, third] = mp.cos(angle)
    found[third, second], found[second, third] = mp.sin(angle), -mp.sin(angle)
    return found


def link(row, q) -> mp.matrix:
    """Eq. 4: Rz(q + theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)."""
    theta, d, a, alpha, beta = row
    along = mp.eye(4)
    along[0, 3], along[2, 3] = a, d
    return turn(2, q + theta) * along * turn(0, alpha) * turn(1, beta)


def error(dx, dy, dz, ex, ey, ez) -> mp.matrix:
    """Eq. 6 as printed."""
    return mp.matrix([[1, -ez, ey, dx], [ez, 1, -ex, dy], [-ey, ex, 1, dz], [0, 0, 0, 1]])


def dh_pose(table, q) -> mp.matrix:
    """Eq. 3 at joints (k,)."""
    found = mp.eye(4)
    for row, angle in zip(table, q, strict=True):
        found *= link(row, angle)
    return found


def vec_pose(table, series, offsets, low, high, q, s) -> mp.matrix:
    """Eq. 5 at joints (k,) and travel directions (k,), the rotation by its polar factor.

    ``series`` (k, 6, order + 1), ``offsets`` (k, 2) of eps_z for travel -1 and +1.
    """
    found = mp.eye(4)
    for i, row in enumerate(table):
        u = (2 * mp.mpf(q[i]) - low[i] - high[i]) / (mp.mpf(high[i]) - low[i])
        errors = [
            mp.fsum(c * mp.chebyt(order, u) for order, c in enumerate(line)) for line in series[i]
        ]
        if s[i]:
            errors[5] += offsets[i][0 if s[i] < 0 else 1]
        found *= error(*errors) * link(row, q[i])
    rotation = found[:3, :3]
    for _ in range(9):  # Newton's iteration doubles the digits
        rotation = (rotation + (rotation**-1).T) / 2
    found[:3, :3] = rotation
    return found


def moved(after: mp.matrix, before: mp.matrix) -> list:
    """Shift in mm and rotation vector in rad of one pose to another, by a small angle."""
    turned = after[:3, :3] * before[:3, :3].T
    axis = [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
    sine = mp.norm(mp.matrix(axis)) / 2
    factor = mp.asin(sine) / sine / 2 if sine else mp.mpf(1) / 2
    return [*(after[:3, 3] - before[:3, 3]), *(factor * x for x in axis)]

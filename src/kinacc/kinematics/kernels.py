"""Compiled kinematics of many poses: forward, Jacobians in the joints and in the parameters.

Each has a plain twin in :mod:`kinacc.kinematics.dh`, whose additions and products it repeats in
their order; nothing is fused or reordered, so both give the same bits, at any number of threads.
All compiled code is in this one file: numba's cache is aware of changes in the file of the function
called, not in files that function's helpers come from.

Poses are taken in blocks that stay in the fastest cache, one row of a work array for each number of
a frame, so that the compiler works on several poses at once. A chain is ``DHModel.rows``.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from kinacc.compiled import compiled_without_checks as compiled
from kinacc.kinematics.chain import COSINE, HALF_PI, LARGEST_RAD, SINE
from kinacc.kinematics.inverse.quick import LEVER_MM, LONGEST_RAD, ROUND_OFF, STEPS, TOLERANCE_MM

_BLOCK = 32
_QUADRANTS = 2.0 / np.pi
_P0, _P1, _P2 = HALF_PI
_S0, _S1, _S2, _S3, _S4, _S5 = SINE
_C0, _C1, _C2, _C3, _C4, _C5 = COSINE
# Rows of the work array: axes x, y, z, origin, then sine, cosine and angle of the joint.
_X, _Y, _Z, _P, _SIN, _COS, _ANGLE, _ROWS = 0, 3, 6, 9, 12, 13, 14, 15


@njit(inline="always")
def _sincos(x):
    """Sine and cosine as ``chain.sincos`` has them."""
    quadrant = np.rint(x * _QUADRANTS)
    near = x - quadrant * _P0
    less = quadrant * _P1
    y = near - less
    less = quadrant * _P2 - ((near - y) - less)
    near = y
    y = near - less
    tail = (near - y) - less
    z = y * y
    odd = ((((z * _S0 + _S1) * z + _S2) * z + _S3) * z) + _S4
    even = (((((z * _C0 + _C1) * z + _C2) * z + _C3) * z + _C4) * z + _C5) * z
    cube = z * y
    s = y - ((z * (0.5 * tail - cube * odd) - tail) - cube * _S5)
    half = 0.5 * z
    rest = 1.0 - half
    c = rest + (((1.0 - rest) - half) + (z * even - y * tail))
    quadrant -= 4.0 * np.floor(0.25 * quadrant)
    swapped = (quadrant == 1.0) or (quadrant == 3.0)
    sine = c if swapped else s
    cosine = s if swapped else c
    if quadrant >= 2.0:
        sine = -sine
    if (quadrant == 1.0) or (quadrant == 2.0):
        cosine = -cosine
    return sine, cosine


@njit(inline="always")
def _begin(w):
    """Put every frame at the robot base."""
    w[:_SIN] = 0.0
    w[_X] = 1.0
    w[_Y + 1] = 1.0
    w[_Z + 2] = 1.0


@njit(inline="always")
def _turns(row, q, begin, count, joint, w):
    """Sine and cosine of a joint's angles; how many lie too far out."""
    theta, slides = row[0], row[7] > 0.0
    for i in range(count):
        w[_ANGLE, i] = theta if slides else q[begin + i, joint] + theta
    for i in range(count):
        w[_SIN, i], w[_COS, i] = _sincos(w[_ANGLE, i])
    far = 0
    for i in range(count):
        far += not (abs(w[_ANGLE, i]) <= LARGEST_RAD)
    return far


@njit(inline="always")
def _turn_and_shift(row, q, begin, count, joint, w):
    """Move frames about and along the joint's axis, then along the new x axis."""
    d, a = row[1], row[2]
    if row[7] > 0.0:
        for i in range(count):
            along = q[begin + i, joint] + d
            w[_P, i] += along * w[_Z, i]
            w[_P + 1, i] += along * w[_Z + 1, i]
            w[_P + 2, i] += along * w[_Z + 2, i]
    else:
        for r in range(3):
            for i in range(count):
                w[_P + r, i] += d * w[_Z + r, i]
    for r in range(3):
        for i in range(count):
            s, c = w[_SIN, i], w[_COS, i]
            x, y = w[_X + r, i], w[_Y + r, i]
            w[_Y + r, i] = c * y - s * x
            x = c * x + s * y
            w[_X + r, i] = x
            w[_P + r, i] += a * x


@njit(inline="always")
def _twist(row, count, w):
    """Turn frames about their x axis, then about y."""
    ca, sa, cb, sb = row[3], row[4], row[5], row[6]
    for r in range(3):
        for i in range(count):
            y, z = w[_Y + r, i], w[_Z + r, i]
            w[_Y + r, i] = ca * y + sa * z
            w[_Z + r, i] = ca * z - sa * y
    if sb != 0.0:
        for r in range(3):
            for i in range(count):
                x, z = w[_X + r, i], w[_Z + r, i]
                w[_X + r, i] = cb * x - sb * z
                w[_Z + r, i] = cb * z + sb * x


@njit(inline="always")
def _write(w, begin, count, rotation, position):
    for i in range(count):
        for r in range(3):
            rotation[begin + i, r, 0] = w[_X + r, i]
            rotation[begin + i, r, 1] = w[_Y + r, i]
            rotation[begin + i, r, 2] = w[_Z + r, i]
            position[begin + i, r] = w[_P + r, i]


@njit(inline="always")
def _lever(from_axis, from_origin, count, kept, w):
    """Turn a kept origin (3 rows) into the cross product of a kept axis and what is beyond it."""
    for i in range(count):
        x = w[_P, i] - kept[from_origin, i]
        y = w[_P + 1, i] - kept[from_origin + 1, i]
        z = w[_P + 2, i] - kept[from_origin + 2, i]
        u, v, t = kept[from_axis, i], kept[from_axis + 1, i], kept[from_axis + 2, i]
        kept[from_origin, i] = v * z - t * y
        kept[from_origin + 1, i] = t * x - u * z
        kept[from_origin + 2, i] = u * y - v * x


@njit(inline="always")
def _spread(kept, source, begin, count, out):
    """Write rows ``source`` (m,) of ``kept`` as columns of ``out`` (n, m), pose by pose."""
    flat = kept.reshape(-1)
    for i in range(count):
        row = out[begin + i]
        for column in range(source.shape[0]):
            row[column] = flat[source[column] + i]


@compiled
def forward(rows, q, rotation, position):
    """Fill ``rotation`` (n, 3, 3) and ``position`` (n, 3); how many angles lie too far out."""
    far = 0
    w = np.empty((_ROWS, _BLOCK))
    for begin in range(0, q.shape[0], _BLOCK):
        count = min(_BLOCK, q.shape[0] - begin)
        _begin(w)
        for joint in range(rows.shape[0]):
            row = rows[joint]
            far += _turns(row, q, begin, count, joint, w)
            _turn_and_shift(row, q, begin, count, joint, w)
            _twist(row, count, w)
        _write(w, begin, count, rotation, position)
    return far


@compiled
def joint_jacobian(rows, q, rotation, position, jacobian):
    """``forward``, and fill ``jacobian`` (n, 6, k)."""
    far, joints = 0, rows.shape[0]
    w, kept = np.empty((_ROWS, _BLOCK)), np.empty((6 * joints, _BLOCK))
    source, flat = np.empty(6 * joints, np.int64), jacobian.reshape(q.shape[0], 6 * joints)
    for joint in range(joints):
        for r in range(3):
            source[r * joints + joint] = (6 * joint + 3 + r) * _BLOCK
            source[(3 + r) * joints + joint] = (6 * joint + r) * _BLOCK
    for begin in range(0, q.shape[0], _BLOCK):
        count = min(_BLOCK, q.shape[0] - begin)
        _begin(w)
        for joint in range(joints):
            row = rows[joint]
            kept[6 * joint : 6 * joint + 3] = w[_Z : _Z + 3]
            kept[6 * joint + 3 : 6 * joint + 6] = w[_P : _P + 3]
            far += _turns(row, q, begin, count, joint, w)
            _turn_and_shift(row, q, begin, count, joint, w)
            _twist(row, count, w)
        for joint in range(joints):
            if rows[joint, 7] > 0.0:
                kept[6 * joint + 3 : 6 * joint + 6] = kept[6 * joint : 6 * joint + 3]
                kept[6 * joint : 6 * joint + 3] = 0.0
            else:
                _lever(6 * joint, 6 * joint + 3, count, kept, w)
        _spread(kept, source, begin, count, flat)
        _write(w, begin, count, rotation, position)
    return far


@compiled
def parameter_jacobian(rows, q, rotation, position, jacobian):
    """``forward``, and fill ``jacobian`` (n, 6, k, 5)."""
    far, joints = 0, rows.shape[0]
    # For each joint axis and origin (3 each) of its turns theta, alpha and beta.
    w, kept = np.empty((_ROWS, _BLOCK)), np.zeros((18 * joints + 1, _BLOCK))
    source, flat = np.empty(30 * joints, np.int64), jacobian.reshape(q.shape[0], 30 * joints)
    for joint in range(joints):
        for r in range(3):
            at, to = 18 * joint + r, (r * joints + joint) * 5
            source[to] = at + 3
            source[to + 1] = at
            source[to + 2] = at + 6
            source[to + 3] = at + 9
            source[to + 4] = at + 15
            to += 15 * joints
            source[to] = at
            source[to + 1] = source[to + 2] = 18 * joints
            source[to + 3] = at + 6
            source[to + 4] = at + 12
    source *= _BLOCK
    for begin in range(0, q.shape[0], _BLOCK):
        count = min(_BLOCK, q.shape[0] - begin)
        _begin(w)
        for joint in range(joints):
            row, at = rows[joint], 18 * joint
            kept[at : at + 3] = w[_Z : _Z + 3]
            kept[at + 3 : at + 6] = w[_P : _P + 3]
            far += _turns(row, q, begin, count, joint, w)
            _turn_and_shift(row, q, begin, count, joint, w)
            kept[at + 6 : at + 9] = w[_X : _X + 3]
            kept[at + 9 : at + 12] = w[_P : _P + 3]
            kept[at + 15 : at + 18] = w[_P : _P + 3]
            _twist(row, count, w)
            kept[at + 12 : at + 15] = w[_Y : _Y + 3]
        for joint in range(joints):
            for turn in range(3):
                at = 18 * joint + 6 * turn
                _lever(at, at + 3, count, kept, w)
        _spread(kept, source, begin, count, flat)
        _write(w, begin, count, rotation, position)
    return far


@njit(inline="always")
def _slopes_of(kept, count, slopes):
    """Slopes of six turning joints, six rows each: position, then rotation times the lever."""
    for joint in range(6):
        for r in range(3):
            for i in range(count):
                slopes[6 * joint + r, i] = kept[6 * joint + 3 + r, i]
                slopes[6 * joint + 3 + r, i] = LEVER_MM * kept[6 * joint + r, i]


@njit(inline="always")
def _error(goal, count, w, error, met):
    """Rows of position (mm) and turn times the lever; marks what is within tolerance."""
    for r in range(3):
        u, v = (r + 1) % 3, (r + 2) % 3
        for i in range(count):
            error[r, i] = goal[_P + r, i] - w[_P + r, i]
            turn = w[u, i] * goal[v, i] - w[v, i] * goal[u, i]
            turn += w[3 + u, i] * goal[3 + v, i] - w[3 + v, i] * goal[3 + u, i]
            turn += w[6 + u, i] * goal[6 + v, i] - w[6 + v, i] * goal[6 + u, i]
            error[3 + r, i] = (0.5 * LEVER_MM) * turn
    for i in range(count):
        along = w[0, i] * goal[0, i] + w[1, i] * goal[1, i] + w[2, i] * goal[2, i]
        along += w[3, i] * goal[3, i] + w[4, i] * goal[4, i] + w[5, i] * goal[5, i]
        shift = (error[0, i] * error[0, i] + error[1, i] * error[1, i]) + error[2, i] * error[2, i]
        turn = (error[3, i] * error[3, i] + error[4, i] * error[4, i]) + error[5, i] * error[5, i]
        met[i] = shift < TOLERANCE_MM**2 and turn < TOLERANCE_MM**2 and along > 1.0


@njit(inline="always")
def _solve(slopes, error, count, normal, step):
    """Least squares for the step of six joints, through the normal equations (Cholesky)."""
    for a in range(6):
        p = 6 * a
        for b in range(a + 1):
            q = 6 * b
            for i in range(count):
                normal[p + b, i] = (
                    slopes[p, i] * slopes[q, i]
                    + slopes[p + 1, i] * slopes[q + 1, i]
                    + slopes[p + 2, i] * slopes[q + 2, i]
                    + slopes[p + 3, i] * slopes[q + 3, i]
                    + slopes[p + 4, i] * slopes[q + 4, i]
                    + slopes[p + 5, i] * slopes[q + 5, i]
                )
        for i in range(count):
            normal[7 * a, i] *= 1.0 + ROUND_OFF
            step[a, i] = (
                slopes[p, i] * error[0, i]
                + slopes[p + 1, i] * error[1, i]
                + slopes[p + 2, i] * error[2, i]
                + slopes[p + 3, i] * error[3, i]
                + slopes[p + 4, i] * error[4, i]
                + slopes[p + 5, i] * error[5, i]
            )
    for a in range(6):
        for b in range(a + 1):
            for c in range(b):
                for i in range(count):
                    normal[6 * a + b, i] -= normal[6 * a + c, i] * normal[6 * b + c, i]
            if a == b:
                for i in range(count):
                    normal[7 * a, i] = np.sqrt(normal[7 * a, i])
            else:
                for i in range(count):
                    normal[6 * a + b, i] /= normal[7 * b, i]
        for c in range(a):
            for i in range(count):
                step[a, i] -= normal[6 * a + c, i] * step[c, i]
        for i in range(count):
            step[a, i] /= normal[7 * a, i]
    for a in range(5, -1, -1):
        for c in range(a + 1, 6):
            for i in range(count):
                step[a, i] -= normal[6 * c + a, i] * step[c, i]
        for i in range(count):
            step[a, i] /= normal[7 * a, i]


@compiled
def onto_poses(rows, rotation, position, q, met):
    """Move joints ``q`` (n, 6) in place onto poses; see ``quick.onto_poses``, its plain twin."""
    w, kept = np.empty((_ROWS, _BLOCK)), np.empty((36, _BLOCK))
    goal, slopes, error = np.empty((12, _BLOCK)), np.empty((36, _BLOCK)), np.empty((6, _BLOCK))
    normal, step, done = np.empty((36, _BLOCK)), np.empty((6, _BLOCK)), np.empty(_BLOCK, np.bool_)
    for begin in range(0, q.shape[0], _BLOCK):
        count = min(_BLOCK, q.shape[0] - begin)
        for i in range(count):
            for r in range(3):
                goal[r, i] = rotation[begin + i, r, 0]
                goal[3 + r, i] = rotation[begin + i, r, 1]
                goal[6 + r, i] = rotation[begin + i, r, 2]
                goal[9 + r, i] = position[begin + i, r]
        for number in range(STEPS + 1):
            _begin(w)
            far = 0
            for joint in range(6):
                row = rows[joint]
                kept[6 * joint : 6 * joint + 3] = w[_Z : _Z + 3]
                kept[6 * joint + 3 : 6 * joint + 6] = w[_P : _P + 3]
                far += _turns(row, q, begin, count, joint, w)
                _turn_and_shift(row, q, begin, count, joint, w)
                _twist(row, count, w)
            _error(goal, count, w, error, done)
            left = 0
            for i in range(count):
                left += not done[i]
            if left == 0 or number == STEPS:
                break
            for joint in range(6):
                _lever(6 * joint, 6 * joint + 3, count, kept, w)
            _slopes_of(kept, count, slopes)
            _solve(slopes, error, count, normal, step)
            for i in range(count):
                if not done[i]:
                    for joint in range(6):
                        moved = q[begin + i, joint] + step[joint, i]
                        ok = abs(step[joint, i]) <= LONGEST_RAD and abs(moved) <= LARGEST_RAD
                        q[begin + i, joint] = moved if ok else np.nan
        for i in range(count):
            met[begin + i] = done[i]

"""Compiled search for all postures of a pose: which table entries to start from, and Newton.

All compiled code of the inverse is in this one file: numba's cache is aware of changes in the file
of the function called, not in files that function's helpers come from. Every function here also
runs as plain Python (``.py_func``), which a test holds the compiled one to.

A chain is an array (k, 8) of rows: theta offset (rad), d, a (mm), cosine and sine of alpha, cosine
and sine of beta, 1 where the joint slides. A pose is (3, 4): rotation and position (mm).
"""

from __future__ import annotations

import math

import numpy as np

from kinacc.compiled import compiled

SLIDES = 7
_LEVER_MM = 1000.0  # turns rotation errors into lengths
_LONGEST_TURN = 0.6
_TWO_PI = 2.0 * math.pi


@compiled
def end_of(rows, q, axes, origins, pose):
    """Frame behind the last row, and axis and origin of every joint, in the frame before the first.

    Fills ``axes`` (k, 3), ``origins`` (k, 3) and ``pose`` (3, 4).
    """
    pose[:] = 0.0
    pose[0, 0] = pose[1, 1] = pose[2, 2] = 1.0
    for joint in range(rows.shape[0]):
        row = rows[joint]
        for i in range(3):
            axes[joint, i] = pose[i, 2]
            origins[joint, i] = pose[i, 3]
        if row[SLIDES] > 0.0:
            theta, d = row[0], row[1] + q[joint]
        else:
            theta, d = row[0] + q[joint], row[1]
        c, s = math.cos(theta), math.sin(theta)
        ca, sa, cb, sb = row[3], row[4], row[5], row[6]
        for i in range(3):
            x, y, z = pose[i, 0], pose[i, 1], pose[i, 2]
            x, y = c * x + s * y, c * y - s * x
            pose[i, 3] += d * z + row[2] * x
            y, z = ca * y + sa * z, ca * z - sa * y
            pose[i, 0] = cb * x - sb * z
            pose[i, 1] = y
            pose[i, 2] = cb * z + sb * x


@compiled
def _error(target, pose, error):
    """Position (mm) and rotation vector times the lever (mm) from ``pose`` to ``target``; size."""
    total = 0.0
    for i in range(3):
        error[i] = target[i, 3] - pose[i, 3]
    trace = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        turn = 0.0
        for column in range(3):
            turn += pose[j, column] * target[k, column] - pose[k, column] * target[j, column]
            trace += pose[i, column] * target[i, column]
        error[3 + i] = 0.5 * turn
    sine = math.sqrt(error[3] ** 2 + error[4] ** 2 + error[5] ** 2)
    scale = _LEVER_MM
    if sine > 1e-8:
        scale *= math.atan2(sine, 0.5 * (trace - 1.0)) / sine
    for i in range(3):
        error[3 + i] *= scale
    for i in range(6):
        total += error[i] * error[i]
    return math.sqrt(total)


@compiled
def _solve(matrix, vector, count):
    """Solve a positive definite system in place (Cholesky); False where it is not definite."""
    for i in range(count):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            if i == j:
                if total <= 0.0:
                    return False
                matrix[i, i] = math.sqrt(total)
            else:
                matrix[i, j] = total / matrix[j, j]
    for i in range(count):
        for k in range(i):
            vector[i] -= matrix[i, k] * vector[k]
        vector[i] /= matrix[i, i]
    for i in range(count - 1, -1, -1):
        for k in range(i + 1, count):
            vector[i] -= matrix[k, i] * vector[k]
        vector[i] /= matrix[i, i]
    return True


@compiled
def _slopes_at(rows, axes, origins, pose, slopes):
    """Motion (k, 6) of the end per joint: position, then rotation times the lever."""
    for joint in range(rows.shape[0]):
        z0, z1, z2 = axes[joint, 0], axes[joint, 1], axes[joint, 2]
        if rows[joint, SLIDES] > 0.0:
            slopes[joint, 0], slopes[joint, 1], slopes[joint, 2] = z0, z1, z2
            slopes[joint, 3] = slopes[joint, 4] = slopes[joint, 5] = 0.0
        else:
            x = pose[0, 3] - origins[joint, 0]
            y = pose[1, 3] - origins[joint, 1]
            z = pose[2, 3] - origins[joint, 2]
            slopes[joint, 0] = z1 * z - z2 * y
            slopes[joint, 1] = z2 * x - z0 * z
            slopes[joint, 2] = z0 * y - z1 * x
            slopes[joint, 3] = _LEVER_MM * z0
            slopes[joint, 4] = _LEVER_MM * z1
            slopes[joint, 5] = _LEVER_MM * z2


@compiled
def newton(rows, target, q, most_steps, tolerance_mm, work):
    """Move joints ``q`` (k,) in place to the pose ``target``; the error left (mm, lever 1 m).

    Levenberg-Marquardt. ``work`` holds scratch arrays from ``scratch``.
    """
    axes, origins, pose, error, slopes, normal, step, trial = work
    count = rows.shape[0]
    end_of(rows, q, axes, origins, pose)
    size = _error(target, pose, error)
    damping = 1e-4
    for _ in range(most_steps):
        if size < tolerance_mm:
            break
        _slopes_at(rows, axes, origins, pose, slopes)
        better = False
        for _ in range(8):
            for i in range(count):
                step[i] = 0.0
                for r in range(6):
                    step[i] += slopes[i, r] * error[r]
                for j in range(i + 1):
                    total = 0.0
                    for r in range(6):
                        total += slopes[i, r] * slopes[j, r]
                    normal[i, j] = total
                normal[i, i] += damping * normal[i, i] + 1e-12
            if _solve(normal, step, count):
                longest = 0.0
                for i in range(count):
                    if rows[i, SLIDES] == 0.0:
                        longest = max(longest, abs(step[i]))
                shorten = min(1.0, _LONGEST_TURN / longest) if longest > 0.0 else 1.0
                for i in range(count):
                    trial[i] = q[i] + shorten * step[i]
                end_of(rows, trial, axes, origins, pose)
                new_size = _error(target, pose, error)
                if new_size < size:
                    better = new_size < 0.999 * size or new_size < tolerance_mm
                    size = new_size
                    q[:] = trial
                    damping = damping * 0.03 if damping > 1e-12 else 0.0
                    break
                end_of(rows, q, axes, origins, pose)
                _error(target, pose, error)
            damping = max(damping * 10.0, 1e-6)
        if not better:
            break
    return size


@compiled
def _weakest(slopes, by_joint, count):
    """Unit direction the slopes (k, 6) move least in: of the joints (k,) or of the end (6,)."""
    size = count if by_joint else 6
    normal, direction = np.empty((size, size)), np.empty(size)
    trace = 0.0
    for i in range(size):
        direction[i] = 1.0 + 0.1 * i
        for j in range(i + 1):
            total = 0.0
            for r in range(6 if by_joint else count):
                total += slopes[i, r] * slopes[j, r] if by_joint else slopes[r, i] * slopes[r, j]
            normal[i, j] = total
        trace += normal[i, i]
    for _ in range(3):
        matrix = normal.copy()
        for i in range(size):
            matrix[i, i] += 1e-11 * trace
        _solve(matrix, direction, size)
        length = 0.0
        for i in range(size):
            length += direction[i] ** 2
        for i in range(size):
            direction[i] /= math.sqrt(length)
    return direction


@compiled
def sibling(rows, target, q, other, work):
    """Start ``other`` (k,) for the posture that meets the posture ``q`` where the arm is singular.

    Along the weakest direction the error is nearly a parabola, whose second root is looked for.
    False where that lies too far away to say anything.
    """
    axes, origins, pose, error, slopes, _, _, _ = work
    count = rows.shape[0]
    end_of(rows, q, axes, origins, pose)
    _slopes_at(rows, axes, origins, pose, slopes)
    for joint in range(count):
        if rows[joint, SLIDES] > 0.0:  # a metre of travel counts as a radian
            for r in range(6):
                slopes[joint, r] *= _LEVER_MM
    weak, unseen = _weakest(slopes, True, count), _weakest(slopes, False, count)
    slope = 0.0
    for r in range(6):
        for joint in range(count):
            slope += unseen[r] * slopes[joint, r] * weak[joint]
    bend = 0.0
    for sign in (-1.0, 1.0):
        for joint in range(count):
            scale = _LEVER_MM if rows[joint, SLIDES] > 0.0 else 1.0
            other[joint] = q[joint] + sign * 0.05 * scale * weak[joint]
        end_of(rows, other, axes, origins, pose)
        _error(target, pose, error)
        for r in range(6):
            bend -= unseen[r] * error[r] / 0.05**2
    if abs(slope) > abs(bend):  # further than two radians; no parabola is as wide
        return False
    away = -2.0 * slope / bend if bend != 0.0 else 0.0
    for joint in range(count):
        scale = _LEVER_MM if rows[joint, SLIDES] > 0.0 else 1.0
        other[joint] = q[joint] + away * scale * weak[joint]
    return True


@compiled
def _apart(first, second, turning, unit):
    """Largest difference of joints in their units, whole turns aside."""
    largest = 0.0
    for i in range(first.shape[0]):
        gap = first[i] - second[i]
        if turning[i]:
            gap -= _TWO_PI * np.rint(gap / _TWO_PI)
        largest = max(largest, abs(gap) / unit[i])
    return largest


@compiled
def predicted(wanted, features, slopes, joints, near, unit, turning, most, farthest, out):
    """Middle joints to start from for one pose; how many.

    ``near`` lists table entries whose ``features`` (N, f) are close to those ``wanted`` (f,). Each
    entry's joints are moved by one damped step along its ``slopes`` (N, f, m; per ``unit``); those
    moved less than ``farthest`` units are taken, nearest first, unless they end up beside one that
    is taken already. Fills ``out`` (most, m).
    """
    m, f = joints.shape[1], features.shape[1]
    count = near.shape[0]
    moved = np.empty((count, m))
    score = np.empty(count)
    normal, step = np.empty((m, m)), np.empty(m)
    for number in range(count):
        entry = near[number]
        for i in range(m):
            step[i] = 0.0
            for r in range(f):
                step[i] += slopes[entry, r, i] * (wanted[r] - features[entry, r])
            for j in range(i + 1):
                total = 0.0
                for r in range(f):
                    total += slopes[entry, r, i] * slopes[entry, r, j]
                normal[i, j] = total
            normal[i, i] += 1e-4
        _solve(normal, step, m)
        longest = 0.0
        for i in range(m):
            longest = max(longest, abs(step[i]))
            moved[number, i] = joints[entry, i] + unit[i] * step[i]
        left = 0.0
        for r in range(f):
            gap = wanted[r] - features[entry, r]
            for i in range(m):
                gap -= slopes[entry, r, i] * step[i]
            left += gap * gap
        score[number] = longest + 2.0 * math.sqrt(left)
    taken = 0
    for number in np.argsort(score):
        if taken == most or score[number] > farthest:
            break
        alone = True
        for other in range(taken):
            if _apart(moved[number], out[other], turning, unit) < 0.6:
                alone = False
                break
        if alone:
            out[taken] = moved[number]
            taken += 1
    return taken


@compiled
def outer_joints(rows, target, q, work):
    """Fill the first and last joint of ``q`` (k,) so that its pose comes close to ``target``."""
    axes, origins, pose, _, _, _, _, _ = work
    last = rows.shape[0] - 1
    row = rows[last]
    # The frame at the last joint, before it moves: target with what follows the joint undone.
    want = np.empty((3, 4))
    ca, sa, cb, sb = row[3], row[4], row[5], row[6]
    for i in range(3):
        x, y, z = target[i, 0], target[i, 1], target[i, 2]
        x, z = cb * x + sb * z, cb * z - sb * x
        y, z = ca * y - sa * z, ca * z + sa * y
        want[i, 0], want[i, 1], want[i, 2] = x, y, z
        want[i, 3] = target[i, 3] - row[2] * x - row[1] * z
    slides_first, slides_last = rows[0, SLIDES] > 0.0, row[SLIDES] > 0.0
    q[0] = 0.0 if slides_first else -rows[0, 0]
    end_of(rows[:last], q, axes, origins, pose)
    if slides_last:  # its theta is part of what is fixed
        c, s = math.cos(row[0]), math.sin(row[0])
        for i in range(3):
            x, y = pose[i, 0], pose[i, 1]
            pose[i, 0], pose[i, 1] = c * x + s * y, c * y - s * x
    if slides_first:
        q[0] = want[2, 3] - pose[2, 3]
        pose[2, 3] = want[2, 3]
    else:
        cosine = sine = 0.0
        for column in range(4):
            if (column < 2 and not slides_last) or (column == 3 and slides_last):
                continue
            weight = _LEVER_MM * _LEVER_MM if column < 3 else 1.0
            cosine += weight * (
                pose[0, column] * want[0, column] + pose[1, column] * want[1, column]
            )
            sine += weight * (pose[0, column] * want[1, column] - pose[1, column] * want[0, column])
        angle = math.atan2(sine, cosine)
        q[0] = angle - rows[0, 0]
        c, s = math.cos(angle), math.sin(angle)
        for column in range(4):
            x, y = pose[0, column], pose[1, column]
            pose[0, column], pose[1, column] = c * x - s * y, s * x + c * y
    if slides_last:
        q[last] = 0.0
        for i in range(3):
            q[last] += pose[i, 2] * (want[i, 3] - pose[i, 3])
    else:
        cosine = sine = 0.0
        for i in range(3):
            cosine += pose[i, 0] * want[i, 0] + pose[i, 1] * want[i, 1]
            sine += pose[i, 1] * want[i, 0] - pose[i, 0] * want[i, 1]
        q[last] = math.atan2(sine, cosine) - row[0]


@compiled
def scratch(count):
    """Work arrays of ``newton`` for ``count`` joints."""
    return (
        np.empty((count, 3)),
        np.empty((count, 3)),
        np.empty((3, 4)),
        np.empty(6),
        np.empty((count, 6)),
        np.empty((count, count)),
        np.empty(count),
        np.empty(count),
    )


@compiled
def refine(rows, targets, q, most_steps, tolerance_mm):
    """``newton`` for each of ``targets`` (m, 3, 4) from joints ``q`` (m, k), which it moves."""
    work = scratch(rows.shape[0])
    for i in range(q.shape[0]):
        newton(rows, targets[i], q[i], most_steps, tolerance_mm, work)


@compiled
def _keep(q, error, number, found, left, turning, unit):
    """Add joints to the list unless they are in it; how many it then holds.

    A full list gives up the worst of its entries for a better one.
    """
    for joint in range(q.shape[0]):
        if turning[joint]:
            q[joint] -= _TWO_PI * np.rint(q[joint] / _TWO_PI)
    place = number
    for other in range(number):
        if _apart(q, found[other], turning, unit) < 1.0:
            return number
    if number == found.shape[0]:
        place = np.argmax(left)
        if left[place] <= max(error, 1e-6):
            return number
    found[place] = q
    left[place] = error
    return max(number, place + 1)


@compiled
def postures(
    rows,
    targets,
    wanted,
    features,
    slopes,
    joints,
    near,
    unit,
    most,
    farthest,
    miss_mm,
    found,
    left,
):
    """All postures of every pose; how many per pose (n,).

    ``targets`` (n, 3, 4), their features ``wanted`` (n, f) and the table entries ``near`` (n, K).
    Fills ``found`` (n, slots, k) and the error ``left`` (n, slots) in mm: below 1e-6 for postures,
    up to ``miss_mm`` for those that only come close, which an arm a little different may have.
    """
    n, _, count = found.shape
    m = joints.shape[1]
    work = scratch(count)
    turning = rows[:, SLIDES] == 0.0
    apart_unit = np.where(turning, 1e-4, 0.1)
    starts = np.empty((most, m))
    q = np.empty(count)
    number = np.zeros(n, dtype=np.int64)
    for i in range(n):
        taken = predicted(
            wanted[i],
            features,
            slopes,
            joints,
            near[i],
            unit,
            turning[1 : 1 + m],
            most,
            farthest,
            starts,
        )
        for start in range(taken):
            q[1 : 1 + m] = starts[start]
            outer_joints(rows, targets[i], q, work)
            error = newton(rows, targets[i], q, 30, 1e-9, work)
            if error <= miss_mm:
                number[i] = _keep(q, error, number[i], found[i], left[i], turning, apart_unit)
        place = 0
        while place < number[i]:
            if left[i, place] < 1e-6 and sibling(rows, targets[i], found[i, place], q, work):
                error = newton(rows, targets[i], q, 30, 1e-9, work)
                if error < 1e-6:
                    number[i] = _keep(q, error, number[i], found[i], left[i], turning, apart_unit)
            place += 1
    return number

"""Compiled model invalidation (eqs. 15-24): exact scans over bounds, and the readings they take.

All compiled code is in this one file: numba's cache is aware of changes in the file of the function
called, not in files that function's helpers come from. The first part draws the readings, on which
see :mod:`kinacc.assess.random_numbers`. The plain twin of a run at one bound is
:func:`kinacc.assess.model_invalidation.Invalidation.history`.

How a scan is exact without a run at every bound. For a fixed history the rejection probability
falls as the bound grows, and the point to measure again is the largest of functions linear in
the bound. So if both decisions agree at the two ends of an interval of bounds, every bound inside
takes the same path. Where they do not, the interval is cut in half; the other piece waits and later
resumes from the history it shares. Decisions
closer than rounding and the table of :func:`_about` could turn (``guard``, ``margin``) are left to
single bounds, which are decided without the table.
"""

from __future__ import annotations

import math

import numpy as np

from kinacc.compiled import compiled

# Columns of the state (m, 3) of a run: how many readings there are of a point, the magnitude of
# their mean (mm), and the weight of the point (1/mm).
READS, SIZE, WEIGHT = 0, 1, 2
_ROOT_2_OVER_PI = math.sqrt(2.0 / math.pi)
_SERIES_BELOW = 0.02
_NODES_PER_UNIT = 128
_ABOUT = 1e-10  # at most this far off is _about


def _nodes() -> np.ndarray:
    """Chi distribution of three degrees of freedom at 0, 1 / 128, .. 10, and its slope there.

    (n, 2): the value, and the slope times the distance of two nodes.
    """
    r = np.arange(10 * _NODES_PER_UNIT + 1) / _NODES_PER_UNIT
    slope = _ROOT_2_OVER_PI * r * r * np.exp(-0.5 * r * r)
    value = [math.erf(x * math.sqrt(0.5)) - _ROOT_2_OVER_PI * x * math.exp(-0.5 * x * x) for x in r]
    return np.stack([value, slope / _NODES_PER_UNIT], axis=1)


_TABLE = _nodes()
_M0 = np.uint64(0xD2E7470EE14C6C93)
_M1 = np.uint64(0xCA5A826395121157)
_W0 = np.uint64(0x9E3779B97F4A7C15)
_W1 = np.uint64(0xBB67AE8584CAA73B)
_LOW = np.uint64(0xFFFFFFFF)
_HALF = np.uint64(32)
_SHIFT = np.uint64(11)
_ZERO = np.uint64(0)
_ONE = np.uint64(1)


@compiled
def _high_product(a, b):
    """Upper 64 bits of the 128-bit product of two uint64."""
    a_low, a_high = a & _LOW, a >> _HALF
    b_low, b_high = b & _LOW, b >> _HALF
    middle = a_high * b_low + ((a_low * b_low) >> _HALF)
    other = a_low * b_high + (middle & _LOW)
    return a_high * b_high + (middle >> _HALF) + (other >> _HALF)


@compiled
def philox(key0, key1, counter0, counter1):
    """Four uint64 words of Philox 4x64-10 at counter (counter0, counter1, 0, 0)."""
    c0, c1, c2, c3 = counter0, counter1, _ZERO, _ZERO
    for step in range(10):
        if step > 0:
            key0 += _W0
            key1 += _W1
        high0, high1 = _high_product(_M0, c0), _high_product(_M1, c2)
        c0, c1, c2, c3 = high1 ^ c1 ^ key0, _M1 * c2, high0 ^ c3 ^ key1, _M0 * c0
    return c0, c1, c2, c3


@compiled
def normals(key0, key1, point, visit):
    """Three standard normal deviates of one reading, by Box and Muller."""
    x0, x1, x2, x3 = philox(key0, key1, np.uint64(visit), np.uint64(point))
    unit = 2.0**-53
    # In (0, 1], so that the logarithm is finite.
    r0 = math.sqrt(-2.0 * math.log(float((x0 >> _SHIFT) + _ONE) * unit))
    r1 = math.sqrt(-2.0 * math.log(float((x2 >> _SHIFT) + _ONE) * unit))
    angle0 = 2.0 * math.pi * (float(x1 >> _SHIFT) * unit)
    angle1 = 2.0 * math.pi * (float(x3 >> _SHIFT) * unit)
    return r0 * math.cos(angle0), r0 * math.sin(angle0), r1 * math.cos(angle1)


@compiled
def extend(world, i, wanted):
    """Compute the readings of row i of a world (its ``arrays``) up to number ``wanted``, from 0.

    With each goes the magnitude of the mean of the readings up to it.
    """
    readings, known, sigma, error, key, index, sums, sizes = world
    for v in range(known[i], wanted + 1):
        z = normals(key[0], key[1], index[i], v)
        square = 0.0
        for axis in range(3):
            reading = error[i, axis] + sigma[i] * z[axis]
            readings[i, v, axis] = reading
            sums[i, axis] += reading
            mean = sums[i, axis] / (v + 1.0)
            square += mean * mean
        sizes[i, v] = math.sqrt(square)
    known[i] = max(known[i], wanted + 1)


@compiled
def extend_all(world, wanted):
    """Compute the readings of every row up to number ``wanted``, from 0."""
    for i in range(world[0].shape[0]):
        extend(world, i, wanted)


@compiled
def chi2_3(x):
    """Chi-square distribution function, three degrees of freedom (eq. 18)."""
    if x <= 0.0:
        return 0.0
    if x < _SERIES_BELOW:
        # The closed form subtracts nearly equal numbers here.
        total, term = 1.0, 1.0
        for n in range(1, 7):
            term *= x / (2 * n + 3)
            total += term
        return _ROOT_2_OVER_PI * x * math.sqrt(x) * math.exp(-0.5 * x) * total / 3.0
    return math.erf(math.sqrt(0.5 * x)) - _ROOT_2_OVER_PI * math.sqrt(x) * math.exp(-0.5 * x)


@compiled
def _about(size, weight, eta, squared):
    """1 - p-hat of one point, from a table of cubics: a measurement comes out larger so often."""
    excess = size - eta
    if excess <= 0.0:
        return 1.0
    place = excess * weight
    place = (place if squared else math.sqrt(place)) * _NODES_PER_UNIT
    if place >= _TABLE.shape[0] - 1:
        return 0.0
    node = int(place)
    t = place - node
    rise = _TABLE[node + 1, 0] - _TABLE[node, 0]
    bend = _TABLE[node, 1] - rise
    other = rise - _TABLE[node + 1, 1]
    below = _TABLE[node, 0] + t * (rise + (1.0 - t) * (bend * (1.0 - t) + other * t))
    return max(1.0 - below, 0.0)


@compiled
def _survival(eta, state, active, squared, miss):
    """Product of about 1 - p-hat at a bound over the active rows, each kept in ``miss``."""
    survival = 1.0
    for i in active:
        miss[i] = _about(state[i, SIZE], state[i, WEIGHT], eta, squared)
        survival *= miss[i]
    return survival


@compiled
def _exact_survival(eta, state, active, squared):
    """Product of 1 - p-hat at a bound over the active rows, in the order of their visits."""
    survival = 1.0
    for i in active:
        distance = max(state[i, SIZE] - eta, 0.0) * state[i, WEIGHT]
        survival *= 1.0 - chi2_3(distance * distance if squared else distance)
    return survival


@compiled
def _side(survival, alpha, guard):
    """+1 above the threshold, -1 below it, 0 where rounding or the table could decide."""
    probability = 1.0 - survival
    if probability > alpha + guard:
        return 1
    return -1 if probability < alpha - guard else 0


@compiled
def _winner(eta, state, active):
    """Row with the largest score at a bound, the first of equals; its score and the next one."""
    row, best, second = -1, -np.inf, -np.inf
    for i in active:
        score = (state[i, SIZE] - eta) * state[i, WEIGHT]
        if score > best:
            row, best, second = i, score, best
        elif score > second:
            second = score
    return row, best, second


@compiled
def _resume(sizes, sigma, roots, state, path, lowest, rows):
    """Rebuild the state after the steps of a path; returns (points visited, active rows).

    A row is active if it can still exceed a bound of the interval that begins at ``lowest``: one
    whose mean lies within has p-hat 0 throughout and is never measured again.
    """
    state[:, READS] = 0.0
    visited = 0
    for i in path:
        state[i, READS] += 1.0
        visited = max(visited, i + 1)
    count = 0
    for i in range(visited):
        v = int(state[i, READS])
        state[i, SIZE], state[i, WEIGHT] = sizes[i, v - 1], roots[v] / sigma[i]
        if state[i, SIZE] > lowest:
            rows[count] = i
            count += 1
    return visited, count


@compiled
def _insist(
    i, bounds, rivals, world, roots, state, at_near, at_far, active, path, steps, setting, guards
):
    """Measure row i once, and on while it is sure for every bound that it must be measured again.

    Only row i changes meanwhile, so the other rows are multiplied once. Returns the steps taken and
    the products of about 1 - p-hat at both ends.
    """
    known, sigma, sizes = world[1], world[2], world[7]
    alpha, squared = setting
    guard, margin = guards
    near_eta, far_eta = bounds
    near_others = far_others = 1.0
    for row in active:
        if row != i:
            near_others *= at_near[row]
            far_others *= at_far[row]
    # Smallest scores seen to keep the probability above alpha: a larger one needs no p-hat.
    near_sure = far_sure = np.inf
    if _side(max(near_others, far_others), alpha, guard) == 1:
        near_sure = far_sure = -np.inf
    v = int(state[i, READS])
    while True:
        if v >= known[i]:
            extend(world, i, v)
        size = sizes[i, v]
        v += 1
        weight = roots[v] / sigma[i]
        path[steps] = i
        steps += 1
        near_score, far_score = (size - near_eta) * weight, (size - far_eta) * weight
        if steps == path.size or near_score <= rivals[0] + margin:
            break
        if far_score <= rivals[1] + margin:
            break
        if near_score < near_sure:
            if _side(near_others * _about(size, weight, near_eta, squared), alpha, guard) != 1:
                break
            near_sure = near_score
        if far_score < far_sure:
            if _side(far_others * _about(size, weight, far_eta, squared), alpha, guard) != 1:
                break
            far_sure = far_score
    state[i, READS], state[i, SIZE], state[i, WEIGHT] = v, size, weight
    at_near[i] = _about(size, weight, near_eta, squared)
    at_far[i] = _about(size, weight, far_eta, squared)
    return steps, near_others * at_near[i], far_others * at_far[i]


@compiled
def scan(world, bounds, wanted, alpha, squared, roots):
    """Decide the bounds (n,), mm, ascending or descending, in order until one is as ``wanted``.

    wanted: whether it is to be rejected. roots: weight of a point with noise 1 after 0, 1, .. up to
    all readings. Returns the place of that bound (n where none is), and of the last run followed
    whether it rejected, its measurements, points visited and rejection probability; and how many
    runs were followed to their end.
    """
    sigma, sizes = world[2], world[7]
    points, budget = sigma.size, roots.size - 1
    state, rows, path = (
        np.zeros((points, 3)),
        np.empty(points, np.int64),
        np.empty(budget, np.int64),
    )
    at_near, at_far = np.ones(points), np.ones(points)
    waiting = np.empty((bounds.size + 1, 3), np.int64)  # near end, far end, steps shared
    waiting[0, 0], waiting[0, 1], waiting[0, 2] = 0, bounds.size - 1, 0
    depth, runs = 1, 0
    margin = 1e-12 * max(bounds.max(), sizes[:, 0].max()) / sigma.min() * roots[budget]
    guards = 1e-9 + points * _ABOUT + margin, margin
    setting = alpha, squared
    while depth > 0:
        depth -= 1
        near, far, steps = waiting[depth, 0], waiting[depth, 1], waiting[depth, 2]
        lowest = min(bounds[near], bounds[far])
        visited, count = _resume(sizes, sigma, roots, state, path[:steps], lowest, rows)
        near_survival = _survival(bounds[near], state, rows[:count], squared, at_near)
        far_survival = _survival(bounds[far], state, rows[:count], squared, at_far)
        while True:
            active = rows[:count]
            side = _side(near_survival, alpha, guards[0])
            if near != far and (side == 0 or _side(far_survival, alpha, guards[0]) != side):
                last = near if side == 0 else (near + far) // 2
                waiting[depth, 0], waiting[depth, 1], waiting[depth, 2] = last + 1, far, steps
                depth, far = depth + 1, last
                far_survival = _survival(bounds[far], state, active, squared, at_far)
                continue
            if side == 0:
                near_survival = _exact_survival(bounds[near], state, active, squared)
            rejected = 1.0 - near_survival > alpha
            if steps == budget or (not rejected and visited == points):
                break
            if not rejected:
                i, visited = visited, visited + 1
                size, weight = sizes[i, 0], roots[1] / sigma[i]
                state[i, READS], state[i, SIZE], state[i, WEIGHT] = 1.0, size, weight
                path[steps], steps = i, steps + 1
                if size > min(bounds[near], bounds[far]):
                    rows[count], count = i, count + 1
                    at_near[i] = _about(size, weight, bounds[near], squared)
                    at_far[i] = _about(size, weight, bounds[far], squared)
                    near_survival *= at_near[i]
                    far_survival *= at_far[i]
                continue
            i, best, rival = _winner(bounds[near], state, active)
            other, far_best, far_rival = _winner(bounds[far], state, active)
            sure = best - rival > margin
            if near != far and not (sure and other == i and far_best - far_rival > margin):
                last = (near + far) // 2 if sure else near
                waiting[depth, 0], waiting[depth, 1], waiting[depth, 2] = last + 1, far, steps
                depth, far = depth + 1, last
                far_survival = _survival(bounds[far], state, active, squared, at_far)
                continue
            steps, near_survival, far_survival = _insist(
                i,
                (bounds[near], bounds[far]),
                (rival, far_rival),
                world,
                roots,
                state,
                at_near,
                at_far,
                active,
                path,
                steps,
                setting,
                guards,
            )
        runs += 1
        probability = 1.0 - _exact_survival(bounds[near], state, active, squared)
        if rejected == wanted:
            return near, rejected, steps, visited, probability, runs
    return bounds.size, rejected, steps, visited, probability, runs

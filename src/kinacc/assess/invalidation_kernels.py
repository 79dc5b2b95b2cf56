"""Compiled model invalidation (eqs. 15-24): exact scans over bounds, and the readings they take.

All compiled code is in this one file: numba's cache is aware of changes in the file of the function
called, not in files that function's helpers come from. The first part draws the readings, on which
see :mod:`kinacc.assess.random_numbers`. The plain twin of a run at one bound is
:func:`kinacc.assess.model_invalidation.ModelInvalidation.history`.

How a scan is exact without a run at every bound. For a fixed history the rejection probability
falls as the bound grows, and the point to measure again is the largest of functions linear in
the bound. So if both decisions agree at the two ends of an interval of bounds, every bound inside
takes the same path. Where they do not, the interval is cut in half; the other piece waits and later
resumes from the history it shares. Decisions closer than rounding are left to single bounds.
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
def _score(state, i, eta):
    """Distance of a row beyond a bound, in standard deviations: the row of the largest is next."""
    return (state[i, SIZE] - eta) * state[i, WEIGHT]


@compiled
def _missed(state, i, eta, squared):
    """1 - p-hat of a point at a bound: a measurement comes out larger so often."""
    distance = _score(state, i, eta)
    if distance <= 0.0:
        return 1.0
    return 1.0 - chi2_3(distance * distance if squared else distance)


@compiled
def _survival(eta, state, active, squared, miss):
    """Product of 1 - p-hat at a bound over the active rows, each kept in ``miss``."""
    survival = 1.0
    for i in active:
        miss[i] = _missed(state, i, eta, squared)
        survival *= miss[i]
    return survival


@compiled
def _winner(eta, state, active, miss):
    """Row with the largest score at a bound, the first of equals.

    With it the next largest score, and the product of 1 - p-hat of all others.
    """
    row, best, second, others = -1, -np.inf, -np.inf, 1.0
    for i in active:
        score = _score(state, i, eta)
        if score > best:
            row, best, second = i, score, best
        elif score > second:
            second = score
    for i in active:
        if i != row:
            others *= miss[i]
    return row, second, others


@compiled
def scan(world, bounds, wanted, alpha, squared, roots):
    """Decide the bounds (n,), mm, ascending or descending, in order until one is as ``wanted``.

    wanted: whether it is to be rejected. roots: weight of a point with noise 1 after 0, 1, .. up to
    all readings. Returns the place of that bound (n where none is), and of the last run followed
    whether it rejected, its measurements, points visited and rejection probability; and how many
    runs were followed to their end.
    """
    known, sigma, sizes = world[1], world[2], world[7]
    points, budget = sigma.size, roots.size - 1
    state, rows = np.zeros((points, 3)), np.empty(points, np.int64)
    path = np.empty(budget, np.int64)
    at_near, at_far = np.ones(points), np.ones(points)
    waiting = np.empty((bounds.size + 1, 3), np.int64)  # near end, far end, steps shared
    waiting[0, 0], waiting[0, 1], waiting[0, 2] = 0, bounds.size - 1, 0
    depth, runs = 1, 0
    margin = 1e-12 * max(bounds.max(), sizes[:, 0].max()) / sigma.min() * roots[budget]
    while depth > 0:
        depth -= 1
        near, far, steps = waiting[depth, 0], waiting[depth, 1], waiting[depth, 2]
        state[:] = 0.0
        visited = 0
        for i in path[:steps]:
            state[i, READS] += 1.0
            visited = max(visited, i + 1)
        # A row whose mean lies within all bounds has p-hat 0 and is never measured again.
        lowest, count = min(bounds[near], bounds[far]), 0
        for i in range(visited):
            v = int(state[i, READS])
            state[i, SIZE], state[i, WEIGHT] = sizes[i, v - 1], roots[v] / sigma[i]
            if state[i, SIZE] > lowest:
                rows[count], count = i, count + 1
        near_survival = _survival(bounds[near], state, rows[:count], squared, at_near)
        far_survival = _survival(bounds[far], state, rows[:count], squared, at_far)
        top, near_rival, far_rival, near_others, far_others = -1, 0.0, 0.0, 1.0, 1.0
        while True:
            active, eta, far_eta = rows[:count], bounds[near], bounds[far]
            close = min(abs(1.0 - near_survival - alpha), abs(1.0 - far_survival - alpha))
            is_sure = close > 1e-9 + margin  # rounding does not decide
            if near == far and not is_sure:
                near_survival = _survival(eta, state, active, squared, at_near)
            rejected = 1.0 - near_survival > alpha
            alike = is_sure and (1.0 - far_survival > alpha) == rejected
            i = visited
            if rejected and (near == far or (alike and steps < budget)):
                again = top >= 0 and _score(state, top, eta) > near_rival + margin
                if not (again and _score(state, top, far_eta) > far_rival + margin):
                    top, near_rival, near_others = _winner(eta, state, active, at_near)
                    other, far_rival, far_others = _winner(far_eta, state, active, at_far)
                    alike = alike and other == top
                    alike = alike and _score(state, top, eta) > near_rival + margin
                    alike = alike and _score(state, top, far_eta) > far_rival + margin
                i = top
            if near != far and not alike:
                last = (near + far) // 2
                waiting[depth, 0], waiting[depth, 1], waiting[depth, 2] = last + 1, far, steps
                depth, far, top = depth + 1, last, -1
                far_survival = _survival(bounds[far], state, active, squared, at_far)
                continue
            if steps == budget or (not rejected and visited == points):
                break
            v = int(state[i, READS])
            if v >= known[i]:
                extend(world, i, v)
            state[i, READS], state[i, SIZE], state[i, WEIGHT] = (
                v + 1,
                sizes[i, v],
                roots[v + 1] / sigma[i],
            )
            path[steps], steps = i, steps + 1
            if not rejected:
                visited, top = visited + 1, -1
                near_others, far_others = near_survival, far_survival
                if state[i, SIZE] > min(eta, far_eta):
                    rows[count], count = i, count + 1
            at_near[i] = _missed(state, i, eta, squared)
            at_far[i] = _missed(state, i, far_eta, squared) if near != far else at_near[i]
            near_survival, far_survival = near_others * at_near[i], far_others * at_far[i]
        runs += 1
        if rejected == wanted:
            break
    place = near if rejected == wanted else bounds.size
    probability = 1.0 - _survival(bounds[near], state, rows[:count], squared, at_near)
    return place, rejected, steps, visited, probability, runs

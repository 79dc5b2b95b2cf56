"""Compiled model invalidation (eqs. 15-24): exact scans over bounds, and the readings they take.

All compiled code is in this one file: numba's cache is aware of changes in the file of the function
called, not in files that function's helpers come from. The first part draws the readings, on which
see :mod:`kinacc.assess.world`.

How a scan is exact without a run at every bound. For a fixed history the rejection probability
falls as the bound grows, and the point to measure again is the largest of functions linear in
the bound. So if both decisions agree at the two ends of an interval of bounds, every bound inside
takes the same path. Where they do not, the interval is cut in half; the next is wider by half.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from kinacc.compiled import compiled

Arrays = tuple[np.ndarray, ...]  # of a world
_ROOT_2_OVER_PI = math.sqrt(2.0 / math.pi)
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
def _high_product(a: Any, b: Any) -> Any:
    """Upper 64 bits of the 128-bit product of two uint64."""
    a_low, a_high = a & _LOW, a >> _HALF
    b_low, b_high = b & _LOW, b >> _HALF
    middle = a_high * b_low + ((a_low * b_low) >> _HALF)
    other = a_low * b_high + (middle & _LOW)
    return a_high * b_high + (middle >> _HALF) + (other >> _HALF)


@compiled
def philox(key0: Any, key1: Any, counter0: Any, counter1: Any) -> Any:
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
def normals(key0: Any, key1: Any, point: Any, visit: Any) -> Any:
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
def extend(world: Arrays, i: int, wanted: int) -> None:
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
def extend_all(world: Arrays) -> None:
    """Compute the first reading of every row."""
    for i in range(world[0].shape[0]):
        extend(world, i, 0)


@compiled
def chi2_3_above(x: float) -> float:
    """Probability that a chi-square with three degrees of freedom exceeds x (1 - eq. 18)."""
    return math.erfc(math.sqrt(0.5 * x)) + _ROOT_2_OVER_PI * math.sqrt(x) * math.exp(-0.5 * x)


@compiled
def _follow(world: Arrays, near: float, far: float, alpha: float, squared: bool, roots: Any) -> Any:
    """Run two bounds side by side while they take the same path.

    Returns whether they do to the end, and of that run whether it rejects, its measurements, points
    visited, the rejection probability at the first bound, and the rows in the order measured.
    """
    known, sigma, sizes = world[1], world[2], world[7]
    points, budget, ends = sigma.size, roots.size - 1, 1 if near == far else 2
    reads, score, miss = np.zeros(points, np.int64), np.empty((2, points)), np.ones((2, points))
    active, path = np.empty(points, np.int64), np.empty(budget, np.int64)
    count, visited, steps, worst, rejected, probability = 0, 0, 0, -1, False, 0.0
    while steps < budget and (rejected or visited < points):
        row = worst if rejected else visited
        v = reads[row]
        if v >= known[row]:
            extend(world, row, v)
        path[steps], reads[row], steps = row, v + 1, steps + 1
        if not rejected:
            visited += 1
            if sizes[row, v] <= min(near, far):
                continue  # p-hat is 0, now and later: nothing changes
            active[count], count = row, count + 1
        for end in range(ends):
            bound = far if end else near
            score[end, row] = (sizes[row, v] - bound) * (roots[v + 1] / sigma[row])
            distance = max(score[end, row], 0.0)
            miss[end, row] = chi2_3_above(distance * distance if squared else distance)
        for end in range(ends):
            survival, place, largest = 1.0, -1, -np.inf
            for i in active[:count]:
                survival *= miss[end, i]
            exceeds = 1.0 - survival > alpha
            if exceeds and steps < budget:
                for i in active[:count]:
                    if score[end, i] > largest:  # the first of equals
                        place, largest = i, score[end, i]
            if end == 0:
                worst, rejected, probability = place, exceeds, 1.0 - survival
            elif exceeds != rejected or place != worst:
                return False, rejected, steps, visited, probability, path[:steps]
    return True, rejected, steps, visited, probability, path[:steps]


@compiled
def scan(world: Arrays, bounds: Any, wanted: bool, alpha: float, squared: bool, roots: Any) -> Any:
    """Decide the bounds (n,), mm, ascending or descending, in order until one is as ``wanted``.

    wanted: whether it is to be rejected. roots: weight of a point with noise 1 after 0, 1, .. up to
    all readings. Returns the place of that bound (n where none is), and of the last run followed
    whether it rejected, its measurements, points visited, rejection probability and rows in order.
    """
    near, width = 0, bounds.size
    while True:
        far = min(near + width, bounds.size) - 1
        far = far if far - near >= 3 else near  # few are run one by one
        alike, rejected, steps, visited, probability, path = _follow(
            world, bounds[near], bounds[far], alpha, squared, roots
        )
        if not alike:
            width = (far - near + 1) // 2
            continue
        place = near if rejected == wanted else bounds.size
        near, width = far + 1, max(3 * width // 2, 1 + width)
        if rejected == wanted or near == bounds.size:
            return place, rejected, steps, visited, probability, path

"""Compiled search for the largest size of an error that scores of its readings do not reject."""

from __future__ import annotations

import math

import numpy as np

from kinacc.compiled import compiled

_STEPS = 200  # of a root search; halves alone need 60


@compiled
def sum_of_scores(along, sigma, clip, size):
    """Sum of the clipped scores of readings (k,) at a size, and how fast it falls with the size."""
    total, fall = 0.0, 0.0
    for i in range(along.size):
        score = (along[i] - size) / sigma[i]
        if score > clip:
            total += clip
        elif score < -clip:
            total -= clip
        else:
            total += score
            fall += 1.0 / sigma[i]
    return total, fall


@compiled
def size_above(along, sigma, clip, wanted, low):
    """Largest size at which scores (k,) sum to ``wanted`` or more, where they do so at ``low``.

    The sum falls by straight pieces, so Newton's steps end on the piece that is met; where one
    leaves what is left of the bracket, that is halved.
    """
    high = low
    for i in range(along.size):
        high = max(high, along[i] + clip * sigma[i])
    size = low
    for _ in range(_STEPS):
        total, fall = sum_of_scores(along, sigma, clip, size)
        if total >= wanted:
            low = size
        else:
            high = size
        step = (total - wanted) / fall if fall > 0.0 else math.inf
        if abs(step) <= 1e-15 * abs(size):
            break
        size += step
        if not low < size < high:
            size = 0.5 * (low + high)
            if size <= low or size >= high:
                break
    return size


@compiled
def largest_size(readings, covariances, around, near, apart, clip, wanted, rounds, kept):
    """Largest size over all directions that readings (k, 3) with covariances (k, 3, 3) allow.

    ``around`` (q, 3): directions tried first, of any length; then in every round those that lie as
    ``near`` (r, 3) times ``apart`` about the ``kept`` best, ``apart`` being halved each time.
    """
    count = len(readings)
    along, sigma = np.empty(count), np.empty(count)
    best, size = np.zeros((kept, 3)), np.full(kept, -np.inf)
    tried = around
    for _ in range(rounds):
        for q in range(len(tried)):
            x, y, z = tried[q, 0], tried[q, 1], tried[q, 2]
            length = math.sqrt(x * x + y * y + z * z)
            x, y, z = (x / length, y / length, z / length) if length > 0.0 else (0.0, 0.0, 1.0)
            low = np.inf
            for i in range(count):
                spread = covariances[i]
                along[i] = x * readings[i, 0] + y * readings[i, 1] + z * readings[i, 2]
                sigma[i] = math.sqrt(
                    x * (spread[0, 0] * x + (spread[0, 1] + spread[1, 0]) * y)
                    + y * (spread[1, 1] * y + (spread[1, 2] + spread[2, 1]) * z)
                    + z * (spread[2, 2] * z + (spread[0, 2] + spread[2, 0]) * x)
                )
                low = min(low, along[i] - clip * sigma[i])
            # A direction that does not reach the last of the best needs no root.
            low = max(low, size[-1])
            if sum_of_scores(along, sigma, clip, low)[0] < wanted:
                continue
            found, place = size_above(along, sigma, clip, wanted, low), kept - 1
            while place > 0 and size[place - 1] < found:
                size[place], best[place] = size[place - 1], best[place - 1]
                place -= 1
            size[place] = found
            best[place, 0], best[place, 1], best[place, 2] = x, y, z
        tried = np.empty((kept * len(near), 3))
        for q in range(len(tried)):
            tried[q] = best[q // len(near)] + apart * near[q % len(near)]
        apart *= 0.5
    return max(size[0], 0.0)

"""Compiled densities of the size of a reading with equal noise per axis.

Sizes are in units of the noise's standard deviation per axis. The size x of a reading at a point
of true size a is noncentral chi distributed with three degrees of freedom (eq. 9).
"""

from __future__ import annotations

import math

import numpy as np

from kinacc.compiled import compiled

_NO_SIZE = 1e-12  # of the noise: what readings below it count as


@compiled
def reading_densities(x, noise, true):
    """Density (n, g) of readings of size ``x`` (n,) at true sizes (g,), up to a factor per reading.

    noise: (n,) standard deviations per axis; the largest value of every row is 1. Noncentral chi
    with three degrees of freedom: exp(-(x - a)^2 / 2) (1 - exp(-2 x a)) / a.
    """
    rows, columns = x.size, true.size
    found = np.zeros((rows, columns))
    for i in range(rows):
        # Of a reading of 0, what is left of the factor 1 - exp(-2 x a) is in proportion to a.
        size = max(x[i], _NO_SIZE * noise[i])
        # Beside the nearest size, as densities far from all of them are too small for numbers.
        near, best = np.inf, 0.0
        for j in range(columns):
            near = min(near, abs(x[i] - true[j]) / noise[i])
        for j in range(columns):
            gap = (x[i] - true[j]) / noise[i]
            log = 0.5 * (near * near - gap * gap)
            if log > -60.0:
                product = 2.0 * size * true[j] / noise[i] ** 2
                away = -math.expm1(-product) if product < 40.0 else 1.0
                found[i, j] = math.exp(log) * away / true[j]
                best = max(best, found[i, j])
        found[i] /= best
    return found

"""Compiled limits on the size of an error from the size of a reading with equal noise per axis.

Sizes are in units of the noise's standard deviation per axis. The size x of a reading at a point
of true size a is noncentral chi distributed with three degrees of freedom (eq. 9).
"""

from __future__ import annotations

import math

import numpy as np
from numba.extending import register_jitable

from kinacc.assess import plain_sizes
from kinacc.compiled import compiled

# Compiled from the very functions that serve where little is asked.
reading_below = register_jitable(plain_sizes.reading_below)
size_at = compiled(plain_sizes.size_at)


@compiled
def reading_densities(x, noise, true):
    """Density (n, g) of readings of size ``x`` (n,) at true sizes (g,), up to a factor per reading.

    noise: (n,) standard deviations per axis; the largest value of every row is 1. Noncentral chi
    with three degrees of freedom: exp(-(x - a)^2 / 2) (1 - exp(-2 x a)) / a.
    """
    rows, columns = x.size, true.size
    found = np.zeros((rows, columns))
    log, log_true = np.empty(columns), np.log(true)
    for i in range(rows):
        best = -np.inf
        for j in range(columns):
            gap = (x[i] - true[j]) / noise[i]
            log[j] = -0.5 * gap * gap - log_true[j]
            # The other factor is at most 1: what is too small without it needs no more work.
            if log[j] - best > -60.0:
                product = 2.0 * x[i] * true[j] / noise[i] ** 2
                if product < 40.0:
                    log[j] += math.log(-math.expm1(-product) + 1e-300)
                best = max(best, log[j])
        for j in range(columns):
            if log[j] - best > -60.0:
                found[i, j] = math.exp(log[j] - best)
    return found

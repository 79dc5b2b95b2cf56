"""Worlds of readings already at hand, every one of them known."""

from __future__ import annotations

import numpy as np

from kinacc.assess.world import World


def measured_world(first_mm, repeats_mm, sigma_mm) -> World:
    """World of first readings (m, 3) and repeats (m, V, 3), noise a number or (m,), mm."""
    first = np.asarray(first_mm, dtype=float)
    readings = np.concatenate([first[:, None, :], np.asarray(repeats_mm, dtype=float)], axis=1)
    points, visits = readings.shape[:2]
    sums = np.cumsum(readings, axis=1)
    sizes = np.sqrt(np.sum((sums / np.arange(1.0, visits + 1)[:, None]) ** 2, axis=2))
    sigma = np.broadcast_to(np.asarray(sigma_mm, dtype=float), points).copy()
    known, index = np.full(points, visits), np.arange(points)
    return World(readings, known, sigma, first, np.zeros(2, np.uint64), index, sums[:, -1], sizes)

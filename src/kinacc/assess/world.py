"""A world: every reading one simulation could take, fixed before any of them is taken."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from kinacc.errors import InputError, Problem, refuse

_NO_KEY = np.zeros(2, np.uint64)


@dataclass(frozen=True)
class World:
    """Readings of m operating points, rows in the order in which they are visited.

    readings_mm: (m, V, 3) error vectors, robot base frame, of which row i holds the first
    ``known[i]``; sigma_mm: (m,) noise per axis, equal in the three axes. A drawn world computes
    readings as they are asked for, from the errors (m, 3), the key and the points' own numbers
    ``index``: what a reading is never depends on when it is asked for. Beside them: sums_mm (m, 3)
    of the readings known, and sizes_mm (m, V), the magnitude of the mean of a point's readings up
    to each.
    """

    readings_mm: np.ndarray
    known: np.ndarray
    sigma_mm: np.ndarray
    error_mm: np.ndarray
    key: np.ndarray
    index: np.ndarray
    sums_mm: np.ndarray
    sizes_mm: np.ndarray

    @property
    def points(self) -> int:
        """Number of operating points m."""
        return self.readings_mm.shape[0]

    @property
    def visits(self) -> int:
        """Readings available at each point, V."""
        return self.readings_mm.shape[1]

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """The fields in the order in which the compiled kernels unpack them."""
        return (
            self.readings_mm,
            self.known,
            self.sigma_mm,
            self.error_mm,
            self.key,
            self.index,
            self.sums_mm,
            self.sizes_mm,
        )

    def reading_mm(self, row: int, visit: int) -> np.ndarray:
        """Error vector (3,) of reading number ``visit`` (0 = first) at a row, robot base frame."""
        if visit >= self.known[row]:
            from kinacc.assess.random_numbers import extend

            extend(self.arrays, row, visit)
        return self.readings_mm[row, visit]

    def magnitudes_mm(self, measurements: int) -> np.ndarray:
        """Magnitudes of the first readings that fit the budget, in visiting order."""
        return self._first_magnitudes_mm[:measurements]

    @cached_property
    def _first_magnitudes_mm(self) -> np.ndarray:
        return self.sizes_mm[:, 0].copy()

    def complete(self) -> World:
        """The same world with every reading computed."""
        for row in range(self.points):
            self.reading_mm(row, self.visits - 1)
        return self


def measured_world(first_mm: ArrayLike, repeats_mm: ArrayLike, sigma_mm: ArrayLike) -> World:
    """World of readings already at hand.

    first_mm (m, 3), repeats_mm (m, V, 3) in the robot base frame; sigma_mm a number or (m,), the
    standard deviation per axis. Raises InputError on wrong shapes, values that are not finite or
    noise that is not positive.
    """
    first = np.array(first_mm, dtype=np.float64)
    repeats = np.array(repeats_mm, dtype=np.float64)
    problems = _shape_problems(first, "first readings")
    if not problems and (repeats.ndim != 3 or repeats.shape[::2] != first.shape):
        problems.append(
            Problem(
                "repeats",
                f"shape {repeats.shape}",
                f"({first.shape[0]}, any, 3)",
                "a row each",
            )
        )
    elif not np.all(np.isfinite(repeats)):
        problems.append(Problem("repeats", "contain values that are not finite", "numbers in mm"))
    points = first.shape[0] if first.ndim else 0
    sigma, noise_problems = _noise(sigma_mm, points)
    if problems or noise_problems:
        raise InputError(problems + noise_problems, "a world cannot be made of these readings")
    readings = np.concatenate([first[:, None, :], repeats], axis=1)
    known = np.full(points, readings.shape[1], np.int64)
    sums = np.cumsum(readings, axis=1)
    means = sums / np.arange(1.0, readings.shape[1] + 1)[:, None]
    sizes = np.sqrt(np.sum(means**2, axis=2))
    return World(readings, known, sigma, first, _NO_KEY, np.arange(points), sums[:, -1], sizes)


def drawn_world(
    error_mm: ArrayLike,
    sigma_mm: ArrayLike,
    key: np.ndarray,
    visits: int,
    order: ArrayLike | None = None,
) -> World:
    """World of simulated readings: true error plus white normal noise (eq. 9).

    error_mm: (m, 3) true errors, robot base frame; sigma_mm: a number or (m,), standard deviation
    per axis; key: (2,) uint64 from :func:`kinacc.assess.random_numbers.key_of`; visits: readings
    available at each point; order: (m,) point numbers in visiting order, default 0 .. m-1. The
    noise at a point belongs to its number, not to its place in the order. Raises InputError on bad
    input.
    """
    error = np.array(error_mm, dtype=np.float64)
    problems = _shape_problems(error, "true errors")
    points = error.shape[0] if error.ndim else 0
    sigma, noise_problems = _noise(sigma_mm, points)
    problems += noise_problems
    if visits < 1:
        problems.append(Problem("visits", f"{visits}", "at least 1"))
    index = np.arange(points) if order is None else np.array(order, dtype=np.int64)
    if not np.array_equal(np.sort(index), np.arange(points)):
        problems.append(
            Problem("visiting order", "does not name every point once", f"0 to {points - 1}")
        )
    refuse(problems, "a world cannot be drawn from this input")
    return draw(error[index], sigma[index], key, visits, index)


def draw(error_mm, sigma_mm, key, visits: int, index, lost: World | None = None) -> World:
    """As :func:`drawn_world`, rows already in visiting order and known to be good.

    ``lost`` is a world of the same shape that nobody needs any more, whose memory is drawn into.
    """
    from kinacc.assess.random_numbers import extend_all

    points = index.size
    if lost is None:  # repeats stay untouched until asked for
        readings, sizes = np.empty((points, visits, 3)), np.empty((points, visits))
    else:
        readings, sizes = lost.readings_mm, lost.sizes_mm
    known, sums = np.zeros(points, np.int64), np.zeros((points, 3))
    world = World(readings, known, sigma_mm, error_mm, key, index, sums, sizes)
    extend_all(world.arrays, 0)
    return world


def _shape_problems(values: np.ndarray, name: str) -> list[Problem]:
    if values.ndim != 2 or values.shape[1] != 3 or values.shape[0] == 0:
        return [Problem(name, f"shape {values.shape}", "(m, 3) with m at least 1, in mm")]
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if bad.size:
        return [
            Problem(
                name,
                f"row {bad[0]} is not finite ({bad.size} such rows): {values[bad[0]].tolist()}",
                "numbers in mm",
            )
        ]
    return []


def _noise(sigma_mm: ArrayLike, points: int) -> tuple[np.ndarray, list[Problem]]:
    sigma = np.array(sigma_mm, dtype=np.float64)
    allowed = "a number above 0, or one per point, in mm"
    if sigma.ndim > 1 or (sigma.ndim == 1 and sigma.size != points):
        return sigma, [Problem("noise", f"shape {sigma.shape}", allowed)]
    if not np.all(np.isfinite(sigma)) or np.any(sigma <= 0.0):
        return sigma, [Problem("noise", f"smallest value {sigma.min():g} mm", allowed)]
    return np.broadcast_to(sigma, (points,)).copy(), []

"""A world: every reading one simulation could take, fixed before any of them is taken."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from kinacc.errors import InputError, Problem


@dataclass(frozen=True)
class World:
    """Readings of m operating points, rows in the order in which they are visited.

    readings_mm: (m, V, 3) error vectors, robot base frame, of which row i holds the first
    ``known[i]``; sigma_mm: (m,) noise per axis, equal in the three axes. Readings are computed as
    they are asked for, from the errors (m, 3), the key and the points' own numbers ``index``: what
    a reading is never depends on when it is asked for. Beside them: sums_mm (m, 3) of the readings
    known, and sizes_mm (m, V), the magnitude of the mean of a point's readings up to each. The
    compiled kernels unpack the fields in this order.
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
        return len(self.known)

    @property
    def visits(self) -> int:
        """Readings available at each point, V."""
        return self.readings_mm.shape[1]

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """The fields in their order."""
        return tuple(getattr(self, field.name) for field in fields(self))

    def reading_mm(self, row: int, visit: int) -> np.ndarray:
        """Error vector (3,) of reading number ``visit`` (0 = first) at a row, robot base frame."""
        if visit >= self.known[row]:
            from kinacc.assess.random_numbers import extend

            extend(self.arrays, row, visit)
        return self.readings_mm[row, visit]

    def magnitudes_mm(self, measurements: int) -> np.ndarray:
        """Magnitudes of the first readings that fit the budget, in visiting order."""
        return self.sizes_mm[:measurements, 0].copy()


def drawn_world(
    error_mm: ArrayLike,
    sigma_mm: ArrayLike,
    key: np.ndarray,
    visits: int,
    order: ArrayLike | None = None,
) -> World:
    """Return a world of simulated readings: true error plus white normal noise (eq. 9).

    Parameters
    ----------
    error_mm : (m, 3) true errors, robot base frame
    sigma_mm : a number or (m,), standard deviation per axis
    key : (2,) uint64 from :func:`kinacc.assess.random_numbers.key_of`
    visits : readings available at each point
    order : (m,) point numbers in visiting order, default 0 .. m-1. The noise at a point belongs to
        its number, not to its place in the order.

    Raises
    ------
    InputError
        For errors or noise that cannot be used.
    """
    error, sigma = checked_errors(error_mm), np.array(sigma_mm, dtype=np.float64)
    index = np.arange(len(error)) if order is None else np.array(order, dtype=np.int64)
    if sigma.shape not in ((), (len(error),)) or not np.all(np.isfinite(sigma) & (sigma > 0.0)):
        allowed = "a number above 0, or one per point, in mm"
        raise InputError(Problem("noise", f"{sigma_mm!r}"[:60], allowed))
    return draw(error[index], np.broadcast_to(sigma, len(error))[index], key, visits, index)


def draw(error_mm, sigma_mm, key, visits: int, index) -> World:
    """As :func:`drawn_world`, rows already in visiting order and known to be good."""
    from kinacc.assess.random_numbers import extend_all

    points = index.size
    # Repeats stay untouched until asked for.
    readings, sizes = np.empty((points, visits, 3)), np.empty((points, visits))
    known, sums = np.zeros(points, np.int64), np.zeros((points, 3))
    world = World(readings, known, sigma_mm, error_mm, key, index, sums, sizes)
    extend_all(world.arrays, 0)
    return world


def checked_errors(error_mm: ArrayLike) -> np.ndarray:
    """Return true errors as (m, 3) float64; InputError where they cannot be used."""
    errors = np.ascontiguousarray(error_mm, dtype=np.float64)
    if errors.ndim != 2 or errors.shape[1] != 3 or errors.shape[0] == 0:
        message, allowed = f"shape {errors.shape}", "(m, 3) with m at least 1, in mm"
        raise InputError(Problem("true errors", message, allowed))
    bad = np.flatnonzero(~np.isfinite(errors).all(axis=1))
    if bad.size:
        message = f"points {bad[:5].tolist()} are not finite"
        raise InputError(Problem("true errors", message, "numbers in mm"))
    return errors


def error_vectors(columns: Mapping) -> np.ndarray:
    """Return the error vectors (n, 3) in the columns ex_mm, ey_mm and ez_mm of a table."""
    return np.stack([np.asarray(columns[f"e{axis}_mm"], dtype=float) for axis in "xyz"], axis=1)

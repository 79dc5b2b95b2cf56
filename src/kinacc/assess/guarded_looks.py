"""The limits of a campaign that is guarded against readings that go wrong."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from kinacc.assess.adaptive import Ledger
from kinacc.assess.boundary import Boundary, spending
from kinacc.assess.lower_average import LATE, LowerAverage, stages
from kinacc.assess.sequential_limits import Looks
from kinacc.assess.wrong_readings import (
    guarded_boundary,
    guarded_lower_mm,
    guarded_stages,
    guarded_upper_mm,
)


@lru_cache(maxsize=64)
def guarded_by_spending(
    counts: tuple[int, ...], error: float, early: float, rate: float
) -> Boundary:
    """As :func:`kinacc.assess.boundary.boundary`, for scores; of any covariance alike."""
    z = guarded_boundary(counts, tuple(spending(counts, error, early, 1.0).tolist()), rate)
    return Boundary(np.array(counts), np.array(z), np.array(z))


class GuardedLooks(Looks):
    """As :class:`Looks`; upper limits count every reading by its clipped score.

    Lower limits of single points are not guarded: only
    all of them together say something (:meth:`largest_lower_mm`). ``wrong``: readings of the
    campaign that may be wrong at most.
    """

    def __init__(
        self,
        ledger: Ledger,
        upper: Boundary,
        lower_error: float,
        shares: np.ndarray,
        factor: float,
        rate: float,
        wrong: int,
    ) -> None:
        super().__init__(ledger, upper, lower_error, shares, factor)
        self.rate, self.wrong = rate, wrong
        self._readings: dict[int, list[list[float]]] = {}
        self._covariances: dict[int, list[np.ndarray]] = {}

    def update(self, point: int) -> None:
        """Take the reading just recorded, and look at the point where that is due."""
        _, reading, covariance = self.ledger.readings[-1]
        planned = self.ledger.candidates.covariance_mm2[point]
        self._readings.setdefault(point, []).append(reading)
        self._covariances.setdefault(point, []).append(
            planned if covariance is None else np.asarray(covariance, dtype=float)
        )
        super().update(point)

    def _limits_of(self, boundary: Boundary, factor: np.ndarray) -> np.ndarray:
        found = np.full(len(self.upper_mm), math.inf)
        for point in self.ledger.visited:
            own, looks = factor.item(point), range(self.done(point))
            limits = (self._limit(point, look, boundary, own) for look in looks)
            found[point] = min(limits, default=math.inf)
        return found

    def largest_lower_mm(self, factor: np.ndarray) -> float:
        """Lower bound on the largest error of the visited points, from single ones.

        Of one more point than can have a wrong reading, with the largest limits, one is right.
        """
        limits = np.sort(self.lower_limits_mm(factor)[self.ledger.visited])
        return float(limits[-1 - self.wrong]) if len(limits) > self.wrong else 0.0

    def _limit(self, point: int, look: int, boundary: Boundary, factor: float) -> float:
        if not look:
            return super()._limit(point, look, boundary, factor)
        count = int(boundary.counts[look])
        covariances = factor**2 * np.array(self._covariances[point][:count])
        readings = np.array(self._readings[point][:count])
        return guarded_upper_mm(readings, covariances, boundary.z.item(look), self.rate)


class GuardedAverage(LowerAverage):
    """As :class:`LowerAverage`, every reading counting by its clipped score."""

    def __init__(self, wanted: int, error: float, rate: float) -> None:
        self._rate = rate
        super().__init__(wanted, error)

    def bound_mm(self, factor: np.ndarray) -> float:
        """The largest bound of the stages reached, 0 before; noise (m,) times as planned."""
        along, noise = np.array(self._along_mm), factor[self._rows] * np.array(self._noise_mm)
        bounds = (
            guarded_lower_mm(along[: last + 1], noise[: last + 1], z, self._rate)
            for last, z in self._reached()
        )
        return max(bounds, default=0.0)

    def _boundary(self, error: float, freedom: float) -> tuple[float, ...]:
        counts = stages(self.wanted)
        shares = tuple(spending(counts, error, 0.0, LATE).tolist())
        return guarded_stages(counts, shares, self._rate)

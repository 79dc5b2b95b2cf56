"""Model Invalidation (eqs. 15-24): the smallest bound that the measurements do not reject.

At one bound eta the algorithm measures point after point; whenever the rejection probability
exceeds alpha it measures the worst point again and averages, until the probability falls back or
the budget is spent. The model is rejected at eta if the probability exceeds alpha after the last
measurement; a run that has visited every point with the probability at most alpha ends there, not
rejected. Whether eta is rejected is not monotone in eta, so "the smallest bound that did not
reject" has three readings (``search``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from kinacc.assess.world import Assessment, Assessor, World
from kinacc.errors import InputError, Problem

GRID_PER_MM = 1000
SEARCHES = ("from_above", "from_below", "bisection")
DISTANCES = ("squared", "as_printed")
_POWERS = {"r": 0.5, "sqrt_r": 0.25}  # of the number of readings in a point's weight
COVARIANCES = tuple(_POWERS)


class Run(NamedTuple):
    """Outcome of one sequential run at one bound."""

    rejected: bool
    measurements: int
    points_visited: int
    rejection_probability: float


class Step(NamedTuple):
    """One measurement of a run; magnitudes in mm, ``repeat`` counts from 1 at each point."""

    row: int
    repeat: int
    measured_mm: float
    averaged_mm: float
    rejection_probability: float


@dataclass(frozen=True)
class ModelInvalidation(Assessor):
    """Settings of the assessor.

    measurements: budget of a run; alpha: threshold on the rejection probability (eq. 22);
    distance: ``squared`` (the squared Mahalanobis distance into the chi-square distribution) or
    ``as_printed`` (its root, eqs. 18 and 20); covariance: ``r`` (Sigma / r) or ``sqrt_r`` (eq. 24
    as printed); search: ``from_above`` (1 um above the highest rejected bound of the 1 um grid),
    ``from_below`` (lowest bound of the grid that is not rejected) or ``bisection`` (between 0 and
    the largest first reading, to 1 um).
    """

    measurements: int
    alpha: float
    distance: str
    covariance: str
    search: str
    name: ClassVar[str] = "model_invalidation"
    switches: ClassVar[dict[str, tuple[str, ...]]] = {
        "distance": DISTANCES,
        "covariance": COVARIANCES,
        "search": SEARCHES,
    }

    def assess(self, world: World) -> Assessment:
        """Search the assessed accuracy; measurements and points are those of the run at it."""
        eta = self.assessed_mm(world)
        outcome = self.run(world, eta)
        return Assessment(eta, outcome.measurements, outcome.points_visited)

    def assessed_mm(self, world: World) -> float:
        """The bound the search arrives at, mm."""
        if self.search == "bisection":
            low, high = 0.0, float(world.magnitudes_mm(self.measurements).max())
            while high - low > 1.0 / GRID_PER_MM:
                middle = 0.5 * (low + high)
                low, high = (middle, high) if self.run(world, middle).rejected else (low, middle)
            return high
        bounds = np.arange(self.top(world) + 1) / GRID_PER_MM
        if self.search == "from_below":
            return self._scan(world, bounds, False)[0] / GRID_PER_MM
        return (bounds.size - self._scan(world, bounds[::-1].copy(), True)[0]) / GRID_PER_MM

    def top(self, world: World) -> int:
        """Grid bound at or above every first reading: no run at it can reject."""
        return math.ceil(float(world.magnitudes_mm(self.measurements).max()) * GRID_PER_MM)

    def run(self, world: World, eta_mm: float) -> Run:
        """One sequential run at the bound eta."""
        return Run(*self._scan(world, np.array([float(eta_mm)]), True)[1:5])

    def history(self, world: World, eta_mm: float) -> list[Step]:
        """Every measurement of one run at the bound eta, in order (Figs. 5 and 6).

        In plain Python, step by step; the compiled kernel is held to it.
        """
        self._check_visits(world)
        sums: dict[int, np.ndarray] = {}  # the points visited, in visiting order
        counts: dict[int, int] = {}
        scores: dict[int, float] = {}
        misses: dict[int, float] = {}
        steps: list[Step] = []
        rejection = 0.0
        while len(steps) < self.measurements:
            if rejection > self.alpha:
                # p-hat grows with the distance but reaches 1 in floating point: compare distances.
                # max() returns the first of equals, the point visited first.
                row = max(scores, key=scores.__getitem__)
            elif len(sums) < world.points:
                row = len(sums)
                sums[row], counts[row] = np.zeros(3), 0
            else:
                break
            reading = world.reading_mm(row, counts[row])
            sums[row] = sums[row] + reading
            counts[row] += 1
            average_mm = _magnitude(sums[row] / counts[row])
            scores[row] = mahalanobis_excess(
                average_mm, eta_mm, world.sigma_mm[row], counts[row], self.covariance
            )
            misses[row] = 1.0 - point_probability(scores[row], self.distance)
            rejection = 1.0 - math.prod(misses.values())
            steps.append(Step(row, counts[row], _magnitude(reading), average_mm, rejection))
        return steps

    def _scan(self, world: World, bounds_mm: np.ndarray, wanted: bool) -> tuple[Any, ...]:
        """The scan of :func:`kinacc.assess.invalidation_kernels.scan` with these settings."""
        from kinacc.assess.invalidation_kernels import scan

        self._check_visits(world)
        roots = np.arange(self.measurements + 1.0) ** _POWERS[self.covariance]
        squared = self.distance == "squared"
        return scan(tuple(world), bounds_mm, wanted, float(self.alpha), squared, roots)

    def _check_visits(self, world: World) -> None:
        if world.visits < self.measurements:
            raise InputError(
                Problem(
                    "repeats",
                    f"{world.visits} readings a point for {self.measurements} measurements",
                    f"{self.measurements} readings a point, for all may fall on one",
                    "give more repeats or a smaller budget",
                )
            )


def mahalanobis_excess(
    average_mm: float, eta_mm: float, sigma_mm: float, count: int, covariance: str
) -> float:
    """Mahalanobis distance of an averaged measurement beyond the bound, negative inside it.

    average_mm: its magnitude; sigma_mm: noise of one reading per axis; count: readings averaged.
    With equal noise in the three axes the candidate of eq. 21 is the nearest point of the ball in
    every metric, so the distance of eq. 20 is (|e| - eta) / (standard deviation of the average).
    """
    return (average_mm - eta_mm) * count ** _POWERS[covariance] / float(sigma_mm)


def point_probability(distance_outside: float, distance: str) -> float:
    """p-hat of one point (eq. 18) from its Mahalanobis distance to the candidate error (1)."""
    if distance_outside <= 0.0:
        return 0.0
    from scipy.special import chdtr

    return float(chdtr(3.0, distance_outside**2 if distance == "squared" else distance_outside))


def _magnitude(vector: np.ndarray) -> float:
    return math.sqrt(sum(float(x) ** 2 for x in vector))

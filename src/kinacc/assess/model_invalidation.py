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
import pandas as pd
from scipy.special import chdtrc

from kinacc.assess.world import Assessment, Assessor, World
from kinacc.errors import input_error

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

    def history(self, world: World, eta_mm: float) -> pd.DataFrame:
        """Every measurement of one run at the bound eta, in order (Figs. 5 and 6).

        Columns row, repeat (from 1 at each point), measured_mm and averaged_mm (magnitudes of the
        reading and of the mean of the point's readings so far), rejection_probability. With equal
        noise in the three axes the candidate of eq. 21 is the nearest point of the ball in every
        metric, so the distance of eq. 20 is (|e| - eta) / (standard deviation of the average).
        """
        row = self._scan(world, np.array([float(eta_mm)]), True)[5]
        repeat = pd.Series(row).groupby(row).cumcount().to_numpy() + 1
        averaged_mm = world.sizes_mm[row, repeat - 1]
        root = repeat ** _POWERS[self.covariance] / world.sigma_mm[row]
        distance = np.maximum((averaged_mm - eta_mm) * root, 0.0)
        missed = chdtrc(3.0, distance**2 if self.distance == "squared" else distance)  # eq. 18
        newest = np.ones((len(row), world.points))  # of every point, after each measurement
        for step, point in enumerate(row):
            newest[step:, point] = missed[step]
        return pd.DataFrame(
            {
                "row": row,
                "repeat": repeat,
                "measured_mm": np.linalg.norm(world.readings_mm[row, repeat - 1], axis=1),
                "averaged_mm": averaged_mm,
                "rejection_probability": 1.0 - newest.prod(axis=1),
            }
        )

    def _scan(self, world: World, bounds_mm: np.ndarray, wanted: bool) -> tuple[Any, ...]:
        """The scan of :func:`kinacc.assess.invalidation_kernels.scan` with these settings."""
        from kinacc.assess.invalidation_kernels import scan

        if world.visits < self.measurements:
            raise input_error(
                "repeats",
                f"{world.visits} readings a point for {self.measurements} measurements",
                f"{self.measurements} readings a point, for all may fall on one",
                "give more repeats or a smaller budget",
            )
        roots = np.arange(self.measurements + 1.0) ** _POWERS[self.covariance]
        squared = self.distance == "squared"
        return scan(tuple(world), bounds_mm, wanted, float(self.alpha), squared, roots)

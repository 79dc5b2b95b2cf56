"""Challenging a bound: measure again the point that the bound under test explains worst."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinacc.assess.adaptive import Candidates, LedgerCampaign, check_budget
from kinacc.assess.ellipsoid import BallDistances
from kinacc.assess.statement import MEASURED, Reason, Statement
from kinacc.assess.visits import first_points
from kinacc.errors import Problem

_STILL = 0.02  # of the budget: readings between two searches of the smallest bound not rejected


def invalidation_problems(settings) -> list[Problem]:
    """What is wrong with budget and share."""
    problems = check_budget(settings.measurements, settings.confidence)
    if not 0.0 < settings.visited <= 1.0:
        problems.append(Problem("visited", f"{settings.visited}", "above 0 and at most 1"))
    return problems


class ChallengeCampaign(LedgerCampaign):
    """New points first, then the worst point at the bound under test."""

    def __init__(self, settings, candidates: Candidates, bound_mm: float | None = None) -> None:
        super().__init__(settings, candidates)
        self.first = first_points(settings.measurements, candidates.points, settings.visited)
        self._fixed_mm = bound_mm
        self._bound_mm, self._found_at = 0.0, -1

    def next(self) -> int | None:
        """A new point while there is one to visit, then the one farthest beyond the bound."""
        taken = self.ledger.taken
        if taken < self.first:
            return taken
        if taken >= self.settings.measurements:
            return None
        return self.ledger.visited[self._worst()]

    def statements(self) -> tuple[Statement, ...]:
        """The smallest bound the readings do not reject."""
        if not self.ledger.visited:
            return (Statement(MEASURED, withheld=Reason("nothing_measured")),)
        return (Statement(MEASURED, self.smallest_mm()),)

    def smallest_mm(self, precision: float = 1e-6) -> float:
        """The smallest bound whose rejection probability is at most alpha, to ``precision``."""
        distances = self._distances()
        low, high = 0.0, float(distances.size_mm.max())
        while high - low > precision * high:
            middle = 0.5 * (low + high)
            if rejection(distances.beyond(middle)) > self.settings.alpha:
                low = middle
            else:
                high = middle
        return high

    def _worst(self) -> int:
        if self._fixed_mm is not None:
            bound = self._fixed_mm
        else:
            wait = max(round(_STILL * self.settings.measurements), 1)
            if self._found_at < 0 or self.ledger.taken - self._found_at >= wait:
                self._bound_mm, self._found_at = self.smallest_mm(1e-3), self.ledger.taken
            bound = self._bound_mm
        distances = self._distances()
        beyond = distances.beyond(bound)
        # Where every reading is inside, the one nearest to the bound is the worst.
        return int(np.argmax(beyond if beyond.any() else distances.size_mm))

    def _distances(self) -> BallDistances | EvenDistances:
        visited = self.ledger.visited
        noises = [self.ledger.noise(point) for point in visited]
        if all(isinstance(each, float) for each in noises):
            return EvenDistances(self.ledger.sizes_mm(), np.array(noises))
        spread = [each**2 * np.eye(3) if isinstance(each, float) else each for each in noises]
        return BallDistances(self.ledger.mean_mm[visited], np.array(spread))


class EvenDistances(NamedTuple):
    """As :class:`BallDistances` where the noise is equal in all directions: eq. 21 is exact."""

    size_mm: np.ndarray
    noise_mm: np.ndarray

    def beyond(self, radius_mm: float) -> np.ndarray:
        """Distances (n,) to the ball of this radius; 0 inside."""
        return np.maximum(self.size_mm - radius_mm, 0.0) / self.noise_mm


def rejection(distances: np.ndarray) -> float:
    """Rejection probability of eqs. 18 and 19 from Mahalanobis distances (n,)."""
    from scipy.special import chdtrc

    return 1.0 - float(np.prod(chdtrc(3, distances**2)))

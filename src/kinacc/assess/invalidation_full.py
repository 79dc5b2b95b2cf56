"""Model Invalidation where the noise differs by direction and point: full covariances."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from kinacc.assess.adaptive import (
    FIRST_SHARE,
    AdaptiveAssessor,
    Campaign,
    Candidates,
    check_settings,
)
from kinacc.assess.limits import BallDistances
from kinacc.assess.statement import CONFIDENCE, MEASURED, Reason, Statement

_STILL = 0.02  # of the budget: readings between two searches of the smallest bound not rejected


def check_invalidation(settings, *stated: tuple[str, bool, str]) -> None:
    """Raise InputError where settings cannot be used."""
    share = ("visited", 0.0 < settings.visited <= 1.0, "above 0 and at most 1")
    check_settings(settings, share, *stated)


@dataclass(frozen=True)
class ModelInvalidationFull(AdaptiveAssessor):
    """Eqs. 15-24 with the least-Mahalanobis point of the ball in place of eq. 21.

    Eq. 21 scales a reading back to the ball along its own direction, which is the nearest point
    only where the noise is equal in all directions; with other noise it rejects true models too
    often. Here the candidate minimises the Mahalanobis distance
    (:class:`kinacc.assess.limits.BallDistances`). A share ``visited`` of the budget goes to new
    points; the rest to the worst point (eq. 23) at the smallest bound not rejected so far, or at
    ``bound_mm`` where that is given. The value is the smallest bound the readings do not reject.
    Assumes normal readings of known covariance. No confidence: ``alpha`` is a threshold on a
    product of p-values, not an error rate.
    """

    measurements: int
    visited: float = FIRST_SHARE
    alpha: float = field(kw_only=True)
    bound_mm: float | None = None
    name: ClassVar[str] = "model_invalidation_full"
    confidence: ClassVar[float] = CONFIDENCE  # of limits on single points; its statement has none

    def __post_init__(self) -> None:
        bound = self.bound_mm is None or self.bound_mm > 0.0
        check_invalidation(self, ("bound_mm", bound, "above 0, in mm"))

    def begin(self, candidates: Candidates) -> ChallengeCampaign:
        """Return a new campaign."""
        return ChallengeCampaign(self, candidates, self.bound_mm)


class ChallengeCampaign(Campaign):
    """New points first, then the worst point at the bound under test."""

    settings: Any

    def __init__(self, settings, candidates: Candidates, bound_mm: float | None = None) -> None:
        super().__init__(settings, candidates)
        budget, points = settings.measurements, candidates.points
        self.first = max(math.ceil(settings.visited * min(budget, points)), 1)
        if budget >= 1.5 * points:
            self.first = points
        self._fixed_mm = bound_mm
        self._bound_mm, self._found_at = 0.0, -1

    def next(self) -> int | None:
        """A new point while there is one to visit, then the one farthest beyond the bound."""
        taken = self.ledger.taken
        if taken < self.first:
            return taken
        return self._worst() if taken < self.settings.measurements else None

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
        wait = max(round(_STILL * self.settings.measurements), 1)
        if self._found_at < 0 or self.ledger.taken - self._found_at >= wait:
            self._bound_mm = self._fixed_mm or self.smallest_mm(1e-3)
            self._found_at = self.ledger.taken
        distances = self._distances()
        beyond = distances.beyond(self._bound_mm)
        # Where every reading is inside, the one nearest to the bound is the worst.
        worst = int(np.argmax(beyond if beyond.any() else distances.size_mm))
        return self.ledger.visited[worst]

    def _distances(self) -> BallDistances:
        visited = self.ledger.visited
        return BallDistances(self.ledger.mean_mm[visited], self.ledger.spread_mm2[visited])


def rejection(distances: np.ndarray) -> float:
    """Return the rejection probability of eqs. 18 and 19 from Mahalanobis distances (n,)."""
    from scipy.special import chdtrc

    return 1.0 - float(np.prod(chdtrc(3, distances**2)))

"""Model Invalidation where noise differs by direction and point, and with bounds that hold."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc

from kinacc.assess.adaptive import (
    FIRST_SHARE,
    AdaptiveAssessor,
    Campaign,
    Candidates,
    about_all_if_all_measured,
    check_settings,
)
from kinacc.assess.limits import BallDistances, Looks, boundary
from kinacc.assess.statement import CONFIDENCE, MEASURED, Reason, Statement

_STILL = 0.02  # of the budget: readings between two searches of the smallest bound not rejected
_FIRST_LOOK = 0.6  # of a point's allowed lower error; every further look has half of what is left


@dataclass(frozen=True)
class ModelInvalidationFull(AdaptiveAssessor):
    """Eqs. 15-24 with the least-Mahalanobis point of the ball in place of eq. 21.

    Eq. 21 scales a reading back to the ball along its own direction, which is the nearest point
    only where the noise is equal in all directions; with other noise it rejects true models too
    often. Here the candidate minimises the Mahalanobis distance
    (:class:`kinacc.assess.limits.BallDistances`). 60 % of the budget go to new points; the rest to
    the worst point (eq. 23) at the smallest bound not rejected so far. The value is the smallest
    bound the readings do not reject.
    Assumes normal readings of known covariance. No confidence: ``alpha`` is a threshold on a
    product of p-values, not an error rate.
    """

    measurements: int
    alpha: float = field(kw_only=True)
    confidence: float = CONFIDENCE  # of limits on single points; its statement has none
    name: ClassVar[str] = "model_invalidation_full"

    def __post_init__(self) -> None:
        check_settings(self)

    def begin(self, candidates: Candidates) -> ChallengeCampaign:
        """Return a new campaign."""
        return ChallengeCampaign(self, candidates)


class ChallengeCampaign(Campaign):
    """New points first, then the worst point at the bound under test."""

    settings: ModelInvalidationFull

    def __init__(self, settings: ModelInvalidationFull, candidates: Candidates) -> None:
        super().__init__(settings, candidates)
        budget, points = settings.measurements, candidates.points
        self.first = max(math.ceil(FIRST_SHARE * min(budget, points)), 1)
        if budget >= 1.5 * points:
            self.first = points
        self._bound_mm, self._next_search = 0.0, 0

    def next(self) -> int | None:
        """A new point while there is one to visit, then the one farthest beyond the bound."""
        taken, budget = self.ledger.taken, self.settings.measurements
        if taken < self.first or taken >= budget:
            return taken if taken < self.first else None
        if taken >= self._next_search:
            self._bound_mm = self.smallest_mm(1e-3)
            self._next_search = taken + max(round(_STILL * budget), 1)
        distances = self._distances()
        beyond = distances.beyond(self._bound_mm)
        # Where every reading is inside, the one nearest to the bound is the worst.
        return self.ledger.visited[np.argmax(beyond if beyond.any() else distances.size_mm)]

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
            # The rejection probability of eqs. 18 and 19.
            rejection = 1.0 - float(np.prod(chdtrc(3, distances.beyond(middle) ** 2)))
            low, high = (middle, high) if rejection > self.settings.alpha else (low, middle)
        return high

    def _distances(self) -> BallDistances:
        visited = self.ledger.visited
        return BallDistances(self.ledger.mean_mm[visited], self.ledger.spread_mm2[visited])


@dataclass(frozen=True)
class InvalidationCalibrated(ModelInvalidationFull):
    """Visit points, challenge the worst of them, bound the largest error with a stated error rate.

    Eqs. 15-24 decide what is measured and give the value. Their threshold ``alpha`` is no error
    rate: one point at the bound among small ones is accepted half the time whatever alpha is, so no
    alpha turns the smallest bound not rejected into an upper bound. What can be calibrated is how
    far above a reading the true error may still be. A point is judged when it has 1, 2, 4, ...
    readings, at each by its mean size plus c standard deviations of the mean; the least favourable
    case is a point alone at the true maximum, where all that counts is the reading's component
    along the true error, a normal random walk free of every unknown. c is chosen by simulating that
    walk (:func:`kinacc.assess.limits.boundary`). Holds whatever decided which point was read again,
    without correction for the number of points. The calibration of the threshold is the future
    work the paper names. Assumes normal readings of known covariance.
    """

    name: ClassVar[str] = "invalidation_calibrated"

    def begin(self, candidates: Candidates) -> CalibratedCampaign:
        """Return a new campaign."""
        return CalibratedCampaign(self, candidates)


class CalibratedCampaign(ChallengeCampaign):
    """See :class:`InvalidationCalibrated`."""

    def __init__(self, settings: InvalidationCalibrated, candidates: Candidates) -> None:
        super().__init__(settings, candidates)
        error, number = 1.0 - settings.confidence, settings.measurements - self.first + 1
        counts = tuple(2**look for look in range(number.bit_length()))
        shares = _FIRST_LOOK * (1.0 - _FIRST_LOOK) ** np.arange(len(counts))
        limits = boundary(counts, error, late=None)
        self.looks = Looks(self.ledger, limits, error / self.first, shares, 1.0)

    def record(
        self, point: int, reading_mm: ArrayLike, covariance_mm2: ArrayLike | None = None
    ) -> None:
        """Take a reading."""
        self.ledger.record(point, reading_mm, covariance_mm2)
        self.looks.update(point)

    def statements(self) -> tuple[Statement, ...]:
        """The calibrated bounds; the value is the smallest bound not rejected."""
        if self.ledger.taken < self.first:
            early = Reason("first_visit", {"left": self.first - self.ledger.taken})
            return (Statement(MEASURED, withheld=early),)
        statement = Statement(
            MEASURED,
            value_mm=self.smallest_mm(),
            lower_mm=self.looks.largest_lower_mm(np.ones(self.ledger.candidates.points)),
            upper_mm=float(self.looks.upper_mm[self.ledger.visited].max()),
            confidence=self.settings.confidence,
        )
        return about_all_if_all_measured(statement, self.ledger)

"""Model Invalidation whose bound holds: error rate calibrated by simulation."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from kinacc.assess.adaptive import (
    FIRST_SHARE,
    AdaptiveAssessor,
    Candidates,
    about_all_if_all_measured,
)
from kinacc.assess.invalidation_full import ChallengeCampaign, check_invalidation
from kinacc.assess.looks import Looks, boundary
from kinacc.assess.statement import CONFIDENCE, MEASURED, Reason, Statement

_FIRST_LOOK = 0.6  # of a point's allowed lower error; every further look has half of what is left


@dataclass(frozen=True)
class InvalidationCalibrated(AdaptiveAssessor):
    """Visit points, challenge the worst of them, bound the largest error with a stated error rate.

    Eqs. 15-24 decide what is measured and give the value. Their threshold ``alpha`` is no error
    rate: one point at the bound among small ones is accepted half the time whatever alpha is, so no
    alpha turns the smallest bound not rejected into an upper bound. What can be calibrated is how
    far above a reading the true error may still be. A point is judged when it has 1, 2, 4, ...
    readings, at each by its mean size plus c standard deviations of the mean; the least favourable
    case is a point alone at the true maximum, where all that counts is the reading's component
    along the true error, a normal random walk free of every unknown. c is chosen by simulating that
    walk (:func:`kinacc.assess.looks.boundary`). Holds whatever decided which point was read again,
    without correction for the number of points. The calibration of the threshold is the future
    work the paper names. Assumes normal readings of known covariance.
    """

    measurements: int
    visited: float = FIRST_SHARE
    alpha: float = field(kw_only=True)
    confidence: float = CONFIDENCE
    name: ClassVar[str] = "invalidation_calibrated"

    def __post_init__(self) -> None:
        check_invalidation(self)

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

    def record(self, point: int, reading_mm, covariance_mm2=None) -> None:
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

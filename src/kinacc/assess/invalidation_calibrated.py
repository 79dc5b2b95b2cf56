"""Model Invalidation whose bound holds: error rate calibrated by simulation."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import ClassVar

import numpy as np

from kinacc.assess.adaptive import AdaptiveAssessor, Candidates
from kinacc.assess.boundary import Boundary
from kinacc.assess.challenges import ChallengeCampaign, invalidation_problems
from kinacc.assess.coverage import about_all_if_all_measured
from kinacc.assess.sequential_limits import Looks
from kinacc.assess.statement import CONFIDENCE, MEASURED, Reason, Statement
from kinacc.assess.visits import FIRST_SHARE
from kinacc.errors import refuse

SIMULATIONS = 200_000
_SEED = 20_200  # of the calibration; it is part of the method, not of a study
_FIRST_SHARES = (0.60, 0.16, 0.10, 0.06)  # of the looks at 1, 2, 4 and 8 readings; then halving
_SIMULATED_DEVIATIONS = 2.33  # the calibrated error rate is below the wanted one at 99 %


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
    walk until the probability of ever being too low is what the confidence allows. Holds whatever
    decided which point was read again, without correction for the number of points.

    Source: the calibration of the threshold is the future work the paper names; boundaries of
    repeated looks: Pocock, Biometrika 64 (1977) 191-199. Assumes normal readings of known
    covariance, the same for all readings of a point; where a reading came with another covariance,
    c is taken from the Bonferroni inequality, which is a little wider.
    """

    measurements: int
    visited: float = FIRST_SHARE
    alpha: float = field(kw_only=True)
    confidence: float = CONFIDENCE
    name: ClassVar[str] = "invalidation_calibrated"

    def __post_init__(self) -> None:
        refuse(invalidation_problems(self), f"{self.name} cannot work with these settings")

    def begin(self, candidates: Candidates) -> CalibratedCampaign:
        """A new campaign."""
        return CalibratedCampaign(self, candidates)


class CalibratedCampaign(ChallengeCampaign):
    """See :class:`InvalidationCalibrated`."""

    def __init__(self, settings: InvalidationCalibrated, candidates: Candidates) -> None:
        super().__init__(settings, candidates)
        allowed = 1.0 - settings.confidence
        number = (settings.measurements - self.first + 1).bit_length()
        shares = np.array([share(look) for look in range(number)])
        self._counts = 2 ** np.arange(number)
        self.looks = Looks(self.ledger, self._widths(True), allowed / self.first, shares, 1.0)

    def record(self, point: int, reading_mm, covariance_mm2=None) -> None:
        """Take a reading."""
        self.ledger.record(point, reading_mm, covariance_mm2)
        self.looks.update(point)

    def statements(self) -> tuple[Statement, ...]:
        """The calibrated bounds; the value is the smallest bound not rejected."""
        if self.ledger.taken < self.first:
            left = Reason("first_visit", {"left": self.first - self.ledger.taken})
            return (Statement(MEASURED, withheld=left),)
        visited = self.ledger.visited
        is_even = all(self.ledger.as_planned(point) for point in visited)
        factor = np.ones(self.ledger.candidates.points)
        upper_mm = self.looks.limits_mm(self._widths(is_even), factor)
        said = Statement(
            MEASURED,
            value_mm=self.smallest_mm(),
            lower_mm=self.looks.largest_lower_mm(factor),
            upper_mm=float(upper_mm[visited].max()),
            confidence=self.settings.confidence,
        )
        return about_all_if_all_measured(said, self.ledger)

    def _widths(self, is_even: bool) -> Boundary:
        """The same standard deviations at every look."""
        width = boundary(len(self._counts), 1.0 - self.settings.confidence, is_even)
        widths = np.full(len(self._counts), width)
        return Boundary(self._counts, widths, widths)


def share(look: int) -> float:
    """Part of a point's allowed error that its lower limit at a look (0 = first) may spend."""
    if look < len(_FIRST_SHARES):
        return _FIRST_SHARES[look]
    return 0.5 ** (look - len(_FIRST_SHARES) + 1) * (1.0 - sum(_FIRST_SHARES))


@lru_cache(maxsize=64)
def boundary(looks: int, error: float, is_even: bool = True) -> float:
    """Standard deviations that no mean of 1, 2, 4 .. 2^(looks-1) readings is too low by, but error.

    By simulation, on the safe side of its own uncertainty; with ``is_even`` false by the Bonferroni
    inequality, which holds whatever the covariances are.
    """
    from scipy.special import ndtri

    bonferroni = -float(ndtri(error / looks))
    if looks == 1 or not is_even:
        return bonferroni
    rng = np.random.default_rng(_SEED)
    total = rng.normal(size=SIMULATIONS)
    lowest = total.copy()
    for look in range(1, looks):
        total += np.sqrt(2.0 ** (look - 1)) * rng.normal(size=SIMULATIONS)
        np.minimum(lowest, total / np.sqrt(2.0**look), out=lowest)
    safe = error - _SIMULATED_DEVIATIONS * np.sqrt(error * (1.0 - error) / SIMULATIONS)
    return min(-float(np.quantile(lowest, safe)), bonferroni)

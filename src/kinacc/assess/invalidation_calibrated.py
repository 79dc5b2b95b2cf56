"""Model Invalidation whose bound holds: error rate calibrated by simulation."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import ClassVar

import numpy as np

from kinacc.assess.adaptive import AdaptiveAssessor, Candidates
from kinacc.assess.challenges import ChallengeCampaign, invalidation_problems
from kinacc.assess.coverage import about_all_if_all_measured
from kinacc.assess.ellipsoid import largest_size
from kinacc.assess.sequential_limits import Looks
from kinacc.assess.statement import CONFIDENCE, MEASURED, Reason, Statement
from kinacc.assess.visits import FIRST_SHARE
from kinacc.errors import refuse

SIMULATIONS = 200_000
_SEED = 20_200  # of the calibration; it is part of the method, not of a study
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
        most = settings.measurements - self.first + 1
        self.looks = Looks(self.ledger, (), allowed / self.first)
        self.number = most.bit_length()
        self._limits: list[list[tuple[np.ndarray, object]]] = [[] for _ in range(candidates.points)]
        self._is_even = True

    def record(self, point: int, reading_mm, covariance_mm2=None) -> None:
        """Take a reading."""
        self.ledger.record(point, reading_mm, covariance_mm2)
        self._is_even = self._is_even and covariance_mm2 is None
        if int(self.ledger.count[point]) == self.looks.due(point):
            seen = (self.ledger.mean_mm[point].copy(), self.ledger.noise(point))
            self._limits[point].append(seen)
        self.looks.update(point)

    def statements(self) -> tuple[Statement, ...]:
        """The calibrated bounds; the value is the smallest bound not rejected."""
        if self.ledger.taken < self.first:
            left = Reason("first_visit", {"left": self.first - self.ledger.taken})
            return (Statement(MEASURED, withheld=left),)
        error = 1.0 - self.settings.confidence
        width = boundary(self.number, error, self._is_even)
        visited = self.ledger.visited
        said = Statement(
            MEASURED,
            value_mm=self.smallest_mm(),
            lower_mm=float(self.looks.lower_mm[visited].max()),
            upper_mm=max(min(_limit(*seen, width) for seen in self._limits[p]) for p in visited),
            confidence=self.settings.confidence,
        )
        return about_all_if_all_measured(said, self.ledger)


def _limit(mean_mm: np.ndarray, noise, width: float) -> float:
    if isinstance(noise, float):
        return float(np.sqrt(mean_mm @ mean_mm)) + width * noise
    return largest_size(mean_mm, noise, width)


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

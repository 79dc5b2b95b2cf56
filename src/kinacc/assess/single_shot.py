"""Exact single-shot bound: measure points once; the largest reading bounds the largest error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinacc.assess.adaptive import (
    AdaptiveAssessor,
    Candidates,
    Ledger,
    OnceCampaign,
    about_all_if_all_measured,
    check_budget,
)
from kinacc.assess.limits import lower_limit_mm, upper_limit_mm
from kinacc.assess.statement import CONFIDENCE, MEASURED, Reason, Statement
from kinacc.errors import refuse


@dataclass(frozen=True)
class SingleShot(AdaptiveAssessor):
    """Measure each point once, up to ``measurements`` points.

    Upper bound: the smallest size such that one reading at a point of that size exceeds what was
    read there with the wanted confidence, largest over the points. It holds with that confidence
    without correction for the number of points, for it is wrong only if the reading at the one
    point that is truly largest is too small. Lower bound: the same turned round, corrected for
    the number of points. Assumes normal readings of known covariance (eq. 9), nothing else. It
    speaks of the points measured; where these are all candidates, of all candidates.
    """

    measurements: int
    confidence: float = CONFIDENCE
    name: ClassVar[str] = "single_shot"

    def __post_init__(self) -> None:
        refuse(
            check_budget(self.measurements, self.confidence),
            f"{self.name} cannot work with these settings",
        )

    def begin(self, candidates: Candidates) -> SingleShotCampaign:
        """A new campaign."""
        return SingleShotCampaign(self, candidates)


class SingleShotCampaign(OnceCampaign):
    """See :class:`SingleShot`."""

    settings: SingleShot

    def statements(self) -> tuple[Statement, ...]:
        """The bound, with the largest reading as the value."""
        ledger = self.ledger
        if not ledger.visited:
            return (Statement(MEASURED, withheld=Reason("nothing_measured")),)
        error = 1.0 - self.settings.confidence
        each = error / self.first
        means = _outstanding(ledger)
        said = Statement(
            MEASURED,
            value_mm=float(ledger.sizes_mm().max()),
            lower_mm=max(lower_limit_mm(mean, noise, each) for mean, noise in means),
            upper_mm=max(upper_limit_mm(mean, noise, error) for mean, noise in means),
            confidence=self.settings.confidence,
        )
        return about_all_if_all_measured(said, ledger)


def _outstanding(ledger: Ledger) -> list[tuple[np.ndarray, float | np.ndarray]]:
    """Means with their noise, of points with equal noise only the largest: limits rise with it."""
    largest: dict[float, tuple[float, int]] = {}
    uneven = []
    for point, size in zip(ledger.visited, ledger.sizes_mm(), strict=True):
        noise = ledger.noise(point)
        if not isinstance(noise, float):
            uneven.append((ledger.mean_mm[point], noise))
        elif noise not in largest or size > largest[noise][0]:
            largest[noise] = (size, point)
    return uneven + [(ledger.mean_mm[point], noise) for noise, (_, point) in largest.items()]

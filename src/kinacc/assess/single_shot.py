"""Exact single-shot bound: measure points once; the largest reading bounds the largest error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kinacc.assess.adaptive import (
    AdaptiveAssessor,
    Candidates,
    OnceCampaign,
    about_all_if_all_measured,
    check_budget,
)
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
        visited, error = self.ledger.visited, 1.0 - self.settings.confidence
        if not visited:
            return (Statement(MEASURED, withheld=Reason("nothing_measured")),)
        limits = self._mean_limits(visited, error / self.first).values()
        said = Statement(
            MEASURED,
            value_mm=float(self.ledger.sizes_mm().max()),
            lower_mm=max(lower for lower, _ in limits),
            upper_mm=max(upper for _, upper in limits),
            confidence=self.settings.confidence,
        )
        return about_all_if_all_measured(said, self.ledger)

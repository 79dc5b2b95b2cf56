"""Model Invalidation where the noise differs by direction and point: full covariances."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from kinacc.assess.adaptive import AdaptiveAssessor, Candidates
from kinacc.assess.challenges import ChallengeCampaign, invalidation_problems
from kinacc.assess.statement import CONFIDENCE
from kinacc.assess.visits import FIRST_SHARE
from kinacc.errors import Problem, refuse


@dataclass(frozen=True)
class ModelInvalidationFull(AdaptiveAssessor):
    """Eqs. 15-24 with the least-Mahalanobis point of the ball in place of eq. 21.

    Eq. 21 scales a reading back to the ball along its own direction, which is the nearest point
    only where the noise is equal in all directions; with other noise it rejects true models too
    often. Here the candidate minimises the Mahalanobis distance (:mod:`kinacc.assess.ellipsoid`).
    A share ``visited`` of the budget goes to new points; the rest to the worst point (eq. 23) at
    the smallest bound not rejected so far, or at ``bound_mm`` where that is given. The value is the
    smallest bound the readings do not reject. Assumes normal readings of known covariance. No
    confidence: ``alpha`` is a threshold on a product of p-values, not an error rate.
    """

    measurements: int
    visited: float = FIRST_SHARE
    alpha: float = field(kw_only=True)
    bound_mm: float | None = None
    name: ClassVar[str] = "model_invalidation_full"
    confidence: ClassVar[float] = CONFIDENCE  # of limits on single points; its statement has none

    def __post_init__(self) -> None:
        problems = invalidation_problems(self)
        if self.bound_mm is not None and not self.bound_mm > 0.0:
            problems.append(Problem("bound_mm", f"{self.bound_mm}", "above 0, in mm"))
        refuse(problems, f"{self.name} cannot work with these settings")

    def begin(self, candidates: Candidates) -> ChallengeCampaign:
        """A new campaign."""
        return ChallengeCampaign(self, candidates, self.bound_mm)

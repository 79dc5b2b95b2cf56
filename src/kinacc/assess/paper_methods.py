"""The paper's assessors behind the adaptive interface, themselves unchanged.

Maximum Measurement and Outlier Rejection visit every point once. Model Invalidation is a procedure
at one bound that is chosen beforehand: live, that bound is a setting. Searching the smallest bound
that is not rejected replays many campaigns on readings nobody would have taken, so it exists in
simulation only (``ModelInvalidation.assess``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinacc.assess.adaptive import Candidates, LedgerCampaign
from kinacc.assess.assessor import Assessor, check
from kinacc.assess.model_invalidation import mahalanobis_excess, point_probability
from kinacc.assess.single_pass import OnceCampaign
from kinacc.assess.statement import CANDIDATES, MEASURED, Statement
from kinacc.assess.world import measured_world
from kinacc.errors import InputError, Problem


@dataclass(frozen=True)
class OncePerPoint:
    """An assessor that reads every point once, as a campaign. It states no bounds."""

    assessor: Assessor

    @property
    def name(self) -> str:
        """Name of the assessor."""
        return self.assessor.name

    @property
    def measurements(self) -> int:
        """Budget of the assessor."""
        return self.assessor.measurements

    def begin(self, candidates: Candidates) -> OncePerPointCampaign:
        """A new campaign."""
        return OncePerPointCampaign(self.assessor, candidates)


class OncePerPointCampaign(OnceCampaign):
    """See :class:`OncePerPoint`."""

    settings: Assessor

    def statements(self) -> tuple[Statement, ...]:
        """The assessed accuracy of the points read."""
        visited = self.ledger.visited
        if not visited:
            return (Statement(CANDIDATES, withheld="nothing measured yet"),)
        readings = self.ledger.mean_mm[visited]
        world = measured_world(readings, readings[:, None], self.ledger.noise_mm[visited])
        return (Statement(CANDIDATES, self.settings.assess(world).assessed_mm),)


@dataclass(frozen=True)
class InvalidationAt:
    """Model Invalidation (eqs. 15-24) at one bound: measure until it is rejected or all is seen.

    The value is the smallest bound the readings taken do not reject. ``alpha`` is a threshold, not
    an error rate, so no confidence is stated.
    """

    bound_mm: float
    measurements: int = 200
    alpha: float = 0.6
    distance: str = "squared"
    covariance: str = "r"
    name: ClassVar[str] = "model_invalidation"
    switches: ClassVar[dict[str, tuple[str, ...]]] = {
        "distance": ("squared", "as_printed"),
        "covariance": ("r", "sqrt_r"),
    }

    def __post_init__(self) -> None:
        wrong = []
        if not self.bound_mm > 0.0:
            wrong.append(Problem("bound_mm", f"{self.bound_mm}", "above 0, in mm"))
        if not 0.0 < self.alpha < 1.0:
            wrong.append(Problem("alpha", f"{self.alpha}", "above 0 and below 1"))
        check(self, wrong)

    def begin(self, candidates: Candidates) -> InvalidationCampaign:
        """A new campaign; the noise must be equal in the three axes."""
        if not candidates.is_equal_noise.all():
            raise InputError(
                Problem(
                    "covariance",
                    "differs by direction",
                    "equal noise in the three axes",
                    "use model_invalidation_full",
                )
            )
        return InvalidationCampaign(self, candidates)


class InvalidationCampaign(LedgerCampaign):
    """See :class:`InvalidationAt`."""

    def __init__(self, settings: InvalidationAt, candidates: Candidates) -> None:
        super().__init__(settings, candidates)

    def next(self) -> int | None:
        """The worst point while the rejection probability exceeds alpha, else a new one."""
        if self.ledger.taken >= self.settings.measurements:
            return None
        excess = self._excess(self.settings.bound_mm)
        if self._rejection(excess) > self.settings.alpha:
            return self.ledger.visited[int(np.argmax(excess))]
        visited = len(self.ledger.visited)
        return visited if visited < self.ledger.count.size else None

    def statements(self) -> tuple[Statement, ...]:
        """The smallest bound that the readings do not reject."""
        if not self.ledger.visited:
            return (Statement(MEASURED, withheld="nothing measured yet"),)
        low, high = 0.0, float(self.ledger.sizes_mm().max())
        while high - low > 1e-6 * high:
            middle = 0.5 * (low + high)
            if self._rejection(self._excess(middle)) > self.settings.alpha:
                low = middle
            else:
                high = middle
        return (Statement(MEASURED, high),)

    def _excess(self, bound_mm: float) -> list[float]:
        ledger, kind = self.ledger, self.settings.covariance
        sigma = ledger.candidates.sigma_mm
        return [
            mahalanobis_excess(size, bound_mm, sigma[point], int(ledger.count[point]), kind)
            for point, size in zip(ledger.visited, ledger.sizes_mm().tolist(), strict=True)
        ]

    def _rejection(self, excess: list[float]) -> float:
        kind = self.settings.distance
        return 1.0 - math.prod(1.0 - point_probability(each, kind) for each in excess)

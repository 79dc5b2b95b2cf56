"""Which points are visited before anything is known of them: the first ones, in order."""

from __future__ import annotations

import math

from kinacc.assess.adaptive import Candidates, LedgerCampaign

FIRST_SHARE = 0.6  # of the budget or the candidates, visited before anything is said


def first_points(measurements: int, points: int, share: float) -> int:
    """How many points are visited before anything is known: all if the budget is 1.5 times them."""
    if measurements >= 1.5 * points:
        return points
    return max(math.ceil(share * min(measurements, points)), 1)


class OnceCampaign(LedgerCampaign):
    """One reading each of the first points; what is stated is left to the assessor."""

    def __init__(self, settings, candidates: Candidates) -> None:
        super().__init__(settings, candidates)
        self.first = min(settings.measurements, candidates.points)

    def next(self) -> int | None:
        """The next point in order."""
        return self.ledger.taken if self.ledger.taken < self.first else None

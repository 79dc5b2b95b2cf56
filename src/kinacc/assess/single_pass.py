"""Campaigns that read every point once, in order, up to the budget."""

from __future__ import annotations

from kinacc.assess.adaptive import Candidates, LedgerCampaign


class OnceCampaign(LedgerCampaign):
    """One reading each of the first points; what is stated is left to the assessor."""

    def __init__(self, settings, candidates: Candidates) -> None:
        super().__init__(settings, candidates)
        self.first = min(settings.measurements, candidates.points)

    def next(self) -> int | None:
        """The next point in order."""
        return self.ledger.taken if self.ledger.taken < self.first else None

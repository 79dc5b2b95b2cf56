"""Campaigns that read every point once, in order, up to the budget."""

from __future__ import annotations

from kinacc.assess.adaptive import Candidates, Ledger


class OnceCampaign:
    """One reading each of the first points; what is stated is left to the assessor."""

    def __init__(self, settings, candidates: Candidates) -> None:
        self.settings = settings
        self.ledger = Ledger(candidates)
        self.points = min(settings.measurements, candidates.points)

    def next(self) -> int | None:
        """The next point in order."""
        return self.ledger.taken if self.ledger.taken < self.points else None

    def record(self, point: int, reading_mm, covariance_mm2=None) -> None:
        """Take a reading."""
        self.ledger.record(point, reading_mm, covariance_mm2)

    def taken(self) -> tuple[int, list[int]]:
        """Number of readings, and the rows read."""
        return self.ledger.taken, self.ledger.visited

"""Anytime-valid bound: measure again wherever the upper limit is largest, stop when it is tight."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinacc.assess.adaptive import (
    FIRST_SHARE,
    AdaptiveAssessor,
    Candidates,
    Ledger,
    about_all_if_all_measured,
    check_budget,
    first_points,
)
from kinacc.assess.confirming import ConfirmingCampaign
from kinacc.assess.statement import CONFIDENCE, MEASURED, Reason, Statement
from kinacc.errors import Problem, refuse


@dataclass(frozen=True)
class Sequential(AdaptiveAssessor):
    """Visit a fixed number of points, then read again where the upper limit is largest.

    ``visited`` is the share of the budget spent on visiting points (all candidates where the budget
    allows one and a half times as many). Bounds and the choice of what is read again are those of
    :mod:`kinacc.assess.confirming`: each limit holds at all times at once, so the bounds hold at
    whatever moment the campaign is stopped, at the end of the budget or as soon as upper and lower
    bound are within ``width_mm`` of each other (null: never early). Assumes normal readings of
    known covariance (eq. 9).
    """

    measurements: int
    visited: float = FIRST_SHARE
    width_mm: float | None = None
    confidence: float = CONFIDENCE
    name: ClassVar[str] = "sequential"

    def __post_init__(self) -> None:
        problems = check_budget(self.measurements, self.confidence)
        if not 0.0 < self.visited <= 1.0:
            problems.append(Problem("visited", f"{self.visited}", "above 0 and at most 1"))
        if self.width_mm is not None and not self.width_mm > 0.0:
            problems.append(Problem("width_mm", f"{self.width_mm}", "above 0, in mm"))
        refuse(problems, f"{self.name} cannot work with these settings")

    def begin(self, candidates: Candidates) -> SequentialCampaign:
        """A new campaign."""
        return SequentialCampaign(self, candidates)


class SequentialCampaign(ConfirmingCampaign):
    """See :class:`Sequential`."""

    settings: Sequential

    def __init__(self, settings: Sequential, candidates: Candidates) -> None:
        first = first_points(settings.measurements, candidates.points, settings.visited)
        super().__init__(settings, candidates, first)

    def next(self) -> int | None:
        """As in every campaign that confirms, until the bounds are near enough."""
        return None if self._is_tight() else super().next()

    def statements(self) -> tuple[Statement, ...]:
        """The bounds as they stand."""
        if self.ledger.taken < self.first:
            left = Reason("first_visit", {"left": self.first - self.ledger.taken})
            return (Statement(MEASURED, withheld=left),)
        said = Statement(
            MEASURED,
            value_mm=corrected_largest_mm(self.ledger),
            lower_mm=self._lower_mm(),
            upper_mm=self._upper_mm(),
            confidence=self.settings.confidence,
        )
        return about_all_if_all_measured(said, self.ledger)

    def point_limits(self) -> dict[int, tuple[float, float]]:
        """The limits that hold at every look."""
        lower, upper = self.looks.lower_limits_mm(self._as_stated()), self.looks.upper_mm
        return {row: (float(lower[row]), float(upper[row])) for row in self.ledger.visited}

    def _upper_mm(self) -> float:
        return float(self.looks.upper_mm[self.ledger.visited].max())

    def _lower_mm(self) -> float:
        factor = self._as_stated()
        if self.average.has_spoken:
            return self.average.bound_mm(factor)
        return self.looks.largest_lower_mm(factor)

    def _as_stated(self) -> np.ndarray:
        return np.ones(self.ledger.candidates.points)

    def _is_tight(self) -> bool:
        if self.settings.width_mm is None or self.ledger.taken < self.first:
            return False
        return self._upper_mm() - self._lower_mm() <= self.settings.width_mm


def corrected_largest_mm(ledger: Ledger) -> float:
    """Largest mean reading with at least two readings, less what noise adds to it on average."""
    visited = np.array(ledger.visited)
    again = visited[ledger.count[visited] > 1]
    chosen = again if again.size else visited
    square = np.sum(ledger.mean_mm[chosen] ** 2, axis=1) - 3.0 * ledger.noise_mm[chosen] ** 2
    return math.sqrt(max(float(square.max()), 0.0))

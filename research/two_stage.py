"""Two stages: screen points once, re-measure the largest, forget what screening read of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinacc.assess.adaptive import (
    AdaptiveAssessor,
    Campaign,
    Candidates,
    about_all_if_all_measured,
    check_budget,
)
from kinacc.assess.limits import lower_limit_mm, upper_limit_mm
from kinacc.assess.statement import CONFIDENCE, MEASURED, Reason, Statement
from kinacc.errors import Problem, refuse

SCREENING_PART = 0.3  # of the allowed error, spent on points that are not re-measured


@dataclass(frozen=True)
class TwoStage(AdaptiveAssessor):
    """Screen ``screened`` of the budget's points, spend the rest evenly on the largest readings.

    Every suspect is read ``repeats`` times more and judged by these readings alone, so that having
    been chosen for a large reading does not count against it. The bound is the larger of two: of
    the points not chosen, from their screening readings, and of the suspects, from their new
    readings. The point that is truly largest is one or the other, so the two errors add up to at
    most one less the confidence. Assumes normal readings of known covariance (eq. 9).
    """

    measurements: int
    screened: float = 0.6
    repeats: int = 4
    confidence: float = CONFIDENCE
    name: ClassVar[str] = "two_stage"

    def __post_init__(self) -> None:
        problems = check_budget(self.measurements, self.confidence)
        if not 0.0 < self.screened < 1.0:
            problems.append(Problem("screened", f"{self.screened}", "above 0 and below 1"))
        if self.repeats < 1:
            problems.append(Problem("repeats", f"{self.repeats}", "at least 1"))
        if not problems and self.measurements < 1 + self.repeats:
            what = f"{self.measurements} do not cover one point and its {self.repeats} repeats"
            problems.append(Problem("measurements", what, f"at least {1 + self.repeats}"))
        refuse(problems, f"{self.name} cannot work with these settings")

    def begin(self, candidates: Candidates) -> TwoStageCampaign:
        """A new campaign."""
        return TwoStageCampaign(self, candidates)


class TwoStageCampaign(Campaign):
    """See :class:`TwoStage`. ``again``: the suspects that have new readings."""

    settings: TwoStage

    def __init__(self, settings: TwoStage, candidates: Candidates) -> None:
        super().__init__(settings, candidates)
        wanted = math.ceil(settings.screened * settings.measurements)
        self.first = min(wanted, settings.measurements - settings.repeats, candidates.points)
        self.suspects: list[int] = []
        self.again: list[int] = []

    def next(self) -> int | None:
        """Points in order, then the suspects in turn."""
        taken = self.ledger.taken
        if taken < self.first:
            return taken
        if taken >= self._planned():
            return None
        return self.suspects[(taken - self.first) % len(self.suspects)]

    def record(self, point: int, reading_mm, covariance_mm2=None) -> None:
        """Take a reading; the first new one of a suspect replaces what screening read there."""
        is_new = bool(self.suspects) and point not in self.again
        self.ledger.record(point, reading_mm, covariance_mm2, afresh=is_new)
        if is_new:
            self.again.append(point)
        elif self.ledger.taken == self.first:
            left = self.settings.measurements - self.first
            count = min(max(left // self.settings.repeats, 1), len(self.ledger.visited))
            order = np.argsort(-self.ledger.sizes_mm(), kind="stable")
            self.suspects = [self.ledger.visited[i] for i in order[:count]]

    def statements(self) -> tuple[Statement, ...]:
        """The bound once every suspect was read again; before, none."""
        if not self.suspects or len(self.again) < len(self.suspects):
            return (Statement(MEASURED, withheld=Reason("suspects")),)
        allowed = 1.0 - self.settings.confidence
        passed = [p for p in self.ledger.visited if p not in set(self.suspects)]
        spent = SCREENING_PART * allowed if passed else 0.0
        upper = [self._limit(upper_limit_mm, point, spent) for point in passed]
        upper += [self._limit(upper_limit_mm, point, allowed - spent) for point in self.suspects]
        each = allowed / len(self.suspects)
        said = Statement(
            MEASURED,
            value_mm=self._value(),
            lower_mm=max(self._limit(lower_limit_mm, point, each) for point in self.suspects),
            upper_mm=max(upper),
            confidence=self.settings.confidence,
        )
        return about_all_if_all_measured(said, self.ledger)

    def point_limits(self) -> dict[int, tuple[float, float]]:
        """Limits of the mean readings of a point's own stage."""
        allowed, visited = 1.0 - self.settings.confidence, self.ledger.visited
        screened = self._mean_limits(visited, allowed / max(len(visited), 1))
        return screened | self._mean_limits(self.again, allowed / max(len(self.again), 1))

    def _planned(self) -> int:
        """Measurements of both stages: whole rounds over the suspects only."""
        left = self.settings.measurements - self.first
        return self.first + left // len(self.suspects) * len(self.suspects)

    def _value(self) -> float:
        """Largest re-read size, less what the noise adds to it on average."""
        square = np.sum(self.ledger.mean_mm[self.suspects] ** 2, axis=1)
        square -= 3.0 * self.ledger.noise_mm[self.suspects] ** 2
        return math.sqrt(max(float(square.max()), 0.0))

    def _limit(self, limit_mm: Callable[..., float], point: int, error: float) -> float:
        return limit_mm(self.ledger.mean_mm[point], self.ledger.noise(point), error)

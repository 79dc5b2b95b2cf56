"""Two stages: screen points once, re-measure the largest, forget what screening read of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinacc.assess.adaptive import Candidates, Ledger, check_budget
from kinacc.assess.limits import lower_limit_mm, upper_limit_mm
from kinacc.assess.single_shot import about_all_if_all_measured
from kinacc.assess.statement import MEASURED, Statement
from kinacc.errors import InputError, Problem

SCREENING_PART = 0.3  # of the allowed error, spent on points that are not re-measured


@dataclass(frozen=True)
class TwoStage:
    """Screen ``screened`` of the budget's points, spend the rest evenly on the largest readings.

    Every suspect is read ``repeats`` times more and judged by these readings alone, so that having
    been chosen for a large reading does not count against it. The bound is the larger of two: of
    the points not chosen, from their screening readings, and of the suspects, from their new
    readings. The point that is truly largest is one or the other, so the two errors add up to at
    most one less the confidence. Assumes normal readings of known covariance (eq. 9).
    """

    measurements: int = 200
    screened: float = 0.6
    repeats: int = 4
    confidence: float = 0.95
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
        if problems:
            raise InputError(problems, f"{self.name} cannot work with these settings")

    def begin(self, candidates: Candidates) -> TwoStageCampaign:
        """A new campaign."""
        return TwoStageCampaign(self, candidates)


class TwoStageCampaign:
    """See :class:`TwoStage`."""

    def __init__(self, settings: TwoStage, candidates: Candidates) -> None:
        self.settings = settings
        self.screen = Ledger(candidates)
        self.again: Ledger | None = None
        wanted = math.ceil(settings.screened * settings.measurements)
        self.first = min(wanted, settings.measurements - settings.repeats, candidates.points)
        self.suspects: list[int] = []

    def next(self) -> int | None:
        """Points in order, then the suspects in turn."""
        if self.screen.taken < self.first:
            return self.screen.taken
        if self.screen.taken + self.again.taken >= self._planned():
            return None
        return self.suspects[self.again.taken % len(self.suspects)]

    def record(self, point: int, reading_mm, covariance_mm2=None) -> None:
        """Take a reading."""
        if self.again is not None:
            self.again.record(point, reading_mm, covariance_mm2)
            return
        self.screen.record(point, reading_mm, covariance_mm2)
        if self.screen.taken == self.first:
            left = self.settings.measurements - self.first
            count = min(max(left // self.settings.repeats, 1), len(self.screen.visited))
            order = np.argsort(-self.screen.sizes_mm(), kind="stable")
            self.suspects = [self.screen.visited[i] for i in order[:count]]
            self.again = Ledger(self.screen.candidates)

    def taken(self) -> tuple[int, list[int]]:
        """Number of readings of both stages, and the rows read."""
        again = self.again.taken if self.again is not None else 0
        return self.screen.taken + again, self.screen.visited

    def statements(self) -> tuple[Statement, ...]:
        """The bound once every suspect was read again; before, none."""
        if self.again is None or len(self.again.visited) < len(self.suspects):
            return (Statement(MEASURED, withheld="the suspects are not all measured again yet"),)
        allowed = 1.0 - self.settings.confidence
        passed = [p for p in self.screen.visited if p not in set(self.suspects)]
        spent = SCREENING_PART * allowed if passed else 0.0
        upper = [self._upper(self.screen, point, spent) for point in passed]
        upper += [self._upper(self.again, point, allowed - spent) for point in self.suspects]
        each = allowed / len(self.suspects)
        lower = [
            lower_limit_mm(self.again.mean_mm[p], self.again.noise(p), each) for p in self.suspects
        ]
        said = Statement(
            MEASURED,
            value_mm=self._value(),
            lower_mm=max(lower),
            upper_mm=max(upper),
            confidence=self.settings.confidence,
        )
        return about_all_if_all_measured(said, self.screen)

    def _planned(self) -> int:
        """Measurements of both stages: whole rounds over the suspects only."""
        left = self.settings.measurements - self.first
        return self.first + left // len(self.suspects) * len(self.suspects)

    def _value(self) -> float:
        """Largest re-read size, less what the noise adds to it on average."""
        square = np.sum(self.again.mean_mm[self.suspects] ** 2, axis=1)
        square -= 3.0 * self.again.noise_mm[self.suspects] ** 2
        return math.sqrt(max(float(square.max()), 0.0))

    @staticmethod
    def _upper(ledger: Ledger, point: int, error: float) -> float:
        return upper_limit_mm(ledger.mean_mm[point], ledger.noise(point), error)

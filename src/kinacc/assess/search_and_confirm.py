"""The recommended assessor: look for large errors at new points, confirm the suspects, say both."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from kinacc.assess.adaptive import AdaptiveAssessor, Candidates, check_budget
from kinacc.assess.coverage import (
    CROWD,
    ISOLATION,
    MISSING_PART,
    at_most,
    companions,
    hardly_missed,
    records,
)
from kinacc.assess.population import LargestSize, largest_size
from kinacc.assess.sequential_limits import Looks, LooksCampaign
from kinacc.assess.statement import CANDIDATES, CONFIDENCE, MEASURED, Reason, Statement
from kinacc.assess.visits import FIRST_SHARE, first_points
from kinacc.errors import Problem, refuse

_ALONE = 0.1  # chance of so little company below which the assumption counts as broken
_RESERVE = 0.04  # of the budget, kept for confirming whatever is found last
_RECONSIDER = 0.06  # of the budget, between two estimates of the likely largest size


@dataclass(frozen=True)
class SearchAndConfirm(AdaptiveAssessor):
    """Visit candidates until none can be missed, or as many as suspects allow; then confirm those.

    With a budget for it, so many candidates are visited that the largest error is missed with
    2 % at most (196 of 200), whatever is read; the rest of the budget goes to suspects. With
    fewer measurements, the visit goes on while the readings left cover reading every suspect as
    often again as it was, and 4 % of the budget: little noise or one outstanding error lead to
    many points, much noise to fewer. A suspect is a point whose mean reading plus one standard
    deviation exceeds the likely largest size; the point with the largest upper limit is measured
    until its next look.

    ``measured``: the bounds of :mod:`kinacc.assess.sequential_limits`. They hold whatever the
    errors are, for readings that are normal with known covariance (eq. 9) and points in random
    order. Where readings decide the number of points, the allowed error is divided by 1 + the
    expected number of largest-so-far points among those that come after the ones visited in any
    case. Stated from 60 % of the visit on; who ends it early must do so for other reasons than the
    readings. ``candidates``: without an assumption where 2 % at most can have missed the largest.
    Otherwise the bound for the measured points times ``isolation``: it holds if the largest error
    is not isolated, at least so many candidates (stated in the assumption) having an error above
    the largest divided by ``isolation`` that missing them all is improbable. Withheld where that
    number is more than ``crowd`` of the candidates, and where the largest error measured stands so
    far above all others that the assumption is broken by what was seen. The value is the median of
    the posterior of :mod:`kinacc.assess.population`.
    """

    measurements: int
    confidence: float = CONFIDENCE
    isolation: float = ISOLATION
    crowd: float = CROWD
    name: ClassVar[str] = "search_and_confirm"

    def __post_init__(self) -> None:
        problems = check_budget(self.measurements, self.confidence)
        if not self.isolation > 1.0:
            problems.append(Problem("isolation", f"{self.isolation}", "above 1"))
        if not 0.0 < self.crowd < 1.0:
            problems.append(Problem("crowd", f"{self.crowd}", "above 0 and below 1"))
        refuse(problems, f"{self.name} cannot work with these settings")

    def enough_for_all(self, points: int) -> int:
        """Measurements with which the statement on all ``points`` candidates assumes nothing."""
        return hardly_missed(points, MISSING_PART * (1.0 - self.confidence))

    def shortfall(self, points: int, joints: int) -> Reason | None:
        """What a larger budget would be good for with so many candidates; None if nothing."""
        if self.measurements >= (enough := self.enough_for_all(points)):
            return None
        error, most = MISSING_PART * (1.0 - self.confidence), max(1.0, self.crowd * points)
        if companions(points, min(self.measurements, points), error) > most:
            visits = range(self.measurements, points + 1)
            needed = next(seen for seen in visits if companions(points, seen, error) <= most)
            return Reason("no_bound_on_all", {"needed": needed})
        return Reason("assumption_ahead", {"enough": enough})

    def begin(self, candidates: Candidates) -> SearchAndConfirmCampaign:
        """A new campaign."""
        return SearchAndConfirmCampaign(self, candidates)


class SearchAndConfirmCampaign(LooksCampaign):
    """See :class:`SearchAndConfirm`."""

    def __init__(self, settings: SearchAndConfirm, candidates: Candidates) -> None:
        super().__init__(settings, candidates)
        budget, points = settings.measurements, candidates.points
        allowed = 1.0 - settings.confidence
        self.first = self._speaks_from = first_points(budget, points, FIRST_SHARE)
        if (nearly_all := settings.enough_for_all(points)) <= budget:
            self.first = max(self.first, nearly_all)
        self.most = min(budget, points)
        chosen = records(self.first, self.most)
        errors = (allowed / chosen, (1.0 - MISSING_PART) * allowed / chosen)
        self.looks = Looks(self.ledger, errors, allowed / self.most)
        self._pause = max(round(_RECONSIDER * budget), 2)
        self._likely_mm, self._asked_at = math.nan, -self._pause

    def next(self) -> int | None:
        """A new point or the suspect to confirm."""
        taken, visited = self.ledger.taken, len(self.ledger.visited)
        left = self.settings.measurements - taken
        if left <= 0:
            return None
        if visited < self.first or (visited < self.most and self._wanted_by_suspects() < left):
            return visited
        return self.looks.bounding_point(left)

    def statements(self) -> tuple[Statement, ...]:
        """On the measured points, and on all candidates."""
        ledger, looks = self.ledger, self.looks
        visited = ledger.visited
        if len(visited) < self._speaks_from:
            left = Reason("first_visit", {"left": self._speaks_from - len(visited)})
            return Statement(MEASURED, withheld=left), Statement(CANDIDATES, withheld=left)
        posterior = self._posterior()
        value_mm = posterior.quantile_mm(0.5, measured_only=True)
        said = Statement(
            MEASURED,
            value_mm=value_mm,
            lower_mm=float(looks.lower_mm[visited].max()),
            # Where unlucky readings put the bound below the likely size, that is the better bound.
            upper_mm=max(float(looks.upper_mm[0, visited].max()), value_mm),
            confidence=self.settings.confidence,
        )
        return said, self._about_candidates(said, posterior.quantile_mm(0.5))

    def _about_candidates(self, said: Statement, value_mm: float) -> Statement:
        points, seen = self.ledger.candidates.points, len(self.ledger.visited)
        allowed = 1.0 - self.settings.confidence
        known = replace(said, target=CANDIDATES, value_mm=value_mm)
        # Visiting all only where the readings say so is no certainty: they may say so where the
        # largest error was met and not where it was missed, and what was allowed is then spent.
        if seen == self.first == points:
            return known
        crowd = companions(points, seen, MISSING_PART * allowed)
        beyond_mm = max(float(self.looks.upper_mm[1, self.ledger.visited].max()), value_mm)
        if crowd == 1:
            return replace(known, upper_mm=beyond_mm)
        factor = self.settings.isolation
        assumption = Reason("crowd", {"crowd": crowd, "points": points, "isolation": factor})
        resting = replace(known, upper_mm=factor * beyond_mm, assumption=assumption)
        withheld = None
        if crowd > self.settings.crowd * points:
            withheld = Reason("all_missed", {"seen": seen, "points": points, "crowd": crowd})
        elif self._stands_alone(crowd, said.lower_mm):
            withheld = Reason("stands_alone", {"isolation": factor})
        return replace(resting, upper_mm=math.nan, withheld=withheld) if withheld else resting

    def _stands_alone(self, crowd: int, lower_mm: float) -> bool:
        """Whether hardly any measured error can be as large as the assumption says many are."""
        visited = self.ledger.visited
        upper = self.looks.upper_mm[0, visited]
        company = int(np.sum(upper >= lower_mm / self.settings.isolation))
        points = self.ledger.candidates.points
        return at_most(company, crowd, points, len(visited)) < _ALONE

    def _wanted_by_suspects(self) -> float:
        if self.ledger.taken - self._asked_at >= self._pause:
            self._likely_mm = self._posterior().quantile_mm(0.5, measured_only=True)
            self._asked_at = self.ledger.taken
        visited = self.ledger.visited
        reach = self.ledger.sizes_mm() + self.ledger.noise_mm[visited]
        readings = int(self.ledger.count[visited][reach > self._likely_mm].sum())
        return readings + _RESERVE * self.settings.measurements

    def _posterior(self) -> LargestSize:
        visited = self.ledger.visited
        unmeasured = self.ledger.candidates.points - len(visited)
        return largest_size(self.ledger.sizes_mm(), self.ledger.noise_mm[visited], unmeasured)

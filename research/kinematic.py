"""Kinematic Gaussian process: what single joints explain, and who could be the largest."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from kinacc.assess.adaptive import (
    FIRST_SHARE,
    AdaptiveAssessor,
    Campaign,
    Candidates,
    check_budget,
    first_points,
)
from kinacc.assess.counts import companions
from kinacc.assess.statement import CANDIDATES, CONFIDENCE, MEASURED, Reason, Statement
from kinacc.errors import Problem, refuse
from research.kinematic_model import (
    Basis,
    Posterior,
    Scales,
    fitted_scales,
    largest_draws,
    points_needed,
    posterior,
)

MISSING_PART = 0.4  # of the error of the statement on all candidates, spent on unmeasured ones
_DRAWS = 400
_BATCH = 0.08  # of the budget: readings between two looks at who could be the largest
_DOUBTED = 0.25  # of a batch, spent on the readings the model explains worst
_CONTRADICTED = 0.01  # chance of the worst reading under the model, all points considered
_EXPLAINED = 0.5  # least share of the mean square error that joints have to explain

ISOLATION, CROWD = 1.25, 0.05  # assumed of the largest error's company


@dataclass(frozen=True)
class Kinematic(AdaptiveAssessor):
    """Errors as what smooth errors of single joints do at the tool, learned while measuring.

    :mod:`research.kinematic_model` is fitted to the points of a first visit (``visited`` of
    the budget); then readings go where draws from its posterior have their largest error, measured
    before or not, a quarter of them to the readings it explains worst. Value and bounds are
    quantiles of the largest error in draws from the posterior. Source: error parameters of eq. 5
    with Gaussian process priors over the joints (Rasmussen and Williams, Gaussian Processes for
    Machine Learning, 2006), scales by marginal likelihood; local errors as a scale mixture.

    Assumes that single joints cause the errors smoothly, but for local errors of one population:
    the bounds are the model's, not guaranteed. As long as candidates are not measured, also that
    the largest error is not alone, as :mod:`kinacc.assess.search_and_confirm` does: a defect that
    was never touched cannot be seen. Says "no statement" where readings contradict the model (a
    reading farther off than one in a hundred campaigns would show: a local defect, a heavy tail;
    joints that explain less than half of the mean square error), and where the first visit has
    fewer components than the model has coefficients, for then its scales are guesses.
    """

    measurements: int
    visited: float = FIRST_SHARE
    confidence: float = CONFIDENCE
    q_rad: np.ndarray | None = None
    effects: np.ndarray | None = None
    name: ClassVar[str] = "kinematic"

    def __post_init__(self) -> None:
        problems = check_budget(self.measurements, self.confidence)
        if not 0.0 < self.visited <= 1.0:
            problems.append(Problem("visited", f"{self.visited}", "above 0 and at most 1"))
        refuse(problems, f"{self.name} cannot work with these settings")

    def shortfall(self, points: int, joints: int) -> Reason | None:
        """Why this budget leads to no statement on an arm of so many joints; None if it may."""
        needed = points_needed(joints)
        if first_points(self.measurements, points, self.visited) >= needed:
            return None
        return Reason("no_bound_ahead", {"needed": needed})

    def begin(self, candidates: Candidates) -> KinematicCampaign:
        """A new campaign. InputError without joints and effects of the candidates."""
        lacking = [
            Problem(name, "not given", "joints of the candidates, and what their errors do at them")
            for name in ("q_rad", "effects")
            if getattr(self, name) is None
        ]
        refuse(lacking, f"{self.name} needs to know the arm")
        return KinematicCampaign(self, candidates)


class KinematicCampaign(Campaign):
    """See :class:`Kinematic`."""

    settings: Kinematic

    def __init__(self, settings: Kinematic, candidates: Candidates) -> None:
        super().__init__(settings, candidates)
        self.first = first_points(settings.measurements, candidates.points, settings.visited)
        self._batch = max(round(_BATCH * settings.measurements), 1)
        self._basis: Basis | None = None
        self._scales: Scales | None = None
        self._planned: list[int] = []

    def next(self) -> int | None:
        """New points in order, then whoever could be the largest."""
        taken, left = self.ledger.taken, self.settings.measurements - self.ledger.taken
        if taken < self.first:
            return taken
        if left <= 0:
            return None
        if not self._planned:
            self._planned = self._plan(min(self._batch, left))
        return self._planned[0]

    def record(self, point: int, reading_mm, covariance_mm2=None) -> None:
        """Take a reading."""
        super().record(point, reading_mm, covariance_mm2)
        if point in self._planned:
            self._planned.remove(point)

    def statements(self) -> tuple[Statement, ...]:
        """The largest error of the measured points, and of all candidates."""
        if self.ledger.taken < self.first:
            left = Reason("first_visit", {"left": self.first - self.ledger.taken})
            return Statement(CANDIDATES, withheld=left), Statement(MEASURED, withheld=left)
        known = self._posterior()
        measured, everywhere, _ = self._draws(known)
        withheld = self._contradiction(known)
        points, seen = self.ledger.candidates.points, len(self.ledger.visited)
        crowd = 0
        if seen < points:
            crowd = companions(points, seen, MISSING_PART * (1.0 - self.settings.confidence))
        crowd = crowd if crowd > 1 else 0  # the largest itself was hardly missed
        missed = None
        if crowd > CROWD * points:
            missed = Reason("missed", {"seen": seen, "points": points, "crowd": crowd})
        return (
            self._said(CANDIDATES, everywhere, withheld or missed, crowd),
            self._said(MEASURED, measured, withheld),
        )

    def _said(
        self, target: str, draws: np.ndarray, withheld: Reason | None, crowd: int = 0
    ) -> Statement:
        confidence = self.settings.confidence
        low, value, high = (float(x) for x in np.quantile(draws, [1 - confidence, 0.5, confidence]))
        assumption = Reason("smooth")
        if crowd:
            assumption = Reason("smooth_and_crowd", {"crowd": crowd, "isolation": ISOLATION})
        resting = Statement(target, value, low, high, confidence, assumption=assumption)
        if withheld:
            return replace(resting, lower_mm=math.nan, upper_mm=math.nan, withheld=withheld)
        return resting

    def _contradiction(self, known: Posterior) -> Reason | None:
        """Why the model is not believed; None if it is."""
        from scipy.special import chdtrc

        if self.first < (needed := points_needed(self.settings.q_rad.shape[1])):
            return Reason("few_for_model", {"first": self.first, "needed": needed})
        worst = float(known.odd.max())
        chance = -math.expm1(known.odd.size * math.log1p(-float(chdtrc(3, worst))))
        if chance < _CONTRADICTED:
            return Reason("unexplained_reading")
        visited = self.ledger.visited
        square = np.sum(self.ledger.mean_mm[visited] ** 2, axis=1)
        size = float(np.mean(square - 3.0 * self.ledger.noise_mm[visited] ** 2))
        if 3.0 * self._scales.local_mm2 > (1.0 - _EXPLAINED) * size:
            return Reason("unexplained_half")
        return None

    def _plan(self, count: int) -> list[int]:
        """The next ``count`` points, by how often they are the largest in draws."""
        known = self._posterior()
        _, _, winners = self._draws(known)
        doubted = min(round(_DOUBTED * count), len(self.ledger.visited))
        order = np.argsort(-known.odd, kind="stable")[:doubted]
        plan = [self.ledger.visited[row] for row in order]
        reads = self.ledger.count.astype(float)
        for _ in range(count - len(plan)):
            # Each reading goes where it lowers the most variance among likely winners.
            point = int(np.argmax(winners / ((reads + 1.0) * np.maximum(reads, 0.5))))
            plan.append(point)
            reads[point] += 1.0
        return plan

    def _posterior(self) -> Posterior:
        settings, visited = self.settings, self.ledger.visited
        if self._basis is None:
            self._basis = Basis.of(settings.q_rad, settings.effects)
            rows = visited[: self.first]
            means, noise = self.ledger.mean_mm[rows], self.ledger.noise_mm[rows]
            self._scales = fitted_scales(self._basis, rows, means, noise)
        return posterior(self._basis, self._scales, visited, *self._readings())

    def _draws(self, known: Posterior) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        rng = np.random.default_rng([self.ledger.taken, len(self.ledger.visited)])
        visited = self.ledger.visited
        return largest_draws(self._basis, known, visited, *self._readings(), _DRAWS, rng)

    def _readings(self) -> tuple[np.ndarray, np.ndarray]:
        visited = self.ledger.visited
        return self.ledger.mean_mm[visited], self.ledger.noise_mm[visited]

"""Simulated campaigns on errors that are known: what a budget is likely to bring."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from kinacc.assess.adaptive import AdaptiveAssessor, Candidates
from kinacc.assess.attainable import NONE, WidthLimits, limits_of
from kinacc.assess.simulate import carry_on, noisy, truth_mm
from kinacc.assess.statement import Statement
from kinacc.errors import Problem, refuse
from kinacc.study.fields import ErrorField


@dataclass(frozen=True)
class Outcome:
    """One simulated campaign: what it said of one target, and the truth it is graded against.

    ``limits``: how near to the truth its bounds could come on average, with the errors known
    beforehand.
    """

    field: str
    budget: int
    repetition: int
    readings: int
    said: Statement
    truth_mm: float
    limits: WidthLimits = NONE

    @property
    def width_mm(self) -> float:
        """Distance of upper from lower bound; infinite where none is stated."""
        return width_mm(self.said)


def width_mm(said: Statement) -> float:
    """Distance of upper from lower bound; infinite where none is stated on the largest error."""
    if said.excepted:
        return math.inf
    width = said.upper_mm - said.lower_mm
    return math.inf if math.isnan(width) else width


def outcomes(
    fields: Sequence[ErrorField],
    points: int,
    covariance_mm2: np.ndarray,
    assessors: Sequence[AdaptiveAssessor],
    repetitions: int,
    seed: int,
    progress: Callable | None = None,
    limits_on: str | None = None,
) -> list[Outcome]:
    """Campaigns of every assessor (one per budget) over ``points`` candidates of every field.

    One repetition is one drawing of candidates and their readings, the same for every budget.
    Limits are computed for statements on the target ``limits_on`` alone.
    Raises InputError where a field holds fewer errors than candidates are wanted.
    """
    small = [
        Problem(f"errors {field.name}", f"only {field.points}", f"at least {points}")
        for field in fields
        if field.points < points
    ]
    refuse(small, "There are fewer errors than candidates")
    root = np.linalg.cholesky(covariance_mm2)
    work = [(number, each) for number in range(len(fields)) for each in range(repetitions)]
    found: list[Outcome] = []
    for number, repetition in progress(work, "simulated sets of readings") if progress else work:
        field = fields[number]
        rng = np.random.default_rng([seed, number, repetition])
        rows = rng.permutation(field.points)[:points]
        covariances = np.tile(covariance_mm2, (points, 1, 1))
        candidates = Candidates(covariances)
        sizes = np.linalg.norm(field.error_mm[rows], axis=1)
        most = max(each.measurements for each in assessors)
        reading = noisy(field.error_mm[rows], root, most, seed, number, repetition)
        for assessor in assessors:
            campaign = assessor.begin(candidates)
            readings = carry_on(campaign, reading)
            visited = campaign.ledger.visited
            known = visited, sizes, candidates.sigma_mm, assessor.measurements
            own_mm = getattr(assessor, "arm_mm", None)
            arm_mm = candidates.sigma_mm if own_mm is None else own_mm
            for said in campaign.statements():
                limits = NONE
                if said.target == limits_on:
                    limits = limits_of(said, *known)
                found.append(
                    Outcome(
                        field.name,
                        assessor.measurements,
                        repetition,
                        readings,
                        said,
                        truth_mm(said, sizes, visited, arm_mm),
                        limits=limits,
                    )
                )
    return found


def quantiles(values: Iterable[float], at: Sequence[float]) -> list[float]:
    """Quantiles of values of which some may be infinite: of order, without interpolation."""
    ordered = np.sort(np.array(list(values), dtype=float))
    places = [min(math.ceil(each * len(ordered)), len(ordered)) - 1 for each in at]
    return [float(ordered[max(place, 0)]) for place in places]

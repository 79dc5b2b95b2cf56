"""Simulated campaigns on errors that are known: what a budget is likely to bring."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from kinacc.assess.adaptive import AdaptiveAssessor, Candidates
from kinacc.assess.simulate import carry_on, is_broken, noisy, truth_mm
from kinacc.assess.statement import Statement
from kinacc.errors import Problem, refuse


@dataclass(frozen=True)
class Pool:
    """Errors (n, 3) that candidates are drawn from; ``q_rad`` (n, k) and ``effects`` for those
    assessors that use them."""

    name: str
    error_mm: np.ndarray
    q_rad: np.ndarray | None = None
    effects: np.ndarray | None = None

    def candidates(self, rows: np.ndarray, covariance_mm2: np.ndarray) -> Candidates:
        """Candidates of rows with equal covariances (3, 3)."""
        known = {
            name: getattr(self, name)[rows]
            for name in ("q_rad", "effects")
            if getattr(self, name) is not None
        }
        return Candidates(np.tile(covariance_mm2, (len(rows), 1, 1)), **known)


@dataclass(frozen=True)
class Outcome:
    """One simulated campaign: what it said of one target, and the truth it is graded against.

    ``broken``: what the statement rests on is not true of these errors.
    """

    pool: str
    budget: int
    repetition: int
    readings: int
    said: Statement
    truth_mm: float
    broken: bool = False

    @property
    def width_mm(self) -> float:
        """Distance of upper from lower bound; infinite where none is stated."""
        return width_mm(self.said)


def width_mm(said: Statement) -> float:
    """Distance of upper from lower bound; infinite where none is stated."""
    width = said.upper_mm - said.lower_mm
    return math.inf if math.isnan(width) else width


def outcomes(
    pools: Sequence[Pool],
    points: int,
    covariance_mm2: np.ndarray,
    assessors: Sequence[AdaptiveAssessor],
    repetitions: int,
    seed: int,
    progress: Callable | None = None,
) -> list[Outcome]:
    """Campaigns of every assessor (one per budget) over ``points`` candidates of every pool.

    One repetition is one drawing of candidates and their readings, the same for every budget.
    Raises InputError where a pool holds fewer errors than candidates are wanted.
    """
    small = [
        Problem(f"errors {pool.name}", f"only {len(pool.error_mm)}", f"at least {points}")
        for pool in pools
        if len(pool.error_mm) < points
    ]
    refuse(small, "There are fewer errors than candidates")
    root = np.linalg.cholesky(covariance_mm2)
    work = [(number, each) for number in range(len(pools)) for each in range(repetitions)]
    found: list[Outcome] = []
    for number, repetition in progress(work, "simulated worlds") if progress else work:
        pool = pools[number]
        rng = np.random.default_rng([seed, number, repetition])
        rows = rng.permutation(len(pool.error_mm))[:points]
        candidates = pool.candidates(rows, covariance_mm2)
        sizes = np.linalg.norm(pool.error_mm[rows], axis=1)
        most = max(each.measurements for each in assessors)
        reading = noisy(pool.error_mm[rows], root, most, seed, number, repetition)
        for assessor in assessors:
            campaign = assessor.begin(candidates)
            readings = carry_on(campaign, reading)
            for said in campaign.statements():
                found.append(
                    Outcome(
                        pool.name,
                        assessor.measurements,
                        repetition,
                        readings,
                        said,
                        truth_mm(said, sizes, campaign.ledger.visited),
                        broken=is_broken(said, sizes),
                    )
                )
    return found


def quantiles(values: Iterable[float], at: Sequence[float]) -> list[float]:
    """Quantiles of values of which some may be infinite: of order, without interpolation."""
    ordered = np.sort(np.array(list(values), dtype=float))
    places = [min(math.ceil(each * len(ordered)), len(ordered)) - 1 for each in at]
    return [float(ordered[max(place, 0)]) for place in places]

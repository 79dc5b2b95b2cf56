"""Simulated campaigns on errors that are known: what a budget is likely to bring."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from kinacc.assess.adaptive import AdaptiveAssessor, Campaign, Candidates
from kinacc.assess.random_numbers import key_of
from kinacc.assess.statement import CANDIDATES, MEASURED, Statement
from kinacc.assess.world import drawn_world
from kinacc.errors import InputError, Problem


class Deviates:
    """Standard normal deviates (3,) by point and reading: the same whatever else is read."""

    def __init__(self, points: int, readings: int, *entropy: int) -> None:
        self._world = drawn_world(np.zeros((points, 3)), 1.0, key_of(*entropy), max(readings, 1))

    def at(self, point: int, reading: int) -> np.ndarray:
        """Deviates of one reading."""
        return self._world.reading_mm(point, reading)


def carry_on(
    campaign: Campaign,
    errors_mm: np.ndarray,
    noise_root: np.ndarray,
    deviates: Deviates,
    after: Callable[[int], None] | None = None,
    limit: int | None = None,
) -> int:
    """Read as the campaign asks until it wants no more, or ``limit`` readings; their number.

    ``errors_mm`` (m, 3) by its rows; ``noise_root`` (3, 3): its product with its transpose is the
    covariance of a reading. ``after`` is called with the number of readings after each.
    """
    reads = np.zeros(len(errors_mm), dtype=int)
    done = 0
    while (limit is None or done < limit) and (row := campaign.next()) is not None:
        noise = noise_root @ deviates.at(row, reads[row])
        campaign.record(row, errors_mm[row] + noise)
        reads[row] += 1
        done += 1
        if after is not None:
            after(done)
    return done


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
    if small:
        raise InputError(small, "There are fewer errors than candidates")
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
        deviates = Deviates(points, most, seed, number, repetition)
        for assessor in assessors:
            campaign = assessor.begin(candidates)
            readings = carry_on(campaign, pool.error_mm[rows], root, deviates)
            measured = sizes[campaign.taken()[1]]
            truth = {MEASURED: float(measured.max()), CANDIDATES: float(sizes.max())}
            for said in campaign.statements():
                true_mm = truth.get(said.target, math.nan)
                company = int(np.sum(sizes >= sizes.max() / said.isolation))
                found.append(
                    Outcome(
                        pool.name,
                        assessor.measurements,
                        repetition,
                        readings,
                        said,
                        true_mm,
                        broken=company < said.crowd,
                    )
                )
    return found


def quantiles(values: Iterable[float], at: Sequence[float]) -> list[float]:
    """Quantiles of values of which some may be infinite: of order, without interpolation."""
    ordered = np.sort(np.array(list(values), dtype=float))
    places = [min(math.ceil(each * len(ordered)), len(ordered)) - 1 for each in at]
    return [float(ordered[max(place, 0)]) for place in places]

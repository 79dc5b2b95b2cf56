"""Campaigns and assessments on errors that are known, and what their statements are held to."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from kinacc.assess.adaptive import AdaptiveAssessor, Campaign, Candidates
from kinacc.assess.limits import visit_mm
from kinacc.assess.statement import CANDIDATES, MEASURED, REGION, VISIT, Statement
from kinacc.assess.world import Assessment, World, drawn_world, key_of

Reading = Callable[[int, int], np.ndarray]  # (row, how often it was read before): (3,), mm


def carry_on(
    campaign: Campaign,
    reading_mm: Reading,
    after: Callable[[int], None] | None = None,
    limit: int | None = None,
) -> int:
    """Read as the campaign asks until it wants no more, or ``limit`` readings; their number.

    ``after`` is called with the number of readings after each.
    """
    reads: dict[int, int] = {}
    done = 0
    while (limit is None or done < limit) and (row := campaign.next()) is not None:
        visit = reads.get(row, 0)
        campaign.record(row, reading_mm(row, visit))
        reads[row] = visit + 1
        done += 1
        if after is not None:
            after(done)
    return done


def conduct(assessor: AdaptiveAssessor, world: World) -> Campaign:
    """Run a campaign to its end on the readings of a world."""
    campaign = assessor.begin(Candidates.with_equal_noise(world.sigma_mm))
    carry_on(campaign, world.reading_mm)
    return campaign


def assess_world(assessor: Any, world: World, budget: int) -> tuple[Assessment, float]:
    """One assessment of a world, whichever the interface, and what its upper bound is held to, mm.

    An assessor that looks back has ``assess``; one that chooses as it goes has ``begin`` and is
    stopped after ``budget`` readings. Its statement on all candidates counts, else its first.
    """
    size = np.sqrt(np.sum(world.error_mm**2, axis=1))
    if hasattr(assessor, "assess"):
        return assessor.assess(world), float(size.max())
    rows: list[int] = []

    def reading_mm(row: int, visit: int) -> np.ndarray:
        rows.append(row)
        return world.reading_mm(row, visit)

    campaign = assessor.begin(Candidates.with_equal_noise(world.sigma_mm))
    carry_on(campaign, reading_mm, limit=budget)
    stated = campaign.statements()
    statement = next((item for item in stated if item.target == CANDIDATES), stated[0])
    assessment = Assessment(
        statement.value_mm, len(rows), len(set(rows)), statement.lower_mm, statement.upper_mm
    )
    if statement.target == REGION:
        return assessment, float(np.quantile(size, statement.share, method="inverted_cdf"))
    return assessment, truth_mm(statement, size, rows)


def noisy(errors_mm: np.ndarray, noise_root: np.ndarray, visits: int, *entropy: int) -> Reading:
    """Readings of errors (m, 3), up to ``visits`` a row: the same whatever else is read.

    ``noise_root``, (3, 3) or one for each row (m, 3, 3): its product with its transpose is the
    covariance of a reading.
    """
    root = np.broadcast_to(noise_root, (len(errors_mm), 3, 3))
    deviates = drawn_world(np.zeros((len(errors_mm), 3)), 1.0, key_of(*entropy), max(visits, 1))
    return lambda row, visit: errors_mm[row] + root[row] @ deviates.reading_mm(row, visit)


def truth_mm(
    statement: Statement,
    size_mm: np.ndarray,
    visited: list[int] | None,
    arm_mm: float | np.ndarray = 0.0,
) -> float:
    """What an upper bound is held to, of sizes (m,) of all candidates; NaN where these do not tell.

    ``arm_mm``: standard deviation of a visit per axis, of each candidate or of all.
    """
    if statement.error_of == VISIT:
        size_mm = visit_mm(size_mm, arm_mm)
    if statement.target == CANDIDATES:
        return float(np.sort(size_mm)[-1 - statement.excepted])
    if statement.target == MEASURED and visited:
        return float(size_mm[visited].max())
    return math.nan

"""Worlds, every reading one simulation could take, and assessments and campaigns on them.

A reading is a function of its address alone: a counter-based generator (Philox 4x64, 10 rounds, as
in numpy) is asked at counter (v, j, 0, 0) for reading v at point j of the simulation that the key
names. No reading depends on which others were taken, on their order, or on how many points there
are, so a simulation is one fixed world and only the readings somebody takes are ever computed.

The paper's three assessors look back. Model Invalidation replays what did not happen, so it cannot
be asked live; those that can are :class:`kinacc.assess.adaptive.AdaptiveAssessor`. To add one: a
module with a frozen dataclass that inherits :class:`Assessor`, and a line in
:mod:`kinacc.assess.registry`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from kinacc.assess.adaptive import AdaptiveAssessor, Campaign, Candidates
from kinacc.assess.invalidation_kernels import extend, extend_all
from kinacc.assess.limits import visit_mm
from kinacc.assess.statement import CANDIDATES, MEASURED, REGION, VISIT, Statement
from kinacc.errors import input_error, require_type
from kinacc.geometry import numbers


class World(NamedTuple):
    """Readings of m operating points, rows in the order in which they are visited.

    readings_mm: (m, V, 3) error vectors, robot base frame, of which row i holds the first
    ``known[i]``; sigma_mm: (m,) noise per axis, equal in the three axes. Readings are computed as
    they are asked for, from the errors (m, 3), the key and the points' own numbers ``point``: what
    a reading is never depends on when it is asked for. Beside them: sums_mm (m, 3) of the readings
    known, and sizes_mm (m, V), the magnitude of the mean of a point's readings up to each. The
    compiled kernels unpack the fields in this order.
    """

    readings_mm: np.ndarray
    known: np.ndarray
    sigma_mm: np.ndarray
    error_mm: np.ndarray
    key: np.ndarray
    point: np.ndarray
    sums_mm: np.ndarray
    sizes_mm: np.ndarray

    @property
    def points(self) -> int:
        """Number of operating points m."""
        return len(self.known)

    @property
    def visits(self) -> int:
        """Readings available at each point, V."""
        return self.readings_mm.shape[1]

    def reading_mm(self, row: int, visit: int) -> np.ndarray:
        """Error vector (3,) of reading number ``visit`` (0 = first) at a row, robot base frame."""
        if visit >= self.known[row]:
            extend(tuple(self), row, visit)
        return self.readings_mm[row, visit]

    def magnitudes_mm(self, measurements: int) -> np.ndarray:
        """Magnitudes of the first readings that fit the budget, in visiting order."""
        return self.sizes_mm[:measurements, 0].copy()


def key_of(*entropy: int) -> np.ndarray:
    """Key (2,) uint64 of the simulation named by non-negative integers (seed first)."""
    return np.random.SeedSequence(list(entropy)).generate_state(2, np.uint64)


def drawn_world(
    error_mm: ArrayLike,
    sigma_mm: ArrayLike,
    key: np.ndarray,
    visits: int,
    order: ArrayLike | None = None,
) -> World:
    """Return a world of simulated readings: true error plus white normal noise (eq. 9).

    Parameters
    ----------
    error_mm : (m, 3) true errors, robot base frame (:func:`checked_errors`)
    sigma_mm : a number or (m,), standard deviation per axis, above 0
    key : (2,) uint64 from :func:`key_of`
    visits : readings available at each point
    order : (m,) point numbers in visiting order, default 0 .. m-1. The noise at a point belongs to
        its number, not to its place in the order.
    """
    error = np.array(error_mm, dtype=np.float64)
    index = np.arange(len(error)) if order is None else np.array(order, dtype=np.int64)
    sigma = np.broadcast_to(np.array(sigma_mm, dtype=np.float64), len(error))[index]
    points = index.size
    # Repeats stay untouched until asked for.
    readings, sizes = np.empty((points, visits, 3)), np.empty((points, visits))
    known, sums = np.zeros(points, np.int64), np.zeros((points, 3))
    world = World(readings, known, sigma, error[index], key, index, sums, sizes)
    extend_all(tuple(world))
    return world


def checked_errors(error_mm: ArrayLike) -> np.ndarray:
    """Return true errors as (m, 3) float64; InputError where they cannot be used."""
    errors = np.ascontiguousarray(numbers("true errors", error_mm))
    if errors.ndim != 2 or errors.shape[1] != 3 or errors.shape[0] == 0:
        message, allowed = f"shape {errors.shape}", "(m, 3) with m at least 1, in mm"
        raise input_error("true errors", message, allowed)
    bad = np.flatnonzero(~np.isfinite(errors).all(axis=1))
    if bad.size:
        message = f"points {bad[:5].tolist()} are not finite"
        raise input_error("true errors", message, "numbers in mm")
    return errors


def error_vectors(columns: Mapping[str, ArrayLike]) -> np.ndarray:
    """Return the error vectors (n, 3) in the columns ex_mm, ey_mm and ez_mm of a table."""
    return np.stack([np.asarray(columns[f"e{axis}_mm"], dtype=float) for axis in "xyz"], axis=1)


class Assessment(NamedTuple):
    """Assessed accuracy with what it took; bounds are None where the assessor states none."""

    assessed_mm: float
    measurements: int
    points_visited: int
    lower_mm: float | None = None
    upper_mm: float | None = None


class Assessor(Protocol):
    """A method of assessment that looks back at one fixed world.

    ``name`` is its name in tables; ``switches`` maps each field that is a reading of the paper to
    its choices; ``measurements`` is the budget. What is a key of the
    configuration's ``study`` has no default here.
    """

    name: ClassVar[str]
    switches: ClassVar[dict[str, tuple[str, ...]]] = {}
    measurements: int

    def assess(self, world: World) -> Assessment:
        """Assess the accuracy in one world."""
        ...


Reading = Callable[[int, int], np.ndarray]  # (row, how often it was read before): (3,), mm


def carry_on(campaign: Campaign, reading_mm: Reading, limit: int | None = None) -> int:
    """Read as the campaign asks until it wants no more, or ``limit`` readings; their number."""
    ledger = campaign.ledger
    while (limit is None or ledger.taken < limit) and (row := campaign.next()) is not None:
        campaign.record(row, reading_mm(row, ledger.count.item(row)))
    return ledger.taken


def conduct(assessor: AdaptiveAssessor, world: World, limit: int | None = None) -> Campaign:
    """Run a campaign to its end, or ``limit`` readings, on the readings of a world."""
    campaign = assessor.begin(Candidates.with_equal_noise(world.sigma_mm))
    require_type("begin(candidates)", campaign, Campaign)
    carry_on(campaign, world.reading_mm, limit)
    return campaign


def assess_world(assessor: Any, world: World, budget: int) -> tuple[Assessment, float]:
    """One assessment of a world, whichever the interface, and what its upper bound is held to, mm.

    An assessor that looks back has ``assess``; one that chooses as it goes has ``begin`` and is
    stopped after ``budget`` readings. Its statement on all candidates counts, else its first.
    """
    size = np.sqrt(np.sum(world.error_mm**2, axis=1))
    if hasattr(assessor, "assess"):
        return assessor.assess(world), float(size.max())
    campaign = conduct(assessor, world, budget)
    stated, visited = campaign.statements(), campaign.ledger.visited
    statement = next((item for item in stated if item.target == CANDIDATES), stated[0])
    bounds = statement.lower_mm, statement.upper_mm
    assessment = Assessment(statement.value_mm, campaign.ledger.taken, len(visited), *bounds)
    if statement.target == REGION:
        return assessment, float(np.quantile(size, statement.share, method="inverted_cdf"))
    return assessment, truth_mm(statement, size, visited)


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

"""Adaptive assessors: told what was measured, they say what to measure next and what is known.

A campaign is one run of an assessor over candidate points. It is told readings one by one, names
the next point or says that it is done, and states at any moment what the readings so far allow.
Equal readings in equal order lead to equal answers, so a campaign is restored by telling it its
readings again. To add an assessor: a module with a frozen pydantic dataclass of its settings that
inherits :class:`AdaptiveAssessor`, and a line in :mod:`kinacc.assess.registry`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike
from pydantic import ConfigDict, Field

from kinacc.assess.limits import Noise, lower_limit_mm, upper_limit_mm
from kinacc.assess.statement import Reason, Statement, Suspicious
from kinacc.errors import Problem, refuse

if TYPE_CHECKING:
    from kinacc.assess.noise import Contrasts
    from kinacc.assess.reference_poses import Change

_SYMMETRY = 1e-9  # largest asymmetry of a covariance, and spread that counts as equal noise
STRICT = ConfigDict(strict=True, allow_inf_nan=False)  # of settings of assessors
Confidence = Annotated[float, Field(ge=0.5, lt=1.0)]


class Candidates:
    """The m points an assessor may measure, rows in random order.

    The order must have been drawn without regard to the errors: the first k rows then stand for
    all. covariance_mm2: (m, 3, 3) of one reading at each point, robot base frame.
    """

    def __init__(self, covariance_mm2: ArrayLike) -> None:
        self.covariance_mm2 = np.array(covariance_mm2, dtype=float)
        none = np.flatnonzero(~are_covariances(self.covariance_mm2))
        where = "covariance of point"
        problems = [Problem(f"{where} {row}", "is no covariance", COVARIANCE) for row in none]
        refuse(problems, "these candidates cannot be assessed")

    @classmethod
    def with_equal_noise(cls, sigma_mm: np.ndarray) -> Candidates:
        """Candidates with standard deviations (m,), equal in the three axes."""
        return cls(np.asarray(sigma_mm, dtype=float)[:, None, None] ** 2 * np.eye(3))

    @property
    def points(self) -> int:
        """Number of candidates m."""
        return len(self.covariance_mm2)

    @cached_property
    def sigma_mm(self) -> np.ndarray:
        """Standard deviation per axis (m,), root mean square over the axes."""
        return np.sqrt(np.trace(self.covariance_mm2, axis1=1, axis2=2) / 3.0)

    @cached_property
    def inverses(self) -> np.ndarray:
        """Inverses (m, 3, 3) of the covariances."""
        return np.linalg.inv(self.covariance_mm2)


class AdaptiveAssessor(Protocol):
    """A method of assessment that chooses as it goes.

    ``name`` in tables; ``measurements`` it may spend; ``confidence`` of its bounds and of the
    limits on single points.
    """

    name: ClassVar[str]
    measurements: int
    confidence: float

    def begin(self, candidates: Candidates) -> Campaign:
        """A new campaign without readings: here one that reads the first candidates once."""
        return Campaign(self, candidates)

    def state(self, ledger: Ledger) -> tuple[Statement, ...]:
        """The statements that the readings of such a campaign allow, the main one first."""
        ...

    def shortfall(self, points: int) -> Reason | None:
        """What the budget is too small for with so many candidates; None if nothing."""
        return None


class Ledger:
    """Readings of a campaign, averaged by point with the weights their covariances give them."""

    def __init__(self, candidates: Candidates) -> None:
        points = candidates.points
        self.candidates = candidates
        self.count = np.zeros(points, dtype=np.int64)
        self.visited: list[int] = []  # in the order of their first readings
        # Every reading in order: its row, the reading (3,) and its covariance (3, 3).
        self.readings: list[tuple[int, np.ndarray, np.ndarray]] = []
        self.unplanned: set[int] = set()  # rows with readings of other covariance
        self.mean_mm = np.zeros((points, 3))
        self.noise_mm = np.full(points, math.inf)  # of the mean, per axis, root mean square
        self._weight = np.zeros((points, 3, 3))  # sum of inverse covariances
        self._weighted = np.zeros((points, 3))  # sum of these times readings
        self.spread_mm2 = np.zeros((points, 3, 3))  # covariance of the mean

    @property
    def taken(self) -> int:
        """Number of readings."""
        return len(self.readings)

    def record(
        self, point: int, reading_mm: ArrayLike, covariance_mm2: ArrayLike | None = None
    ) -> None:
        """Take one reading, or raise InputError and take nothing."""
        points, reading, problems = self.candidates.points, np.array(reading_mm, dtype=float), []
        if not 0 <= point < points:
            problems.append(Problem("point", f"{point}", f"0 to {points - 1}"))
        if reading.shape != (3,) or not np.all(np.isfinite(reading)):
            problems.append(Problem("reading", f"{reading.tolist()}", "three numbers, in mm"))
        if covariance_mm2 is not None:
            covariance = np.array(covariance_mm2, dtype=float)
            if not are_covariances(covariance[None]).all():
                problems.append(Problem("covariance", "is none", COVARIANCE))
        refuse(problems, "this reading cannot be recorded")
        if not self.count[point]:
            self.visited.append(point)
        self.count[point] += 1
        if covariance_mm2 is None:
            covariance, inverse = (
                self.candidates.covariance_mm2[point],
                self.candidates.inverses[point],
            )
        else:
            self.unplanned.add(point)
            inverse = np.linalg.inv(covariance)
        self.readings.append((point, reading, covariance))
        self._weight[point] += inverse
        self._weighted[point] += inverse @ reading
        if point in self.unplanned:
            spread = np.linalg.inv(self._weight[point])
            spread = 0.5 * (spread + spread.T)
        else:  # all of one covariance: a quarter of a simulated campaign's time was the inverses
            spread = covariance / self.count[point]
        self.spread_mm2[point] = spread
        self.mean_mm[point] = spread @ self._weighted[point]
        self.noise_mm[point] = math.sqrt(spread.trace() / 3.0)

    def noise(self, point: int) -> Noise:
        """Noise of a point's mean: standard deviation per axis (mm), or covariance (3, 3)."""
        spread, noise = self.spread_mm2[point], self.noise_mm.item(point)
        uneven = np.abs(spread - noise**2 * np.eye(3)).max() > _SYMMETRY * noise**2
        return spread if uneven else noise

    def places(self, point: int) -> np.ndarray:
        """Places (n,) of a point's readings among all (0 = first)."""
        return np.flatnonzero([row == point for row, _, _ in self.readings])

    def at(self, places: Iterable[int]) -> tuple[np.ndarray, np.ndarray]:
        """The readings (n, 3) at these places and their covariances (n, 3, 3)."""
        read = [self.readings[place] for place in places]
        vectors = np.array([reading for _, reading, _ in read])
        return vectors.reshape(-1, 3), np.array([spread for *_, spread in read]).reshape(-1, 3, 3)

    def sizes_mm(self) -> np.ndarray:
        """Sizes of the mean readings of the visited points, in visiting order."""
        return np.sqrt(np.sum(self.mean_mm[self.visited] ** 2, axis=1))

    def limits_mm(self, lower: float, upper: float) -> dict[int, tuple[float, float]]:
        """Limits on the size of every visited point by its mean, for errors allowed to each."""
        return {
            row: (
                lower_limit_mm(self.mean_mm[row], self.noise(row), lower),
                upper_limit_mm(self.mean_mm[row], self.noise(row), upper),
            )
            for row in self.visited
        }


class Campaign:
    """One assessment under way: readings in a ledger, limits from the means.

    ``first``: rows 0 to ``first`` - 1 are visited whatever is read, each before any other point.
    ``reference_poses``: of these, rows 0 to ``reference_poses`` - 1 come first of all, and are read
    again by plan. ``ledger``: the readings that count, for others to look at and not to change.
    Here each of the first rows is read once; a campaign that decides as it goes has ``next`` and
    ``statements`` of its own.
    """

    reference_poses = 0

    def __init__(self, settings: AdaptiveAssessor, candidates: Candidates) -> None:
        self.settings = settings
        self.ledger = Ledger(candidates)
        points = candidates.points
        self.first = min(getattr(settings, "measurements", points), points)

    def next(self) -> int | None:
        """The row to measure next; None if no further measurement is wanted."""
        return self.ledger.taken if self.ledger.taken < self.first else None

    def statements(self) -> tuple[Statement, ...]:
        """What the readings so far allow to say, the main statement first."""
        return self.settings.state(self.ledger)

    def visit(self) -> tuple[int, ...]:
        """Rows in the order in which they are read whatever is read, until readings decide."""
        return tuple(range(self.first))

    def record(
        self, point: int, reading_mm: ArrayLike, covariance_mm2: ArrayLike | None = None
    ) -> None:
        """Take a reading (3,) at a row: measured minus modelled position, robot base frame.

        covariance_mm2: (3, 3) of this reading where it is not the planned one. InputError, and
        nothing taken, where the reading cannot be used.
        """
        self.ledger.record(point, reading_mm, covariance_mm2)

    def repeats(self) -> Contrasts | None:
        """Differences of repeated readings, by which the noise is checked; None without such."""
        return None

    def alarms(self) -> tuple[Reason, ...]:
        """What the readings say against what the statements rest on: codes with their numbers."""
        return ()

    def change(self) -> Change | None:
        """What reference poses show of a drift or step of the frame; None where there are none."""
        return None

    def suspicious(self) -> tuple[Suspicious, ...]:
        """Readings that the noise as stated does not explain, by number."""
        return ()

    def point_limits(self) -> dict[int, tuple[float, float]]:
        """Lower and upper limit (mm) on the size of every measured row, as the assessor has them.

        With its confidence each upper limit holds by itself, and all lower limits together. Here
        those of the mean readings alone.
        """
        error = 1.0 - self.settings.confidence
        return self.ledger.limits_mm(error / max(len(self.ledger.visited), 1), error)


COVARIANCE = "(3, 3), finite, symmetric and positive definite, in mm^2"


def are_covariances(covariance_mm2: np.ndarray) -> np.ndarray:
    """Which of n arrays are covariances (3, 3) of a reading."""
    if covariance_mm2.shape[1:] != (3, 3):
        return np.zeros(len(covariance_mm2), dtype=bool)
    safe = np.nan_to_num(covariance_mm2)
    scale = np.abs(safe).max(axis=(1, 2))
    skewed = np.abs(safe - np.swapaxes(safe, 1, 2)).max(axis=(1, 2)) > _SYMMETRY * scale
    is_finite = np.isfinite(covariance_mm2).all(axis=(1, 2))
    return is_finite & ~skewed & (np.linalg.eigvalsh(safe)[:, 0] > 1e-14 * scale)

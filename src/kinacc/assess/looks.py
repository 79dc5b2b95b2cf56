"""Limits on every point's size that hold however often and whenever somebody looks.

A point is looked at when it has as many readings as one of the counts fixed beforehand. A point of
size s has readings whose component along its true error is normal about s, and their mean is at
least as long as the mean of these components. Where every look at k readings states
``|mean| + z_k sigma / sqrt(k)``, a limit below s therefore means that a Gaussian walk of k steps
lies below ``-z_k sqrt(k)``. Counts and z are fixed beforehand, so the chance that this ever happens
is that of the walk, whatever decided when to measure a point again or to stop. Upper limits of
different points need no correction for their number: the largest of them is at least the limit of
the point that is truly largest. Lower limits share their error out over points and looks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from kinacc.assess.adaptive import Ledger
from kinacc.assess.limits import largest_size, lower_limit_mm
from kinacc.assess.wrong_readings import clip_of, guarded_lower_mm, guarded_upper_mm

_GROWTH = 1.25  # of the number of readings from look to look
_SECOND = 3  # readings at the second look: a block of two tells how readings scatter
_NEAR = 0.93  # of the last look: what comes later is left to it
EARLY = 0.08  # of the allowed error, spent on the first look whatever comes
LATE = 0.95  # power of the share of readings taken, with which the rest is spent
WALKS = 200_000
_SEED = 20_200  # of the walks: part of the method, not of a study
_SAFE = 2.33  # standard deviations: the error rate is below the allowed one at 99 %


@dataclass(frozen=True)
class Boundary:
    """Looks at ``counts`` (L,) readings, and standard deviations ``z`` (L,) of the mean at each.

    ``alone`` (L,): the same for looks that share the error without regard to their correlation,
    for points whose readings are not all of one covariance.
    """

    counts: np.ndarray
    z: np.ndarray
    alone: np.ndarray


def look_counts(extra: int) -> tuple[int, ...]:
    """Numbers of readings at which a point is looked at: 1, 3, then by a quarter, extra + 1."""
    last, counts, count = extra + 1, [1], _SECOND
    while count < _NEAR * last:
        counts.append(count)
        count = max(count + 2, math.ceil(count * _GROWTH))
    return tuple(counts) if last == 1 else (*counts, last)


@lru_cache(maxsize=256)
def boundary(
    counts: tuple[int, ...],
    error: float,
    freedom: float = math.inf,
    early: float = EARLY,
    late: float | None = LATE,
    rate: float = 0.0,
) -> Boundary:
    """Return the boundary that a walk crosses with probability ``error`` in all.

    The part ``early`` of the error is spent at once and the rest with the share of readings taken,
    raised to ``late`` (None: equal z at all looks). This gives the shape of z; its scale is
    simulated. With ``freedom`` the mean is held to ``z s / sqrt(k)``, s being one standard
    deviation estimated from so many degrees of freedom, common to all looks. With ``rate`` the
    boundary is one of clipped scores (:mod:`kinacc.assess.wrong_readings`), some of them wrong;
    a single reading counts in full, and that it is wrong is no part of ``error``.

    References
    ----------
    Pocock, Biometrika 64 (1977) 191-199; Lan and DeMets, Biometrika 70 (1983) 659-663.
    """
    from scipy.special import ndtri, stdtrit

    readings = np.array(counts)
    if late is None:
        shares = np.full(len(readings), error / len(readings))
    else:
        shares = np.diff(
            error * (early + (1.0 - early) * (readings / readings[-1]) ** late), prepend=0.0
        )
    alone = -(ndtri(shares) if math.isinf(freedom) else stdtrit(freedom, shares))
    if rate:
        alone = alone + rate * clip_of(rate) * np.sqrt(readings)
    rng = np.random.default_rng(_SEED)
    total, farthest, before = np.zeros(WALKS), np.full(WALKS, -math.inf), 0
    for count, width in zip(counts, alone.tolist(), strict=True):
        if not rate:
            total += math.sqrt(count - before) * rng.normal(size=WALKS)
            fallen = -total
        else:
            for number in range(before, count):
                score = rng.normal(size=WALKS)
                fallen = -score
                wrong = number > 0 or counts[0] > 1
                score[rng.random(WALKS) < rate * wrong] = -math.inf
                total += np.clip(score, -clip_of(rate), clip_of(rate))
            fallen = fallen if count == 1 else -total
        np.maximum(farthest, fallen / (math.sqrt(count) * width), out=farthest)
        before = count
    if not math.isinf(freedom):
        farthest /= np.sqrt(rng.chisquare(freedom, WALKS) / freedom)
    safe = max(error - _SAFE * math.sqrt(error * (1.0 - error) / WALKS), 1.0 / WALKS)
    if counts[0] == 1:
        safe /= 1.0 - rate  # a wrong first reading is paid for by itself
    scale = float(np.quantile(farthest, 1.0 - safe))
    return Boundary(readings, alone * (scale if rate else min(scale, 1.0)), alone)


class _Look(NamedTuple):
    """Mean of a point's readings at a look, its noise, and whether all came as planned."""

    mean_mm: np.ndarray
    noise: float | np.ndarray
    as_planned: bool


class Looks:
    """Limits of all points of a ledger, mm; upper ones are kept as points are looked at.

    ``upper`` says at which counts points are looked at and how wide the upper limits are;
    ``lower_error`` is what the lower limits of one point may miss by, ``shares`` (L,) its parts by
    look. ``factor`` is how much larger than planned the noise is taken where points are chosen.
    With a ``rate`` of wrong readings upper limits count clipped scores, and ``wrong`` is how many
    readings of the campaign are wrong at most. upper_mm: (m,), infinite before the first look.
    """

    def __init__(
        self,
        ledger: Ledger,
        upper: Boundary,
        lower_error: float,
        shares: np.ndarray,
        factor: float,
        rate: float = 0.0,
        wrong: int = 0,
    ) -> None:
        points = ledger.candidates.points
        self.ledger, self.boundary, self.factor = ledger, upper, factor
        self.lower_errors, self.rate, self.wrong = (lower_error * shares).tolist(), rate, wrong
        self.upper_mm = np.full(points, math.inf)
        self._counts = [*upper.counts.tolist(), math.inf]
        self._seen: list[list[_Look]] = [[] for _ in range(points)]

    def update(self, point: int) -> None:
        """Look at a point if its number of readings asks for it."""
        if self.missing(point):
            return
        ledger, looks = self.ledger, self._seen[point]
        planned = ledger.as_planned(point)
        looks.append(_Look(ledger.mean_mm[point].copy(), ledger.noise(point), planned))
        limit = self._upper_mm(point, len(looks) - 1, self.boundary, self.factor)
        self.upper_mm[point] = min(self.upper_mm[point], limit)

    def missing(self, point: int) -> float:
        """Readings missing until the next look; infinite after the last."""
        return self._counts[len(self._seen[point])] - self.ledger.count.item(point)

    def limits_mm(self, boundary: Boundary, factor: np.ndarray) -> np.ndarray:
        """Upper limits (m,) of another boundary at the same counts, noise (m,) times as planned.

        Infinite where a point was not looked at.
        """
        if boundary is self.boundary and (factor == self.factor).all():
            return self.upper_mm
        limits = [
            [self._upper_mm(point, look, boundary, scale) for look in range(len(self._seen[point]))]
            for point, scale in enumerate(factor.tolist())
        ]
        return np.array([min(of_point, default=math.inf) for of_point in limits])

    def lower_limits_mm(self, factor: np.ndarray) -> np.ndarray:
        """Lower limits (m,), noise (m,) times as planned; 0 where a point was not looked at."""
        largest = np.zeros(len(self._seen))
        for point, scale in enumerate(factor.tolist()):
            for look, error in zip(self._seen[point], self.lower_errors, strict=False):
                noise = look.noise * (scale if isinstance(look.noise, float) else scale**2)
                largest[point] = max(largest[point], lower_limit_mm(look.mean_mm, noise, error))
        return largest

    def largest_lower_mm(self, factor: np.ndarray) -> float:
        """Lower bound on the largest error of the visited points, from single ones.

        Of one more point than can have a wrong reading, with the largest limits, one is right.
        """
        limits = np.sort(self.lower_limits_mm(factor)[self.ledger.visited])
        return float(limits[-1 - self.wrong]) if len(limits) > self.wrong else 0.0

    def _upper_mm(self, point: int, look: int, boundary: Boundary, factor: float) -> float:
        mean, noise, as_planned = self._seen[point][look]
        z = (boundary.z if as_planned else boundary.alone).item(look)
        if look and self.rate:
            readings, covariances = self.ledger.readings_of(point, int(boundary.counts[look]))
            return guarded_upper_mm(readings, factor**2 * covariances, z, self.rate)
        if not isinstance(noise, float):
            return largest_size(mean, noise, factor * z)
        x, y, z_mm = mean.tolist()
        return math.sqrt(x * x + y * y + z_mm * z_mm) + factor * z * noise


SHARE = 0.6  # of the readings after the visit that count
_STAGES = (0.125, 0.25, 0.5, 1.0)  # of these readings, after which a bound may be stated
_LATE = 3.0  # with this power of their share the error is spent: most of it in the end


class LowerAverage:
    """Readings that count, up to ``wanted``, and the bounds of its stages.

    Of every one that counted, in order: its point, what it read along its direction (mm), and the
    standard deviation of that (mm). ``rate``: share of readings that may be wrong.
    """

    def __init__(
        self, wanted: int, error: float, freedom: float = math.inf, rate: float = 0.0
    ) -> None:
        self.wanted, self._rate = wanted, rate
        self._stages: dict[int, float] = {}  # readings that count, and deviations taken off
        if wanted:
            counts = tuple(sorted({max(math.ceil(share * wanted), 1) for share in _STAGES}))
            z = boundary(counts, error, freedom, 0.0, _LATE, rate).z.tolist()
            self._stages = dict(zip(counts, z, strict=True))
        self._rows: list[int] = []
        self._along_mm: list[float] = []
        self._noise_mm: list[float] = []

    def record(
        self, row: int, direction: list[float], reading_mm: list[float], noise_mm: float
    ) -> None:
        """Take a reading (3,) at a row, of deviation ``noise_mm`` along ``direction`` (3,)."""
        (u, v, w), (x, y, z) = direction, reading_mm
        self._rows.append(row)
        self._along_mm.append(u * x + v * y + w * z)
        self._noise_mm.append(noise_mm)

    @property
    def at_stage(self) -> bool:
        """Whether the readings that counted are those of a stage."""
        return len(self._rows) in self._stages

    @property
    def has_spoken(self) -> bool:
        """Whether a stage was reached: from then on the lower bound is by the average alone.

        Never the larger of it and of single points: the farthest of many single readings is what a
        heavy tail brings.
        """
        return bool(self._stages) and len(self._rows) >= min(self._stages)

    @property
    def missing(self) -> int:
        """Readings that have still to count."""
        return self.wanted - len(self._rows)

    def bound_mm(self, factor: np.ndarray) -> float:
        """The largest bound of the stages reached, 0 before; noise (m,) times as planned."""
        along, noise = np.array(self._along_mm), np.array(self._noise_mm)
        scale, bounds = factor[self._rows], [0.0] if self._rate else []
        for count, z in self._stages.items():
            if count > len(along):
                break
            if self._rate:
                stated = scale[:count] * noise[:count]
                bounds.append(guarded_lower_mm(along[:count], stated, z, self._rate))
                continue
            weight = 1.0 / noise[:count]
            off = z * math.sqrt(float(np.sum(scale[:count] ** 2)))
            bounds.append((float(along[:count] @ weight) - off) / float(weight.sum()))
        return max(bounds, default=0.0)


def direction_of(mean_mm: list[float]) -> list[float]:
    """The unit vector (3,) along a mean; the first axis where it is zero."""
    length = math.sqrt(sum(component * component for component in mean_mm))
    return [component / length for component in mean_mm] if length > 0.0 else [1.0, 0.0, 0.0]

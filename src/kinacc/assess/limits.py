"""Limits on the sizes of errors from readings: of one look, of many looks, with wrong readings.

Readings are normal (eq. 9). With equal noise per axis the size of a reading is noncentral chi
distributed with three degrees of freedom; with other noise the true error lies in an ellipsoid.

A point is looked at when it has as many readings as one of the counts fixed beforehand. A point of
size s has readings whose component along its true error is normal about s, and their mean is at
least as long as the mean of these components. Where every look at k readings states
``|mean| + z_k sigma / sqrt(k)``, a limit below s therefore means that a Gaussian walk of k steps
lies below ``-z_k sqrt(k)``. Counts and z are fixed beforehand, so the chance that this ever happens
is that of the walk, whatever decided when to measure a point again or to stop. Upper limits of
different points need no correction for their number: the largest of them is at least the limit of
the point that is truly largest. Lower limits share their error out over points and looks.

A reading goes wrong with probability ``rate`` at most, whatever was read before and whatever it
then says: the target slipped, the beam met another target. A reading then counts by its score: its
distance from the size tried, along a direction and in standard deviations, clipped at ``clip``
(Huber 1965). A wrong reading counts ``clip`` at most, and the sum of k scores at the true size is
no lower, in distribution, than the sum of k draws that are -``clip`` with probability ``rate`` and
a clipped normal deviate otherwise. That law is known, and :func:`boundary` is calibrated by it.
Only the first reading of a point cannot be guarded: one that is wrong and small there has the point
left alone. It costs ``rate`` of the confidence, and the statement says so.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import chdtri, chndtrix, ndtr, ndtri, stdtrit

if TYPE_CHECKING:
    from kinacc.assess.adaptive import Ledger

Noise = float | np.ndarray  # standard deviation per axis (mm), or covariance (3, 3), mm^2

_ROOT_2_PI = math.sqrt(2.0 * math.pi)
_TINY = 1e-9  # sizes below it count as it
VISITS = 0.95  # share of future visits that a bound on single visits is about
_FAR = 300.0  # sizes over noise from which on an expansion is exact to 1e-7
_PRODUCTS, _FEWEST, _MOST = 4000, 24, 200  # of readings with directions; directions tried first
_KEPT, _BESIDE, _ROUNDS = 3, 12, 7  # best directions of a round, new ones about each, rounds
_GROWTH = 1.25  # of the number of readings from look to look
_SECOND = 3  # readings at the second look: a block of two tells how readings scatter
_NEAR = 0.93  # of the last look: what comes later is left to it
EARLY = 0.08  # of the allowed error, spent on the first look whatever comes
LATE = 0.95  # power of the share of readings taken, with which the rest is spent
WALKS = 200_000
_SEED = 20_200  # of the walks: part of the method, not of a study
_SAFE = 2.33  # standard deviations: the error rate is below the allowed one at 99 %
SHARE = 0.6  # of the readings after the visit that count
_STAGES = (0.125, 0.25, 0.5, 1.0)  # of these readings, after which a bound may be stated
_LATE = 3.0  # with this power of their share the error is spent: most of it in the end


def upper_limit_mm(mean_mm: np.ndarray, noise: Noise, error: float) -> float:
    """Return the size that the true error exceeds with probability at most ``error``.

    mean_mm: (3,) average of readings; noise: its standard deviation per axis (mm), or its
    covariance (3, 3), mm^2. Equal noise per axis: the noncentral chi limit. Unequal: the farthest
    point of an ellipsoid, a little wider.
    """
    if isinstance(noise, float):
        return noise * size_at(float(np.linalg.norm(mean_mm)) / noise, error)
    return largest_size(mean_mm, noise, -float(ndtri(error)))


def lower_limit_mm(mean_mm: np.ndarray, noise: Noise, error: float) -> float:
    """Return the size that the true error falls below with probability at most ``error``.

    Where noise is unequal, the smallest size in the ellipsoid that holds the true error with the
    confidence asked for: an error of any size outside is rejected whatever its direction.
    """
    if isinstance(noise, float):
        return noise * size_at(float(np.linalg.norm(mean_mm)) / noise, 1.0 - error)
    deviations, (variance, axes) = math.sqrt(float(chdtri(3, error))), np.linalg.eigh(noise)
    y = axes.T @ mean_mm
    if np.sum(y * y / variance) <= deviations**2:
        return 0.0
    return _size_at_boundary(y, variance, deviations, variance, 0.0)


def reading_below(x: np.ndarray | float, a: np.ndarray | float) -> np.ndarray:
    """Return the probability that a reading at a point of size ``a`` has at most size ``x``.

    Both in standard deviations of the noise per axis: the noncentral chi distribution with three
    degrees of freedom. SciPy's chndtr takes milliseconds beyond sizes of 1000.
    """
    a = np.maximum(a, _TINY)
    # [phi(x - a) - phi(x + a)] / a, without cancellation where sizes are small.
    bulge = np.exp(-0.5 * (x - a) ** 2) * -np.expm1(-2.0 * x * a) / (a * _ROOT_2_PI)
    return np.maximum(ndtr(x - a) - ndtr(-(x + a)) - bulge, 0.0)


@lru_cache(maxsize=100_000)
def size_at(x: float, probability: float) -> float:
    """Return the size at which a reading of at most ``x`` has this probability; 0 if none has.

    With 0.05 an upper limit on the size, with 0.95 a lower limit, each at 95 % confidence.
    """
    if reading_below(x, 0.0) <= probability:
        return 0.0
    high = x + 1.0
    while reading_below(x, high) > probability:
        high += 1.0

    def excess(a: float) -> float:
        return float(reading_below(x, a)) - probability

    return float(brentq(excess, 0.0, high, xtol=1e-14, rtol=1e-14))


def visit_mm(size_mm: np.ndarray | float, arm_mm: np.ndarray | float) -> np.ndarray:
    """Return the size that 95 % of visits to poses of mean errors ``size_mm`` do not exceed.

    arm_mm: standard deviation of a visit per axis, equal in all. Grows with the size and with the
    noise, so limits on these bring limits on it. NaN for a size that is not known.
    """
    size, arm = np.broadcast_arrays(np.asarray(size_mm, float), np.asarray(arm_mm, float))
    ratio = size / np.where(arm > 0.0, arm, 1.0)
    beyond = np.sqrt(chndtrix(VISITS, 3.0, np.minimum(ratio, _FAR) ** 2))
    return size + arm * np.where(
        ratio < _FAR, beyond - ratio, ndtri(VISITS) + 1.0 / np.maximum(ratio, 1.0)
    )


def largest_size(mean_mm: np.ndarray, covariance_mm2: np.ndarray, deviations: float) -> float:
    """Return the largest |x| with (x - mean)' S^-1 (x - mean) <= deviations^2, mm.

    With the one-sided normal quantile for ``deviations`` it is an upper limit on the size of the
    true error: along the true error's own direction the reading is normal, and the largest value
    over all directions is at least the one along it.
    """
    variance, axes = np.linalg.eigh(covariance_mm2)
    top, y = float(variance[-1]), axes.T @ mean_mm
    # Off the plane across the widest axis by a billionth, where the farthest point is not unique.
    y[-1] = math.copysign(max(abs(y.item(2)), 1e-9 * math.sqrt(top)), y.item(2))
    return _size_at_boundary(y, variance, deviations, top - variance, top)


def _size_at_boundary(
    y: np.ndarray, variance: np.ndarray, deviations: float, offset: np.ndarray, start: float
) -> float:
    """Size of the point of an ellipsoid about y (3,) that is nearest to the origin, or farthest.

    x_i = t y_i / (t + s_i) or t y_i / (t - s_i), for the t, above the largest variance s_i, that
    meets the boundary: t is ``start`` and a gap, the denominator the gap and an ``offset``.
    """
    weight = variance * y * y

    def excess(gap: float) -> float:
        return float(np.sum(weight / (gap + offset) ** 2)) - deviations * deviations

    low = max(float((np.sqrt(weight) / deviations - offset).max()), 0.0)
    high = math.sqrt(weight.sum()) / deviations
    gap = brentq(excess, 0.999999 * low, 1.000001 * high, xtol=1e-16 * high, rtol=1e-14)
    return float(np.linalg.norm((start + gap) * y / (gap + offset)))


@lru_cache
def clip_of(rate: float) -> float:
    """Score beyond which readings count no more: the one by which a wrong reading harms least."""

    def gain(clip: float) -> float:
        density = math.exp(-0.5 * clip * clip) / math.sqrt(2.0 * math.pi)
        return 2.0 * density / clip - 2.0 * float(ndtr(-clip)) - rate / (1.0 - rate)

    return float(brentq(gain, 1e-3, 12.0))


def guarded_upper_mm(
    readings_mm: np.ndarray, covariances_mm2: np.ndarray, deviations: float, rate: float
) -> float:
    """Largest size of a point's error that its readings do not reject, mm.

    readings_mm: (k, 3); covariances_mm2: (k, 3, 3); deviations: z of this look. A size is rejected
    by the direction in which the error points, so the limit is the largest over all directions. It
    is searched for all around, then ever closer about the best directions found.
    """
    count, clip = len(readings_mm), clip_of(rate)
    wanted = -deviations * math.sqrt(count)
    if wanted <= -clip * count:
        return math.inf
    number = min(max(_PRODUCTS // count, _FEWEST), _MOST)
    tried = np.vstack([readings_mm.mean(axis=0), _around(number)])
    apart, largest = math.sqrt(4.0 * math.pi / number), 0.0
    for _ in range(_ROUNDS):
        tried = tried / np.linalg.norm(tried, axis=1)[:, None]
        sigma = np.sqrt(np.einsum("qi,kij,qj->qk", tried, covariances_mm2, tried))
        sizes = sizes_at(tried @ readings_mm.T, sigma, clip, wanted)
        largest = max(largest, float(sizes.max()))
        best = tried[np.argsort(-sizes)[:_KEPT]]
        tried = np.vstack([best, (best[:, None] + apart * _around(_BESIDE)).reshape(-1, 3)])
        apart *= 0.5
    return largest


def guarded_lower_mm(
    along_mm: np.ndarray, sigma_mm: np.ndarray, deviations: float, rate: float
) -> float:
    """Smallest largest error that readings along directions chosen beforehand do not reject, mm.

    along_mm: (T,) readings along the directions, of any points; sigma_mm: (T,) their standard
    deviations; deviations: z of T scores. The largest error is at least the error along any
    direction, so scores at it are no larger than those of the noise.
    """
    clip, wanted = clip_of(rate), -deviations * math.sqrt(len(along_mm))
    if wanted <= -clip * len(along_mm):
        return 0.0
    return max(-float(sizes_at(-along_mm[None], sigma_mm[None], clip, wanted)[0]), 0.0)


def sizes_at(along: np.ndarray, sigma: np.ndarray, clip: float, wanted: float) -> np.ndarray:
    """Largest sizes (q,) at which the scores of every row sum to ``wanted``, above -clip k.

    along, sigma: (q, k). The sum falls from clip k, along a straight line between any two sizes at
    which a score begins or ceases to be clipped.
    """
    ends = np.hstack([along - clip * sigma, along + clip * sigma])
    order, slopes = np.argsort(ends, axis=1), np.hstack([-1.0 / sigma, 1.0 / sigma])
    ends = np.take_along_axis(ends, order, axis=1)
    slopes = np.cumsum(np.take_along_axis(slopes, order, axis=1), axis=1)[:, :-1]
    fallen = np.cumsum(slopes * np.diff(ends, axis=1), axis=1) + clip * along.shape[1]
    # The first piece that ends below; the last one where round-off hides it.
    piece = np.minimum(np.sum(fallen >= wanted, axis=1), fallen.shape[1] - 1)
    rows = np.arange(len(along))
    return ends[rows, piece + 1] + (wanted - fallen[rows, piece]) / slopes[rows, piece]


@lru_cache
def _around(number: int) -> np.ndarray:
    """Directions (number, 3) evenly all around: a spiral from pole to pole."""
    rank = np.arange(number) + 0.5
    height, turn = 1.0 - 2.0 * rank / number, math.pi * (1.0 + math.sqrt(5.0)) * rank
    radius = np.sqrt(1.0 - height**2)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])


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
    late: float = LATE,
    rate: float = 0.0,
) -> Boundary:
    """Return the boundary that a walk crosses with probability ``error`` in all.

    The part ``early`` of the error is spent at once and the rest with the share of readings taken,
    raised to ``late``. This gives the shape of z; its scale is
    simulated. With ``freedom`` the mean is held to ``z s / sqrt(k)``, s being one standard
    deviation estimated from so many degrees of freedom, common to all looks. With ``rate`` the
    boundary is one of clipped scores, some of them wrong;
    a single reading counts in full, and that it is wrong is no part of ``error``.

    References
    ----------
    Pocock, Biometrika 64 (1977) 191-199; Lan and DeMets, Biometrika 70 (1983) 659-663.
    """
    readings = np.array(counts)
    spent = error * (early + (1.0 - early) * (readings / readings[-1]) ** late)
    shares = np.diff(spent, prepend=0.0)
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
    noise: Noise
    as_planned: bool


class Looks:
    """Limits of all points of a ledger, mm; upper ones are kept as points are looked at.

    ``upper`` says at which counts points are looked at and how wide the upper limits are;
    ``lower_errors`` (L,) is what the lower limits of one point may miss by, look by look.
    ``factor`` is how much larger than planned the noise is taken where points are chosen. With a
    ``rate`` of wrong readings upper limits count clipped scores, and ``wrong`` is how many
    readings of the campaign are wrong at most. upper_mm: (m,), infinite before the first look.
    """

    def __init__(
        self,
        ledger: Ledger,
        upper: Boundary,
        lower_errors: Sequence[float],
        factor: float,
        rate: float,
        wrong: int,
    ) -> None:
        points = ledger.candidates.points
        self.ledger, self.boundary, self.factor = ledger, upper, factor
        self.lower_errors, self.rate, self.wrong = lower_errors, rate, wrong
        self.upper_mm = np.full(points, math.inf)
        self._counts = [*upper.counts.tolist(), math.inf]
        self._seen: list[list[_Look]] = [[] for _ in range(points)]

    def update(self, point: int) -> None:
        """Look at a point if its number of readings asks for it."""
        if self.missing(point):
            return
        ledger, looks = self.ledger, self._seen[point]
        planned = point not in ledger.unplanned
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
        limits = np.full(len(factor), math.inf)
        for point, seen in enumerate(self._seen):
            for look in range(len(seen)):
                limit = self._upper_mm(point, look, boundary, factor.item(point))
                limits[point] = min(limits[point], limit)
        return limits

    def lower_limits_mm(self, factor: np.ndarray) -> np.ndarray:
        """Lower limits (m,), noise (m,) times as planned; 0 where a point was not looked at."""
        limits = np.zeros(len(factor))
        for point, seen in enumerate(self._seen):
            scale = factor.item(point)
            for look, error in zip(seen, self.lower_errors, strict=False):
                noise = look.noise * (scale if isinstance(look.noise, float) else scale**2)
                limits[point] = max(limits[point], lower_limit_mm(look.mean_mm, noise, error))
        return limits

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
            count = boundary.counts.item(look)
            readings, covariances = self.ledger.at(self.ledger.places(point)[:count])
            return guarded_upper_mm(readings, factor**2 * covariances, z, self.rate)
        if not isinstance(noise, float):
            return largest_size(mean, noise, factor * z)
        return math.hypot(*mean.tolist()) + factor * z * noise


class LowerAverage:
    """Readings that count, up to ``wanted``, and the bounds of its stages.

    Of every one that counted, in order: its point, what it read along its direction (mm), and the
    standard deviation of that (mm). ``rate``: share of readings that may be wrong.
    """

    def __init__(self, wanted: int, error: float, freedom: float, rate: float) -> None:
        self.wanted, self._rate = wanted, rate
        self._stages: dict[int, float] = {}  # readings that count, and deviations taken off
        if wanted:
            counts = tuple(sorted({math.ceil(share * wanted) for share in _STAGES}))
            z = boundary(counts, error, freedom, 0.0, _LATE, rate).z.tolist()
            self._stages = dict(zip(counts, z, strict=True))
        self._counted: list[tuple[int, float, float]] = []

    def record(self, row: int, along_mm: float, noise_mm: float) -> None:
        """Take what a reading at a row is along its direction, and the noise of that."""
        self._counted.append((row, along_mm, noise_mm))

    @property
    def at_stage(self) -> bool:
        """Whether the readings that counted are those of a stage."""
        return len(self._counted) in self._stages

    @property
    def has_spoken(self) -> bool:
        """Whether a stage was reached: from then on the lower bound is by the average alone.

        Never the larger of it and of single points: the farthest of many single readings is what a
        heavy tail brings.
        """
        return bool(self._stages) and len(self._counted) >= min(self._stages)

    @property
    def missing(self) -> int:
        """Readings that have still to count."""
        return self.wanted - len(self._counted)

    def bound_mm(self, factor: np.ndarray) -> float:
        """The largest bound of the stages reached, 0 before; noise (m,) times as planned."""
        bounds = [0.0] if self._rate or not self.has_spoken else []
        for count, z in self._stages.items():
            if count > len(self._counted):
                break
            rows, along, noise = np.array(self._counted[:count]).T
            factors = factor[rows.astype(int)]
            if self._rate:
                bounds.append(guarded_lower_mm(along, factors * noise, z, self._rate))
            else:
                off = z * math.sqrt(float(np.sum(factors**2)))
                bounds.append((float(np.sum(along / noise)) - off) / float(np.sum(1.0 / noise)))
        return max(bounds)

"""How large the bounds of a campaign take the noise, and what its readings say against that.

A block is what one decision reads at one point. How its readings differ tells of the noise alone,
whatever the errors are, and nothing of the block's mean. So a factor on the covariances stated
that is estimated from a number of differences fixed beforehand is independent of all means, and of
every decision that was taken on means.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from scipy.special import betaincinv, chdtri, fdtri, gammaln

from kinacc.assess.adaptive import Candidates, Ledger
from kinacc.assess.statement import VISIT, Reason, Suspicious

if TYPE_CHECKING:
    from kinacc.assess.search_and_confirm import SearchAndConfirm

KNOWN: Final = "known"
ESTIMATED: Final = "estimated"
ENOUGH = 60  # degrees of freedom that are asked for: 20 triples
FEWEST = 30  # degrees of freedom below which no factor is estimated
MOST = 120  # degrees of freedom beyond which a factor is as good as known, or checked
_SINGLES = 9  # blocks of a single reading: about the three stages of the lower bound, and its end
_NOISE_PART = 0.2  # of an allowed error, where the noise itself has to be bounded
_MEDIAN = 2.366  # of a chi-square with three degrees of freedom
_CLEARLY = 1.7  # three standard deviations of the root of the median of one, over that median's
_FAR = 16.27  # squared contrast that one in a thousand exceeds: no scatter where some are wrong
SCATTER = 4e-3  # probability that noise as stated is ever called larger in a campaign
BESIDE_REFERENCES = 1e-3  # the same where alarms of reference poses have their part of 1 % in all
_LARGER = 1.2  # times the noise stated: what readings are held against
_LARGER_THAN_TESTED = 1.5  # the same where a test says the noise: no test tells it to 20 %
_TAILS = 5.5  # logarithm of the ratio of likelihoods that tells heavy tails; false in 0.2 %
_HEAVY = 8.0  # degrees of freedom of the heavy-tailed readings that normal ones are held against
FALSE_ALARM = 0.002  # chance that a campaign without a wrong reading has a suspicious one
_LATER = 2  # readings after the first that it is held to, fixed as their number must be
_STEP = 0.7  # of the standard deviation of a logarithm of scale: nodes of the integral over it


class Contrasts(NamedTuple):
    """Differences within blocks, in the order taken: standard normal where the noise is as stated.

    rows: (n,) candidate of each; blocks: (n,) number of its block; values: (n, 3), each the
    difference of a reading from the mean of those before it in its block, in units of its own
    standard deviations.
    """

    rows: np.ndarray
    blocks: np.ndarray
    values: np.ndarray

    @property
    def freedom(self) -> int:
        """Degrees of freedom: three for each difference."""
        return 3 * len(self.rows)

    @property
    def squares(self) -> np.ndarray:
        """Squared lengths (n,)."""
        return np.sum(self.values**2, axis=1)

    def without_wrong_blocks(self) -> Contrasts:
        """Differences of blocks without a reading far off.

        Readings that go wrong and are guarded against tell nothing of the noise of others; one is
        in many differences of its block.
        """
        near = ~np.isin(self.blocks, self.blocks[self.squares > _FAR])
        return Contrasts(*(column[near] for column in self))


def contrasts(ledger: Ledger, blocks: Sequence[int]) -> Contrasts:
    """Differences within blocks of all readings of a ledger, in the order taken.

    blocks: of each reading the number of its block; readings of a block are of one point.
    """
    under_way: dict[int, tuple[np.ndarray, np.ndarray]] = {}  # mean, and inverse of its covariance
    rows, numbers, values = [], [], []
    for block, (row, reading, spread) in zip(blocks, ledger.readings, strict=True):
        added = np.linalg.inv(spread)
        if block not in under_way:
            under_way[block] = reading, added
            continue
        mean, weight = under_way[block]
        apart = reading - mean
        values.append(np.linalg.solve(np.linalg.cholesky(spread + np.linalg.inv(weight)), apart))
        rows.append(row)
        numbers.append(block)
        weight = weight + added
        under_way[block] = mean + np.linalg.solve(weight, added @ apart), weight
    differences = np.array(values).reshape(-1, 3)
    return Contrasts(np.array(rows, np.int64), np.array(numbers, np.int64), differences)


def largest_factor(
    candidates: Candidates, rows: np.ndarray, readings_mm: np.ndarray, error: float
) -> float:
    """Factor that the true one exceeds with probability at most ``error``, whatever the errors are.

    From one reading (n, 3) each of different candidates (n,). Errors take readings farther away
    than noise alone, never nearer: the median of their squared sizes, in the units of the noise, is
    at least that of as many central chi-squares with three degrees of freedom, times the factor
    squared. The median says more than the sum where a few errors are large.
    """
    square = np.einsum("ni,nij,nj->n", readings_mm, candidates.inverses[rows], readings_mm)
    rank = (len(square) + 1) // 2
    # The share of a chi-square below its order statistic is a beta variable.
    below = float(betaincinv(rank, len(square) - rank + 1, error))
    return math.sqrt(float(np.sort(square)[rank - 1]) / float(chdtri(3, 1.0 - below)))


def factor_limit(freedom: float, above: float) -> float:
    """Factor that the true one is below with probability ``above``, over one that was estimated."""
    return 1.0 if math.isinf(freedom) else math.sqrt(freedom / float(chdtri(freedom, above)))


class NoiseTaken(NamedTuple):
    """Factor on the standard deviations planned, for bounds.

    ``value``, of all; ``by_point`` (m,): of candidates that were read so often that they have a
    factor of their own, the larger of it and ``value``; elsewhere ``value``. ``least`` and
    ``most``: what the noise itself is not below and not above; ``reason``: how all this was had,
    None where the noise is as stated.
    """

    value: float
    by_point: np.ndarray
    least: float
    most: float
    reason: Reason | None


class CampaignNoise:
    """The noise of one campaign, by its settings and the readings of its ledger.

    ``margin``: times the noise stated that bounds allow for. ``freedom``: degrees of freedom that
    limits on means are calibrated with, infinite where the factor is no estimate; ``estimating``:
    of the campaign's own, 0 where a test brings them. ``is_bounded``: nothing but the size of
    readings says how large the noise may be. ``mean_share``: part of an allowed error that limits
    on means may spend; the rest is for limits of the noise. ``blocks``: of every reading of the
    ledger the number of its block; ``first``: points that are visited whatever is read.
    """

    def __init__(
        self, settings: SearchAndConfirm, ledger: Ledger, blocks: Sequence[int], first: int
    ) -> None:
        self.settings, self.ledger, self.first, self._blocks = settings, ledger, first, blocks
        self._taken, self._latest = 0, contrasts(ledger, blocks)
        # Sure to come whatever is decided: a block has two readings or more, but for a few; so half
        # of all others tell of the noise.
        spare = settings.measurements - first - settings.references
        within, tested = 3 * max((spare - _SINGLES + 1) // 2, 0), settings.noise_freedom
        self._sure = within
        self.is_known, self._guarded = settings.noise == KNOWN, settings.wrong_rate > 0.0
        self.margin = settings.noise_margin if self.is_known and within < MOST else 1.0
        # The law of clipped scores is known for a stated noise alone, or one that is no larger:
        # where readings may be wrong, the upper limit of the test is taken for the noise.
        is_estimate = not self.is_known and not self._guarded
        # All that is sure to come, so that bounds are sure to come; no more than helps.
        estimates = is_estimate and not tested and within >= FEWEST
        self.estimating = min(within, MOST) if estimates else 0
        self.is_bounded = is_estimate and not tested and not estimates
        self.freedom = (tested or self.estimating or math.inf) if is_estimate else math.inf
        of_arm = settings.error_of == VISIT and settings.arm_mm is None
        is_limited = self._guarded or self.is_bounded or of_arm
        self.mean_share = 1.0 - _NOISE_PART if is_limited and not self.is_known else 1.0

    @property
    def contrasts(self) -> Contrasts:
        """Differences within the blocks of all readings so far."""
        if self._taken != self.ledger.taken:
            self._taken, self._latest = self.ledger.taken, contrasts(self.ledger, self._blocks)
        return self._latest

    @property
    def telling(self) -> Contrasts:
        """Those that tell of the noise: of blocks without a wrong reading, where some may be."""
        found = self.contrasts
        return found.without_wrong_blocks() if self._guarded else found

    def missing(self) -> Reason | None:
        """Why the noise is not known yet; None where it is."""
        if self.estimating and self.contrasts.freedom < self.estimating:
            numbers = {"freedom": self.contrasts.freedom, "needed": self.estimating}
            return Reason("noise_unknown", numbers)
        if self.is_bounded and len(self.ledger.visited) < self.first:
            return Reason("first_visit", {"left": self.first - len(self.ledger.visited)})
        return None

    def taken(self, error: float) -> NoiseTaken:
        """The noise for bounds that may err with this probability; not where it is ``missing``."""
        part, points = _NOISE_PART * error, self.ledger.candidates.points
        freedom = self.settings.noise_freedom or self.estimating
        if self.is_known:
            value, reason = self._stated_or_shown()
            least, most = 1.0, value
        elif self.is_bounded:
            rows = np.array(self.ledger.visited[: self.first])
            first = self.ledger.at([self.ledger.places(row)[0] for row in rows])[0]
            value = largest_factor(self.ledger.candidates, rows, first, part)
            least, most, reason = 0.0, value, Reason("noise_bounded", {"factor": value})
        else:
            least, most = factor_limit(freedom, part), factor_limit(freedom, 1.0 - part)
            if not self._guarded:
                value, by_point = estimated_factor(self.contrasts, self.estimating, points)
                code = "noise_estimated" if self.estimating else "noise_tested"
                reason = Reason(code, {"factor": value, "freedom": freedom})
                return NoiseTaken(value, by_point, value * least, value * most, reason)
            value, reason = most, Reason("noise_limited", {"factor": most, "freedom": freedom})
        return NoiseTaken(value, np.full(points, value), least, most, reason)

    def alarms(self) -> tuple[Reason, ...]:
        """What readings of the same block say against the noise stated, and against normal ones."""
        tails = None if self._guarded else tails_alarm(self.contrasts)
        scatter = None
        if not self.estimating and not self.is_bounded:
            tested, margin = self.settings.noise_freedom or math.inf, self.margin
            false = BESIDE_REFERENCES if self.settings.references else SCATTER
            scatter = scatter_alarm(self.telling, tested=tested, margin=margin, false=false)
        return tuple(alarm for alarm in (scatter, tails) if alarm is not None)

    def usual_scatter(self) -> float:
        """Factor on the noise planned that most differences within blocks have; 0 where few are.

        By their median, which a few wrong readings do not turn, and only where it is clearly above
        what is planned: the chance of a false suspicion is never larger by it.
        """
        squares = self.contrasts.squares
        if 3 * len(squares) < FEWEST:
            return 0.0
        usual = math.sqrt(float(np.median(squares)) / _MEDIAN)
        return usual if usual > 1.0 + _CLEARLY / math.sqrt(len(squares)) else 0.0

    def arms_mm(self, noise: NoiseTaken) -> tuple[float, float, float]:
        """The arm's own standard deviation: at least, likely, at most."""
        if self.settings.arm_mm is not None:
            return (self.settings.arm_mm,) * 3
        visited = self.ledger.visited
        variances = np.linalg.eigvalsh(self.ledger.candidates.covariance_mm2[visited])
        unknown = self.is_bounded or self.is_known
        likely = float(np.sqrt(variances.mean())) * (1.0 if unknown else noise.value)
        least = noise.least * math.sqrt(float(variances.min()))
        largest = float((noise.by_point[visited] * np.sqrt(variances[:, -1])).max())
        return least, likely, noise.most * largest / noise.value

    def _stated_or_shown(self) -> tuple[float, Reason | None]:
        """Factor on a noise that is stated: what bounds allow for, or more where repeats show more.

        Where the noise is as stated, bounds are never less sure for being wider.
        """
        differences, margin = self.telling, self.margin
        shown = math.sqrt(float(differences.squares.sum()) / max(differences.freedom, 1))
        if differences.freedom >= FEWEST and shown > margin:
            return shown, Reason("noise_shown", {"factor": shown, "freedom": differences.freedom})
        numbers = {"margin": margin, "sure": self._sure, "needed": MOST}
        return margin, Reason("noise_margin", numbers) if margin > 1.0 else None


def estimated_factor(
    differences: Contrasts, estimating: int, points: int
) -> tuple[float, np.ndarray]:
    """The factor that the first ``estimating`` numbers tell, or, with none, a test before: 1.

    And of every point (m,): one with 30 degrees of freedom of its own keeps the larger of its own
    factor and this one.
    """
    first = differences.values.reshape(-1)[:estimating]
    value = math.sqrt(float(np.mean(first**2))) if estimating else 1.0
    count = 3 * np.bincount(differences.rows, minlength=points)
    factors = np.sqrt(
        np.bincount(differences.rows, differences.squares, points) / np.maximum(count, 1)
    )
    return value, np.where(count >= FEWEST, np.maximum(factors, value), value)


def scatter_alarm(
    differences: Contrasts, *, tested: float = math.inf, margin: float = 1.0, false: float = SCATTER
) -> Reason | None:
    """That readings of the same block differ more than the noise stated allows.

    ``tested``: degrees of freedom of the test that the noise stated comes from; ``margin``: how
    many times that noise the bounds allow for; ``false``: the probability that noise as stated is
    ever called larger. Ratio of two likelihoods: noise 1.2 times as large as allowed for (1.5 times
    where it was tested) over noise as large. Where it is no larger the ratio's mean never exceeds
    1, so it ever exceeds 1/p with a probability of p at most (Ville's inequality). With a noise
    that was tested, both likelihoods are averaged over all sizes of it.
    """
    total = np.cumsum(differences.squares) / margin**2
    freedom = 3.0 * np.arange(1, len(total) + 1)
    if math.isinf(tested):
        ratios = 0.5 * total * (1.0 - 1.0 / _LARGER**2) - freedom * math.log(_LARGER)
    else:
        nearer = np.log((tested + total) / (tested + total / _LARGER_THAN_TESTED**2))
        ratios = 0.5 * (tested + freedom) * nearer - freedom * math.log(_LARGER_THAN_TESTED)
    if ratios.max(initial=-math.inf) < -math.log(false):
        return None
    ratio = math.sqrt(float(np.mean(differences.squares)) / 3.0)
    return Reason("scatter", {"ratio": ratio, "freedom": differences.freedom})


def tails_alarm(differences: Contrasts) -> Reason | None:
    """That some differences within blocks are too far out for normal readings of any noise.

    Ratio of two likelihoods, each averaged over all sizes of noise: heavy-tailed readings (half of
    the weight each: axes by themselves, and all three axes at once) over normal ones. Where
    readings are normal its mean is 1 at all times, so it ever exceeds exp(5.5) with a probability
    of 0.4 % at most (Ville's inequality); how far it jumps beyond makes that 0.2 %.
    """
    if differences.freedom < FEWEST or heavy_over_normal(differences.values) <= _TAILS:
        return None
    farthest = float(np.abs(differences.values).max() / _scale(differences.values))
    return Reason("tails", {"farthest": farthest, "freedom": differences.freedom})


def heavy_over_normal(values: np.ndarray) -> float:
    """Logarithm of the ratio of likelihoods of :func:`tails_alarm` for contrasts (n, 3)."""
    half = values.size / 2.0
    step = _STEP / math.sqrt(2.0 * values.size)
    log_scale = math.log(_scale(values)) + np.arange(-0.8, 0.8 + step, step)

    def log_t(square: np.ndarray, axes: int) -> np.ndarray:
        """Log likelihood (scales,) of Student's t of so many axes and variance 1."""
        power, spread = (_HEAVY + axes) / 2.0, _HEAVY - 2.0
        peak = gammaln(power) - gammaln(_HEAVY / 2.0) - axes / 2.0 * math.log(math.pi * spread)
        scaled = square.reshape(-1) * np.exp(-2.0 * log_scale)[:, None]
        return np.sum(peak - power * np.log1p(scaled / spread), axis=1)

    both = np.logaddexp(log_t(values**2, 1), log_t(np.sum(values**2, axis=1), 3)) - math.log(2.0)
    heavy = np.logaddexp.reduce(both - values.size * log_scale) + math.log(step)
    normal = gammaln(half) - math.log(2.0) - half * math.log(math.pi * float(np.sum(values**2)))
    return float(heavy - normal)


def _scale(values: np.ndarray) -> float:
    """Standard deviation of normal contrasts, by their median: far ones do not move it."""
    return float(np.median(np.abs(values))) / 0.6745


def suspicious_readings(
    ledger: Ledger,
    blocks: Sequence[int],
    counts: Sequence[int],
    planned: int,
    factor: float,
    freedom: float,
) -> tuple[Suspicious, ...]:
    """All suspicious readings of the points read again, by number.

    blocks: of all readings of the ledger, below 0 where planned. counts: at which a point is looked
    at; all readings between two looks are taken as one block: what interrupts them goes by looks.
    planned: readings beyond the visit. factor: by which standard deviations are larger than stated,
    from ``freedom`` degrees. With probability ``FALSE_ALARM`` at most there is one where every
    reading is as the noise says.
    """
    in_block = factor * _limit(0.5 * FALSE_ALARM / max(planned, 1), freedom)
    of_first = factor * _limit(0.5 * FALSE_ALARM / ledger.candidates.points, freedom)
    suspicious = []
    for row in np.flatnonzero(ledger.count > 1).tolist():
        places = ledger.places(row)
        readings = ledger.at(places)
        looks = np.searchsorted(counts, np.arange(len(places)), side="right")
        block = np.where(np.array(blocks)[places] < 0, -places - 1, looks)
        named: dict[int, float] = {}
        for number in np.unique(block):
            members, others = np.flatnonzero(block == number), np.flatnonzero(block != number)
            if len(members) < 2:
                continue
            apart = [_apart(*readings, index, members[members != index]) for index in members]
            if (far := max(apart)) > in_block:
                # Of two, neither tells which it is: the one farther from the other readings.
                if len(members) == 2 and len(others):
                    apart = [_apart(*readings, index, others) for index in members]
                named[int(members[np.argmax(apart)])] = far
        if len(places) > _LATER and min(named, default=len(places)) > _LATER:
            first = _apart(*readings, 0, np.arange(1, _LATER + 1))
            if first > of_first:
                named[0] = first
        suspicious += [
            Suspicious(int(places[i]) + 1, row, far / factor) for i, far in named.items()
        ]
    return tuple(sorted(suspicious))


def _apart(
    values: np.ndarray, spreads: np.ndarray, index: int | np.intp, others: np.ndarray
) -> float:
    """Distance from the mean of others, in standard deviations of the difference."""
    apart = values[index] - values[others].mean(axis=0)
    spread = spreads[index] + spreads[others].sum(axis=0) / len(others) ** 2
    return math.sqrt(float(apart @ np.linalg.solve(spread, apart)))


def _limit(error: float, freedom: float) -> float:
    """Distance in standard deviations that noise in three directions exceeds so rarely."""
    if math.isinf(freedom):
        return math.sqrt(float(chdtri(3, error)))
    return math.sqrt(3.0 * float(fdtri(3.0, freedom, 1.0 - error)))

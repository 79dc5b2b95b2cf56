"""The recommended assessor: look at every candidate once, confirm the suspects, say both bounds."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveInt
from pydantic.dataclasses import dataclass
from scipy.stats import binom

from kinacc.assess.adaptive import STRICT, AdaptiveAssessor, Campaign, Candidates, Confidence
from kinacc.assess.limits import EARLY, SHARE, Boundary, Looks, LowerAverage, boundary, look_counts
from kinacc.assess.noise import (
    ENOUGH,
    FEWEST,
    KNOWN,
    CampaignNoise,
    Contrasts,
    factor_limit,
    suspicious_readings,
)
from kinacc.assess.reference_poses import Change, find_change, planned_readings, poses_of, schedule
from kinacc.assess.statement import (
    CANDIDATES,
    CONFIDENCE,
    MEAN,
    MEASURED,
    VISIT,
    Reason,
    Statement,
    Suspicious,
)
from kinacc.errors import Problem, refuse

VISITED = 0.9  # of the budget, where it is smaller than the number of candidates
FIRST_SHARE = 0.6  # of the first visit, made before anything is stated
MARGIN = 1.2  # how much larger than stated noise may be that nothing can check
MOST_WRONG = 0.1  # of the readings: with more, clipped scores tell hardly anything


@dataclass(frozen=True, config=STRICT)
class SearchAndConfirm(AdaptiveAssessor):
    """Visit all candidates if the budget has readings for them; then confirm the likely largest.

    Readings left after the visit go, block by block, to the point with the largest upper limit
    whose next look they can reach, and a share of them to the largest mean, for the lower bound.
    With fewer readings than candidates nine tenths of them visit new points.

    ``measured``: upper limits that hold at all looks at once, and a lower bound by an average of
    readings along directions seen before (:mod:`kinacc.assess.limits`). Both hold whatever the
    errors are, for readings that are normal with known covariance (eq. 9). ``candidates``: the
    same where all are visited. Otherwise half of the allowed error is for the largest errors that
    all were missed: the upper bound is of all but the fewest candidates with which that is
    improbable enough, and assumes nothing but the random order.

    Where too few readings are planned at points read before to check a noise that is stated as
    known, it is taken ``noise_margin`` times as large, and always at least as large as readings of
    the same block show it. ``noise: estimated`` takes it as stated up to one factor: estimated from
    readings of the same block, or from a test before with ``noise_freedom`` degrees of freedom
    (:mod:`kinacc.assess.noise`). Where readings contradict what is stated, bounds are
    withheld. ``error_of: visit`` bounds what 95 % of future
    visits to the worst pose keep; ``arm_mm`` is the arm's own standard deviation per axis, all of
    the noise where it is null. ``references`` readings return to reference poses by plan; where
    these show a drift or step, bounds are withheld (:mod:`kinacc.assess.reference_poses`).
    ``allowance_mm`` is what no repeat sees; it widens both
    bounds. ``wrong_rate`` is the largest share of readings that go wrong and are guarded against
    (:mod:`kinacc.assess.limits`): it is lost from the confidence. Without it, bounds are
    withheld where a reading stands apart (:mod:`kinacc.assess.noise`). The value is
    the median of the posterior of :func:`likely_largest_mm`.
    """

    measurements: PositiveInt
    confidence: Confidence = CONFIDENCE
    noise: Literal["known", "estimated"] = KNOWN
    noise_freedom: NonNegativeInt = 0
    noise_margin: Annotated[float, Field(ge=1.0, le=10.0)] = MARGIN
    wrong_rate: Annotated[float, Field(ge=0.0, le=MOST_WRONG)] = 0.0
    references: NonNegativeInt = 0
    error_of: Literal["mean", "visit"] = MEAN
    arm_mm: NonNegativeFloat | None = None
    allowance_mm: NonNegativeFloat = 0.0
    name: ClassVar[str] = "search_and_confirm"

    def __post_init__(self) -> None:
        known, freedom = self.noise == KNOWN, self.noise_freedom
        tested = f"0, or with noise: estimated at least {FEWEST}; {ENOUGH} are asked for"
        guarded = "0 where the campaign estimates the noise, by readings that may be wrong"
        least = self.references + 2 * poses_of(self.references)
        conditions = (
            ("noise_freedom", freedom == 0 or (not known and freedom >= FEWEST), tested),
            ("arm_mm", self.arm_mm is None or self.error_of == VISIT, "null: only of visits"),
            ("wrong_rate", known or freedom > 0 or not self.wrong_rate, guarded),
            ("references", least <= self.measurements, f"fewer: they take {least} readings"),
        )
        refuse(
            Problem(f"setting {name} of {self.name}", f"{getattr(self, name)!r}", allowed)
            for name, holds, allowed in conditions
            if not holds
        )

    def enough_for_all(self, points: int) -> int:
        """Measurements with which the statement on all ``points`` candidates assumes nothing."""
        return points - math.floor(MISSED * (1.0 - self.confidence) * points)

    def visit(self, points: int) -> int:
        """How many of the candidates are visited in any case."""
        enough, budget = self.enough_for_all(points), self.measurements - self.references
        if budget >= points + (points - enough):
            return points
        if budget >= enough:
            return enough
        return math.ceil(VISITED * budget)

    def shortfall(self, points: int) -> Reason | None:
        """What a larger budget would be good for with so many candidates; None if nothing."""
        enough = self.enough_for_all(points) + self.references
        if self.measurements >= enough:
            return None
        excluded = excepted(points, self.visit(points), MISSED * (1.0 - self.confidence))
        return Reason("excepted_ahead", {"enough": enough, "excepted": excluded})

    def begin(self, candidates: Candidates) -> SearchAndConfirmCampaign:
        """A new campaign."""
        return SearchAndConfirmCampaign(self, candidates)


MISSED = 0.5  # of the allowed error, where candidates are left that may hold the largest
_VISIT_PART = 0.05  # of the lower bound's error, for single points until the average speaks
_ONCE = 0.6  # of the upper bound's error for the visit, where hardly any reading comes after it
_FEW = 0.25  # of the visit: with fewer readings after it, the visit has more of the error
_FREEDOM = 10  # a bump is a chi density with so many degrees: 23 % standard deviation
_STEP = 0.2  # distance of bumps in the logarithm of their scale
_SMALLEST, _LARGEST = 0.03, 0.8  # scales of the first and last bump over the largest reading
_ROUNDS = 50  # EM steps; many more would follow the noise of the readings
_NO_SIZE = 1e-12  # of the noise: what readings below it count as
_PSEUDO = 0.2  # points' worth of mass spread over the bumps before any reading


class SearchAndConfirmCampaign(Campaign):
    """A visit of ``first`` points, then blocks of readings up to a point's next look.

    After every block the point with the largest upper limit is read, among those whose next look
    the readings left can reach. What the block begins with is the point of the largest mean, its
    readings count for the lower bound; where no more readings are left than must still count, that
    point is read. Decisions go by means of whole blocks and planned noise: scatter within a block
    has no part in them. Beside these, readings go to reference poses, in their places of the
    sequence whatever is read.
    """

    settings: SearchAndConfirm

    def __init__(self, settings: SearchAndConfirm, candidates: Candidates) -> None:
        super().__init__(settings, candidates)
        points, rate = candidates.points, settings.wrong_rate
        self.first, self.allowed = settings.visit(points), 1.0 - settings.confidence
        self.blocks: list[int] = []  # of every reading in order the number of its block
        self.noise = CampaignNoise(settings, self.ledger, self.blocks, self.first)
        self.plan = schedule(settings.measurements, points, settings.references)
        self.reference_poses = self.plan.poses
        self.extra = settings.measurements - self.first - settings.references
        allowed = self.noise.mean_share * self.allowed
        self.counts = look_counts(self.extra)
        wanted = math.floor(SHARE * self.extra)
        lower_error = (1.0 - _VISIT_PART) * allowed if wanted else 0.0
        # Where the noise is an estimate, half of the error of single points is for its limit.
        self.single_error = allowed - lower_error
        single = self.single_error * (1.0 if math.isinf(self.noise.freedom) else 0.5)
        point_error, wrong = single / self.first, 0
        # Half for the first look, the rest by the readings added from look to look.
        added = np.diff(self.counts)
        shares = np.append(0.5, 0.5 * added / added.sum()) if len(added) else np.ones(1)
        if rate:
            # Half of the error of single points is for more wrong readings than are counted on.
            point_error *= 0.5
            wrong = int(binom.isf(0.5 * self.single_error, settings.measurements, rate))
        self.average = LowerAverage(wanted, lower_error, self.noise.freedom, rate)
        upper = self.boundary_of(allowed)
        margin, lower_errors = self.noise.margin, (point_error * shares).tolist()
        self.looks = Looks(self.ledger, upper, lower_errors, margin, rate, wrong)
        # The block under way: its row, readings it still takes, whether these count for the lower
        # bound and along which direction; its number, and whether the next reading begins it.
        self._row, self._left, self._counted = -1, 0, False
        self._direction = np.eye(3)[0]
        self._block, self._begins = 0, True
        self._mean_mm = np.zeros((points, 3))  # at the ends of blocks

    def boundary_of(self, error: float, freedom: float = math.inf) -> Boundary:
        """The boundary of the looks of this campaign for an error of the upper limits."""
        few = max(1.0 - self.extra / (_FEW * self.first), 0.0)
        early = EARLY + (_ONCE - EARLY) * few
        return boundary(self.counts, error, freedom, early, rate=self.settings.wrong_rate)

    def visit(self) -> tuple[int, ...]:
        """The first rows, with the reference poses in their places."""
        return self.plan.visit(self.first)

    def next(self) -> int | None:
        """The next point of the visit, then the point of the block."""
        if (planned := self.plan.row_at.get(self.ledger.taken)) is not None:
            return planned
        if (visited := len(self.ledger.visited)) < self.first:
            return visited
        return self._row if self._left else None

    def record(
        self, point: int, reading_mm: ArrayLike, covariance_mm2: ArrayLike | None = None
    ) -> None:
        """Take a reading, and look at the point where that is due."""
        ledger, place = self.ledger, self.ledger.taken
        ledger.record(point, reading_mm, covariance_mm2)
        is_planned, is_due = place in self.plan.row_at, self.looks.missing(point) == 0
        in_block = self._left > 0 and point == self._row
        if in_block and not is_planned:
            self._block, self._begins = self._block + self._begins, False
            self.blocks.append(self._block)
        else:
            self.blocks.append(-len(self.blocks) - 1)
        if in_block:
            self._left -= 1
            if self._counted and not is_planned:
                along, (_, reading, spread) = self._direction, ledger.readings[place]
                noise_mm = math.sqrt(float(along @ spread @ along))
                self.average.record(point, float(along @ reading), noise_mm)
                # A bound stated inside a block is of a mean of its own: a new block begins.
                self._begins = self.average.at_stage
        self.looks.update(point)
        # A planned reading ends a block only where the point is looked at.
        if is_due or not (self._left or is_planned):
            self._mean_mm[point] = ledger.mean_mm[point]
        remaining = self.settings.measurements - ledger.taken - self.plan.left(ledger.taken)
        if not self._left and len(ledger.visited) >= self.first and remaining > 0:
            self._begin_block(remaining)

    def repeats(self) -> Contrasts:
        """Differences within blocks, without those of a wrong reading where some may be."""
        return self.noise.telling

    def _begin_block(self, remaining: int) -> None:
        """Choose where the next readings are taken, and how many of them."""
        sizes_mm = np.linalg.norm(self._mean_mm, axis=1)
        missing, likely = self.average.missing, int(np.argmax(sizes_mm))
        row, count = likely, remaining
        if remaining > missing:
            for place in np.argsort(-self.looks.upper_mm[self.ledger.visited], kind="stable"):
                point = self.ledger.visited[place]
                wanted = self.looks.missing(point)
                if wanted <= (remaining if point == likely else remaining - missing):
                    row, count = point, int(wanted)
                    break
        else:
            count = int(min(remaining, self.looks.missing(likely)))
        # A mean of one reading is the largest more often by its noise than by its error.
        is_confirmed = self.ledger.count.item(row) > 1 or remaining <= missing
        self._counted = row == likely and missing > 0 and is_confirmed
        self._row, self._left = row, min(count, missing) if self._counted else count
        self._begins = True
        size_mm = sizes_mm.item(row)
        self._direction = self._mean_mm[row] / size_mm if size_mm > 0.0 else np.eye(3)[0]

    def statements(self) -> tuple[Statement, ...]:
        """On the measured points, and on all candidates."""
        ledger, settings = self.ledger, self.settings
        visited, points = len(ledger.visited), ledger.candidates.points
        if (open_points := math.ceil(FIRST_SHARE * self.first) - visited) > 0:
            early = Reason("first_visit", {"left": open_points})
            return Statement(MEASURED, withheld=early), Statement(CANDIDATES, withheld=early)
        sizes, noise_mm = ledger.sizes_mm(), ledger.noise_mm[ledger.visited]
        value_mm, value_of_all_mm = likely_largest_mm(sizes, noise_mm, points - visited)
        stated = [
            Statement(MEASURED, value_mm, error_of=settings.error_of),
            Statement(CANDIDATES, value_of_all_mm, error_of=settings.error_of),
        ]
        if missing := self.noise.missing():
            return tuple(replace(item, withheld=missing) for item in stated)
        noise = self.noise.taken(self.allowed)
        # Wrong readings withhold no bound where they are guarded against.
        guarded = "wrong_readings" if settings.wrong_rate else ""
        against = next((alarm for alarm in self.alarms() if alarm.code != guarded), None)
        stated = [replace(item, withheld=against, noise=noise.reason) for item in stated]
        if against is None:
            if self.average.has_spoken:
                lower_mm = self.average.bound_mm(noise.by_point)
            else:
                lower_mm = self.looks.largest_lower_mm(self._single_factor())
            lower_mm = max(lower_mm - settings.allowance_mm, 0.0)
            upper_mm = self._upper_mm(self.allowed, value_mm)
            sure = settings.confidence - settings.wrong_rate
            stated = [
                replace(item, lower_mm=lower_mm, upper_mm=upper_mm, confidence=sure)
                for item in stated
            ]
            if visited < points:
                number = excepted(points, visited, MISSED * self.allowed)
                least_mm = 0.0 if number else value_of_all_mm
                upper_mm = self._upper_mm((1.0 - MISSED) * self.allowed, least_mm)
                stated[1] = replace(stated[1], upper_mm=upper_mm, excepted=number)
        if settings.error_of == MEAN:
            return tuple(stated)
        arms_mm = self.noise.arms_mm(noise)
        return tuple(item.of_future_visits(arms_mm) for item in stated)

    def change(self) -> Change | None:
        """What the reference poses show of a drift or step; None where too few are read."""
        if not self.plan.poses:
            return None
        tested = math.inf if self.noise.is_known else self.settings.noise_freedom
        return find_change(self.plan, planned_readings(self.plan, self.ledger), tested)

    def point_limits(self) -> dict[int, tuple[float, float]]:
        """The limits that hold at every look, with the noise as bounds take it."""
        if self.noise.missing():
            return dict.fromkeys(self.ledger.visited, (0.0, math.inf))
        upper = self._limits_mm(self.allowed).tolist()
        lower = self.looks.lower_limits_mm(self._single_factor()).tolist()
        if self.settings.wrong_rate:
            lower = [0.0] * len(lower)  # any single point may have been read wrong
        return {row: (lower[row], upper[row]) for row in self.ledger.visited}

    def alarms(self) -> tuple[Reason, ...]:
        """What the readings say against what the bounds rest on."""
        alarms: list[Reason] = []
        if suspicious := self.suspicious():
            first = {"readings": len(suspicious), "number": suspicious[0].number}
            alarms.append(Reason("wrong_readings", first))
        # A few wrong readings look like too much scatter: what tells more comes first.
        if (change := self.change()) is not None and change.is_found:
            alarms.append(change.reason)
        return (*alarms, *self.noise.alarms())

    def suspicious(self) -> tuple[Suspicious, ...]:
        """Readings that stand apart from others of their point."""
        if self.noise.missing():
            return ()
        # Where all readings scatter more than stated, none is wrong for doing so too.
        factor = max(self.noise.taken(self.allowed).value, self.noise.usual_scatter())
        planned, freedom = self.extra + self.settings.references, self.noise.freedom
        return suspicious_readings(self.ledger, self.blocks, self.counts, planned, factor, freedom)

    def _limits_mm(self, error: float) -> np.ndarray:
        """Upper limits (m,) of single points for an allowed error."""
        limits = self.boundary_of(self.noise.mean_share * error, self.noise.freedom)
        return self.looks.limits_mm(limits, self.noise.taken(error).by_point)

    def _single_factor(self) -> np.ndarray:
        """Factors (m,) on the noise that lower limits of single points rest on."""
        limit = factor_limit(self.noise.freedom, 1.0 - 0.5 * self.single_error)
        return self.noise.taken(self.allowed).by_point * limit

    def _upper_mm(self, error: float, value_mm: float) -> float:
        """The largest upper limit of the visited points for an allowed error."""
        # Where unlucky readings put the bound below the likely size, that is the better bound.
        largest = max(float(self._limits_mm(error)[self.ledger.visited].max()), value_mm)
        return largest + self.settings.allowance_mm


def excepted(points: int, drawn: int, error: float) -> int:
    """Return the K that all but K points are no larger than the largest of ``drawn`` random ones.

    But for probability ``error``, whatever their errors are: K + 1 points are all missed with
    probability C(points - K - 1, drawn) / C(points, drawn).
    """
    missed, number = (points - drawn) / points, 0
    while missed > error:
        number += 1
        missed *= max(points - drawn - number, 0) / (points - number)
    return number


def likely_largest_mm(
    sizes_mm: np.ndarray, noise_mm: np.ndarray, unmeasured: int
) -> tuple[float, float]:
    """Posterior median of the largest true size, among measured points and among all, mm.

    Empirical Bayes: the density of the true sizes is a mixture of smooth bumps of fixed relative
    width, whose weights are fitted to the readings by maximum likelihood (EM). It gives values, not
    guarantees: it can raise an upper bound, never lower one.

    sizes_mm: (n,) sizes of mean readings; noise_mm: (n,) their standard deviations per axis;
    unmeasured: number of points without a reading, taken as drawn from the same population.
    Sizes go with the largest reading: where every reading is 0, so is every size.
    """
    top = float(sizes_mm.max())
    if top == 0.0:
        return 0.0, 0.0
    scale = top * np.exp(np.arange(np.log(_SMALLEST), np.log(_LARGEST), _STEP))
    # Sizes, fine up to a little above the largest reading and wider beyond.
    wide = np.geomspace(1.2 * top, 4.0 * top, 61)[1:]
    edges = np.concatenate([np.linspace(0.0, 1.2 * top, 361), wide])
    size, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    bumps = _chi_density(size, scale / np.sqrt(_FREEDOM)) * width
    bumps /= bumps.sum(axis=1, keepdims=True)
    likelihood = reading_densities(sizes_mm[:, None], noise_mm[:, None], size)
    by_bump = likelihood @ bumps.T
    pseudo = _PSEUDO / scale.size
    weight = np.full(scale.size, 1.0 / scale.size)
    for _ in range(_ROUNDS):
        # Every point's shares in the bumps, each in proportion to by_bump * weight, summed.
        weight = weight * ((1.0 / (by_bump @ weight)) @ by_bump) + pseudo
        weight /= weight.sum()
    prior = weight @ bumps
    posterior = np.cumsum(likelihood * prior, axis=1)
    measured = np.exp(np.log(np.maximum(posterior / posterior[:, -1:], 1e-300)).sum(axis=0))
    both = measured, measured * np.cumsum(prior) ** unmeasured
    among_measured, among_all = (float(np.interp(0.5, known / known[-1], size)) for known in both)
    return among_measured, among_all


def reading_densities(x: np.ndarray, noise: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Density (n, g) of readings of sizes x (n, 1) at true sizes (g,), up to a factor per reading.

    noise: (n, 1) standard deviations per axis; the largest value of every row is 1. Noncentral chi
    with three degrees of freedom: exp(-(x - a)^2 / 2) (1 - exp(-2 x a)) / a; of a reading of 0,
    what is left of the factor is in proportion to a.
    """
    gap = ((x - true) / noise) ** 2
    away = -np.expm1(-2.0 * np.maximum(x / noise, _NO_SIZE) * true / noise)
    density = np.exp(0.5 * (gap.min(axis=1, keepdims=True) - gap)) * away / true
    return density / density.max(axis=1, keepdims=True)


def _chi_density(size_mm: np.ndarray, unit_mm: np.ndarray) -> np.ndarray:
    """Chi densities (bumps, n) with units (bumps,), up to a factor per bump."""
    ratio = size_mm / unit_mm[:, None]
    log = (_FREEDOM - 1) * np.log(ratio) - 0.5 * ratio**2
    return np.exp(log - log.max(axis=1, keepdims=True))

"""The recommended assessor: look at every candidate once, confirm the suspects, say both bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from kinacc.assess.adaptive import FIRST_SHARE, AdaptiveAssessor, Candidates, check_settings
from kinacc.assess.confirming import ConfirmingCampaign
from kinacc.assess.counts import excepted, hardly_missed
from kinacc.assess.noise import (
    ENOUGH,
    ESTIMATED,
    FEWEST,
    KNOWN,
    CampaignNoise,
    factor_limit,
    noise_plan,
)
from kinacc.assess.population import LargestSize, largest_size
from kinacc.assess.reference_poses import (
    Change,
    found,
    planned_readings,
    poses_of,
)
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
from kinacc.assess.suspicious_readings import suspicious_readings

VISITED = 0.9  # of the budget, where it is smaller than the number of candidates
MARGIN = 1.2  # how much larger than stated noise may be that nothing can check
MOST_WRONG = 0.1  # of the readings: with more, clipped scores tell hardly anything
_MISSED = 0.5  # of the allowed error, where candidates are left that may hold the largest


@dataclass(frozen=True)
class SearchAndConfirm(AdaptiveAssessor):
    """Visit all candidates if the budget has readings for them; then confirm the likely largest.

    Readings left after the visit go, block by block, to the point with the largest upper limit
    whose next look they can reach, and a share of them to the largest mean, for the lower bound
    (:mod:`kinacc.assess.confirming`). With fewer readings than candidates nine tenths of them visit
    new points.

    ``measured``: upper limits that hold at all looks at once (:mod:`kinacc.assess.boundary`), and a
    lower bound by an average of readings along directions seen before
    (:mod:`kinacc.assess.lower_average`). Both hold whatever the errors are, for readings that are
    normal with known covariance (eq. 9). ``candidates``: the same where all are visited. Otherwise
    half of the allowed error is for the largest errors that all were missed: the upper bound is of
    all but the fewest candidates with which that is improbable enough, and assumes nothing but the
    random order.

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
    (:mod:`kinacc.assess.wrong_readings`): it is lost from the confidence. Without it, bounds are
    withheld where a reading stands apart (:mod:`kinacc.assess.suspicious_readings`). The value is
    the median of the posterior of :mod:`kinacc.assess.population`.
    """

    measurements: int
    confidence: float = CONFIDENCE
    noise: str = KNOWN
    noise_freedom: int = 0
    noise_margin: float = MARGIN
    wrong_rate: float = 0.0
    references: int = 0
    error_of: str = MEAN
    arm_mm: float | None = None
    allowance_mm: float = 0.0
    name: ClassVar[str] = "search_and_confirm"

    def __post_init__(self) -> None:
        known, arm, freedom = self.noise == KNOWN, self.arm_mm, self.noise_freedom
        tested = f"0 without a test before, or at least {FEWEST}; {ENOUGH} are asked for"
        guarded = "0 where the campaign estimates the noise, by readings that may be wrong"
        references = isinstance(self.references, (int, np.integer)) and self.references >= 0
        least = self.references + 2 * poses_of(self.references) if references else 0
        check_settings(
            self,
            ("noise", self.noise in (KNOWN, ESTIMATED), f"{KNOWN}, {ESTIMATED}"),
            ("error_of", self.error_of in (MEAN, VISIT), f"{MEAN}, {VISIT}"),
            ("noise_margin", 1.0 <= self.noise_margin <= 10.0, "from 1 to 10"),
            ("allowance_mm", 0.0 <= self.allowance_mm < math.inf, "0 or above, in mm"),
            ("noise_freedom", not (known and freedom), f"0 where noise is {KNOWN}"),
            ("noise_freedom", known or freedom == 0 or freedom >= FEWEST, tested),
            ("arm_mm", arm is None or self.error_of == VISIT, f"null: error_of is not {VISIT}"),
            ("arm_mm", arm is None or 0.0 <= arm < math.inf, "0 or above, in mm"),
            ("wrong_rate", 0.0 <= self.wrong_rate <= MOST_WRONG, f"from 0 to {MOST_WRONG}"),
            ("wrong_rate", known or freedom > 0 or not self.wrong_rate, guarded),
            ("references", references, "a whole number, 0 or more"),
            (
                "references",
                least <= self.measurements,
                f"fewer: they take {least} readings or more",
            ),
        )

    def enough_for_all(self, points: int) -> int:
        """Measurements with which the statement on all ``points`` candidates assumes nothing."""
        return hardly_missed(points, _MISSED * (1.0 - self.confidence))

    def visit(self, points: int) -> int:
        """How many of the candidates are visited in any case."""
        enough, own = self.enough_for_all(points), self.measurements - self.references
        if own >= points + (points - enough):
            return points
        if own >= enough:
            return enough
        return max(math.ceil(VISITED * own), 1)

    def shortfall(self, points: int, joints: int) -> Reason | None:
        """What a larger budget would be good for with so many candidates; None if nothing."""
        enough = self.enough_for_all(points) + self.references
        if self.measurements >= enough:
            return None
        left = excepted(points, self.visit(points), _MISSED * (1.0 - self.confidence))
        return Reason("excepted_ahead", {"enough": enough, "excepted": left})

    def begin(self, candidates: Candidates) -> SearchAndConfirmCampaign:
        """A new campaign."""
        return SearchAndConfirmCampaign(self, candidates)


class SearchAndConfirmCampaign(ConfirmingCampaign):
    """See :class:`SearchAndConfirm`."""

    settings: SearchAndConfirm

    def __init__(self, settings: SearchAndConfirm, candidates: Candidates) -> None:
        first = settings.visit(candidates.points)
        super().__init__(
            settings,
            candidates,
            first,
            noise_plan(settings, first),
            settings.wrong_rate,
            settings.references,
        )
        self.noise = CampaignNoise(settings, self.noise_plan, self.ledger, self.blocks, first)
        self._alarmed: tuple[int, tuple[Reason, ...]] = (-1, ())  # after so many readings
        self._changed: tuple[int, Change | None] = (-1, None)
        self._speaks_from = max(math.ceil(FIRST_SHARE * first), 1)

    def statements(self) -> tuple[Statement, ...]:
        """On the measured points, and on all candidates."""
        seen = len(self.ledger.visited)
        if seen < self._speaks_from:
            left = Reason("first_visit", {"left": self._speaks_from - seen})
            return Statement(MEASURED, withheld=left), Statement(CANDIDATES, withheld=left)
        against = self.noise.missing() or self._withheld()
        posterior = self._posterior()
        value_mm = posterior.quantile_mm(0.5, measured_only=True)
        if against:
            both = (MEASURED, value_mm), (CANDIDATES, posterior.quantile_mm(0.5))
            return tuple(self._as_asked(Statement(*each, withheld=against)) for each in both)
        said = Statement(
            MEASURED,
            value_mm=value_mm,
            lower_mm=self._lower_mm(),
            upper_mm=self._upper_mm(1.0 - self.settings.confidence, value_mm),
            confidence=self.settings.confidence - self.settings.wrong_rate,
        )
        both = said, self._about_candidates(said, posterior.quantile_mm(0.5))
        return tuple(self._as_asked(each) for each in both)

    def change(self) -> Change | None:
        """What the reference poses show of a drift or step; None where too few are read."""
        if self.ledger.taken < self.plan.poses or not self.plan.poses:
            return None
        if self._changed[0] != self.ledger.taken:
            tested = math.inf if self.settings.noise == KNOWN else self.settings.noise_freedom
            told = found(self.plan, planned_readings(self.plan, self.ledger), tested)
            self._changed = self.ledger.taken, told
        return self._changed[1]

    def point_limits(self) -> dict[int, tuple[float, float]]:
        """The limits that hold at every look, with the noise as bounds take it."""
        if self.noise.missing():
            return dict.fromkeys(self.ledger.visited, (0.0, math.inf))
        error = 1.0 - self.settings.confidence
        upper, single = self._limits_mm(error), self._single_factor()
        lower = self.looks.lower_limits_mm(single)
        if self.settings.wrong_rate:
            lower = np.zeros_like(lower)  # any single point may have been read wrong
        return {row: (float(lower[row]), float(upper[row])) for row in self.ledger.visited}

    def _as_asked(self, said: Statement) -> Statement:
        """A statement with the noise it rests on, and on future visits where these are meant."""
        if self.noise.missing():
            return replace(said, error_of=self.settings.error_of)
        noise = self.noise.taken(1.0 - self.settings.confidence)
        said = replace(said, noise=noise.said)
        if self.settings.error_of == MEAN:
            return said
        return said.of_future_visits(self.noise.arms_mm(noise))

    def _limits_mm(self, error: float) -> np.ndarray:
        """Upper limits (m,) of single points for an allowed error."""
        plan, own = self.noise_plan, self.noise.taken(error).own
        return self.looks.limits_mm(self.boundary_of(plan.mean_share * error, plan.freedom), own)

    def _single_factor(self) -> np.ndarray:
        """Factors (m,) on the noise that lower limits of single points rest on."""
        noise = self.noise.taken(1.0 - self.settings.confidence)
        return noise.own * factor_limit(noise.freedom, 1.0 - 0.5 * self.single_error)

    def alarms(self) -> tuple[Reason, ...]:
        """What the readings say against what the bounds rest on."""
        if self._alarmed[0] != self.ledger.taken:
            self._alarmed = self.ledger.taken, self._alarms()
        return self._alarmed[1]

    def _alarms(self) -> tuple[Reason, ...]:
        found: tuple[Reason, ...] = ()
        if suspicious := self.suspicious():
            first = {"readings": len(suspicious), "number": suspicious[0].number}
            found = (Reason("wrong_readings", first),)
        # A few wrong readings look like too much scatter: what tells more comes first.
        change = self.change()
        drift = (change.reason,) if change is not None and change.is_found else ()
        return (*found, *drift, *self.noise.alarms())

    def suspicious(self) -> tuple[Suspicious, ...]:
        """Readings that stand apart from others of their point."""
        if self.noise.missing():
            return ()
        # Where all readings scatter more than stated, none is wrong for doing so too.
        taken = self.noise.taken(1.0 - self.settings.confidence).value
        return suspicious_readings(
            self.ledger,
            self.blocks,
            self.counts,
            self.extra + self.settings.references,
            max(taken, self.noise.usual_scatter()),
            self.noise_plan.freedom,
        )

    def _withheld(self) -> Reason | None:
        """The alarm by which bounds are withheld; wrong readings are none where guarded against."""
        guarded = self.settings.wrong_rate > 0.0
        told = (each for each in self.alarms() if not (guarded and each.code == "wrong_readings"))
        return next(told, None)

    def _upper_mm(self, error: float, value_mm: float) -> float:
        """The largest upper limit of the visited points for an allowed error."""
        # Where unlucky readings put the bound below the likely size, that is the better bound.
        largest = max(float(self._limits_mm(error)[self.ledger.visited].max()), value_mm)
        return largest + self.settings.allowance_mm

    def _lower_mm(self) -> float:
        if self.average.has_spoken:
            own = self.noise.taken(1.0 - self.settings.confidence).own
            found = self.average.bound_mm(own)
        else:
            found = self.looks.largest_lower_mm(self._single_factor())
        return max(found - self.settings.allowance_mm, 0.0)

    def _about_candidates(self, said: Statement, value_mm: float) -> Statement:
        points, seen = self.ledger.candidates.points, len(self.ledger.visited)
        allowed = 1.0 - self.settings.confidence
        known = replace(said, target=CANDIDATES, value_mm=value_mm)
        if seen == points:
            return known
        left = excepted(points, seen, _MISSED * allowed)
        upper_mm = self._upper_mm((1.0 - _MISSED) * allowed, 0.0 if left else value_mm)
        return replace(known, upper_mm=upper_mm, excepted=left)

    def _posterior(self) -> LargestSize:
        ledger = self.ledger
        unmeasured = ledger.candidates.points - len(ledger.visited)
        return largest_size(ledger.sizes_mm(), ledger.noise_mm[ledger.visited], unmeasured)

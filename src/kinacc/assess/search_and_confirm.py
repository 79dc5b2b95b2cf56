"""The recommended assessor: look at every candidate once, confirm the suspects, say both bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinacc.assess.adaptive import AdaptiveAssessor, Candidates, check_settings
from kinacc.assess.confirming import MISSED, SearchAndConfirmCampaign
from kinacc.assess.counts import excepted, hardly_missed
from kinacc.assess.noise import ENOUGH, ESTIMATED, FEWEST, KNOWN
from kinacc.assess.reference_poses import poses_of
from kinacc.assess.statement import CONFIDENCE, MEAN, VISIT, Reason

VISITED = 0.9  # of the budget, where it is smaller than the number of candidates
MARGIN = 1.2  # how much larger than stated noise may be that nothing can check
MOST_WRONG = 0.1  # of the readings: with more, clipped scores tell hardly anything


@dataclass(frozen=True)
class SearchAndConfirm(AdaptiveAssessor):
    """Visit all candidates if the budget has readings for them; then confirm the likely largest.

    Readings left after the visit go, block by block, to the point with the largest upper limit
    whose next look they can reach, and a share of them to the largest mean, for the lower bound
    (:mod:`kinacc.assess.confirming`). With fewer readings than candidates nine tenths of them visit
    new points.

    ``measured``: upper limits that hold at all looks at once (:mod:`kinacc.assess.looks`), and a
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
            ("references", least <= self.measurements, f"fewer: they take {least} readings"),
        )

    def enough_for_all(self, points: int) -> int:
        """Measurements with which the statement on all ``points`` candidates assumes nothing."""
        return hardly_missed(points, MISSED * (1.0 - self.confidence))

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
        left = excepted(points, self.visit(points), MISSED * (1.0 - self.confidence))
        return Reason("excepted_ahead", {"enough": enough, "excepted": left})

    def begin(self, candidates: Candidates) -> SearchAndConfirmCampaign:
        """A new campaign."""
        return SearchAndConfirmCampaign(self, candidates)

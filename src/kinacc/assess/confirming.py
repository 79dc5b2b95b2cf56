"""Campaigns that visit points first and then confirm those that may be the largest."""

from __future__ import annotations

import math

import numpy as np

from kinacc.assess.adaptive import Campaign, Candidates
from kinacc.assess.looks import EARLY, Looks, boundary, look_counts
from kinacc.assess.lower_average import SHARE, LowerAverage, direction_of
from kinacc.assess.noise import NoisePlan
from kinacc.assess.reference_poses import schedule
from kinacc.assess.wrong_readings import at_most_wrong

_VISIT_PART = 0.05  # of the lower bound's error, for single points until the average speaks
_ONCE = 0.6  # of the upper bound's error for the visit, where hardly any reading comes after it
_FEW = 0.25  # of the visit: with fewer readings after it, the visit has more of the error


class ConfirmingCampaign(Campaign):
    """A visit of ``first`` points, then blocks of readings up to a point's next look.

    After every block the point with the largest upper limit is read, among those whose next look
    the readings left can reach. What the block begins with is the point of the largest mean, its
    readings count for the lower bound; where no more readings are left than must still count, that
    point is read. Decisions go by means of whole blocks and planned noise: scatter within a block
    has no part in them. ``references`` readings beside these go to reference poses, in their places
    of the sequence whatever is read.
    """

    def __init__(
        self,
        settings,
        candidates: Candidates,
        first: int,
        noise: NoisePlan | None = None,
        wrong_rate: float = 0.0,
        references: int = 0,
    ) -> None:
        super().__init__(settings, candidates)
        noise = noise or NoisePlan()
        self.first, self.noise_plan, self.factor = first, noise, noise.margin
        self.wrong_rate = wrong_rate
        self.plan = schedule(settings.measurements, candidates.points, references)
        self.reference_poses = self.plan.poses
        self.extra = max(settings.measurements - first - references, 0)
        allowed = noise.mean_share * (1.0 - settings.confidence)
        self.counts = look_counts(self.extra)
        wanted = math.floor(SHARE * self.extra) if self.extra > 1 else 0
        self.lower_error = (1.0 - _VISIT_PART) * allowed if wanted else 0.0
        upper = self.boundary_of(allowed)
        # Where the noise is an estimate, half of the error of single points is for its limit.
        self.single_error = allowed - self.lower_error
        single = self.single_error * (1.0 if math.isinf(noise.freedom) else 0.5)
        each = single / max(min(first, candidates.points), 1)
        shares = _first_most(np.diff(np.array(self.counts) / self.counts[-1], prepend=0.0))
        wrong = 0
        if wrong_rate:
            # Half of the error of single points is for more wrong readings than are counted on.
            each *= 0.5
            wrong = at_most_wrong(settings.measurements, wrong_rate, 0.5 * self.single_error)
        self.average = LowerAverage(wanted, self.lower_error, noise.freedom, wrong_rate)
        self.looks = Looks(self.ledger, upper, each, shares, self.factor, wrong_rate, wrong)
        self._row, self._left, self._counted = -1, 0, False
        self.blocks: list[int] = []  # of every reading in order the number of its block
        self._block, self._begins = 0, True
        self._direction = [1.0, 0.0, 0.0]
        self._mean_mm = [[0.0] * 3] * candidates.points  # at the ends of blocks
        self._size_mm = np.full(candidates.points, -1.0)  # of these

    def boundary_of(self, error: float, freedom: float = math.inf):
        """The boundary of the looks of this campaign for an error of the upper limits."""
        few = max(1.0 - self.extra / (_FEW * max(self.first, 1)), 0.0)
        early = EARLY + (_ONCE - EARLY) * few
        return boundary(self.counts, error, freedom, early, rate=self.wrong_rate)

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

    def record(self, point: int, reading_mm, covariance_mm2=None) -> None:
        """Take a reading, and look at the point where that is due."""
        taken = self.ledger.taken
        is_planned = taken in self.plan.row_at
        super().record(point, reading_mm, covariance_mm2)
        is_due = self.looks.missing(point) == 0
        in_block = bool(self._left) and point == self._row
        self.blocks.append(self._block_of(in_block and not is_planned))
        if in_block:
            self._left -= 1
            if self._counted and not is_planned:
                noise = self._noise_along(point, covariance_mm2)
                self.average.record(point, self._direction, self.ledger.readings[-1][1], noise)
                # A bound stated inside a block is of a mean of its own: a new block begins.
                self._begins = self.average.at_stage
        self.looks.update(point)
        # A planned reading ends a block only where the point is looked at.
        if is_due or not (self._left or is_planned):
            x, y, z = self._mean_mm[point] = self.ledger.mean_mm[point].tolist()
            self._size_mm[point] = math.sqrt(x * x + y * y + z * z)
        if not self._left and len(self.ledger.visited) >= self.first:
            left = self.settings.measurements - taken - 1 - self.plan.left(taken + 1)
            if left > 0:
                self._begin_block(left)

    def reading_blocks(self) -> list[int]:
        """Of every reading in order the number of its block."""
        return self.blocks

    def _block_of(self, in_block: bool) -> int:
        """The number of a reading's block: that under way, or one of its own."""
        if not in_block:
            return -len(self.blocks) - 1
        if self._begins:
            self._block, self._begins = self._block + 1, False
        return self._block

    def _begin_block(self, left: int) -> None:
        """Choose where the next readings are taken, and how many of them."""
        missing = self.average.missing
        likely = int(np.argmax(self._size_mm))
        row, count = likely, left
        if left > missing:
            for each in np.argsort(-self.looks.upper_mm[self.ledger.visited], kind="stable"):
                point = self.ledger.visited[each]
                wanted = self.looks.missing(point)
                if wanted <= (left if point == likely else left - missing):
                    row, count = point, int(wanted)
                    break
        else:
            count = int(min(left, self.looks.missing(likely)))
        # A mean of one reading is the largest more often by its noise than by its error.
        is_confirmed = self.ledger.count.item(row) > 1 or left <= missing
        self._counted = row == likely and missing > 0 and is_confirmed
        if self._counted:
            count = min(count, missing)
        self._row, self._left, self._begins = row, count, True
        self._direction = direction_of(self._mean_mm[row])

    def _noise_along(self, point: int, covariance_mm2) -> float:
        """Standard deviation of a reading along the direction of its block."""
        planned = self.ledger.candidates.covariance_mm2[point]
        own = planned if covariance_mm2 is None else covariance_mm2
        along = np.array(self._direction)
        return math.sqrt(float(along @ np.asarray(own) @ along))


def _first_most(shares: np.ndarray) -> np.ndarray:
    """Parts of a point's allowed lower error by look, half of it for the first."""
    if len(shares) == 1:
        return np.ones(1)
    return np.concatenate([[0.5], 0.5 * shares[1:] / shares[1:].sum()])

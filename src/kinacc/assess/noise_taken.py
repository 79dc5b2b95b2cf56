"""How large the bounds of a campaign take the noise, and what its readings say against that."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from kinacc.assess.adaptive import Ledger
from kinacc.assess.noise_alarms import BESIDE_REFERENCES, SCATTER, scatter_alarm, tails_alarm
from kinacc.assess.noise_factor import (
    CHECKED,
    ENOUGH,
    FEWEST,
    Contrasts,
    NoiseFactor,
    contrasts,
    estimated_factor,
    estimating_freedom,
    known_factor,
    largest_factor,
    planned_freedom,
)
from kinacc.assess.statement import VISIT, Reason
from kinacc.errors import Problem

if TYPE_CHECKING:
    from kinacc.assess.search_and_confirm import SearchAndConfirm

KNOWN, ESTIMATED = "known", "estimated"
_NOISE_PART = 0.2  # of an allowed error, where the noise itself has to be bounded
_MEDIAN = 2.366  # of a chi-square with three degrees of freedom
_CLEARLY = 1.7  # three standard deviations of the root of the median of one, over that median's
_FAR = 16.27  # squared contrast that one in a thousand exceeds: no scatter where some are wrong


@dataclass(frozen=True)
class NoiseTaken:
    """Factor on the noise planned, for bounds.

    ``factor``: for limits on means; ``least`` and ``most``: what the noise itself is not below and
    not above; ``said``: how all this was had, None where the noise is as stated.
    """

    factor: NoiseFactor
    least: float
    most: float
    said: Reason | None


@dataclass(frozen=True)
class NoisePlan:
    """What is known of the noise before anything is read.

    ``margin``: times the noise stated that bounds allow for. ``freedom``: degrees of freedom that
    limits on means are calibrated with, infinite where the factor is no estimate; ``estimating``:
    of the campaign's own, 0 where a test brings them. ``is_bounded``: nothing but the size of
    readings says how large the noise may be. ``mean_share``: part of an allowed error that limits
    on means may spend; the rest is for limits of the noise. ``limited``: degrees of freedom of the
    test whose upper limit is taken for the noise, where readings may be wrong; else 0.
    """

    margin: float = 1.0
    freedom: float = math.inf
    estimating: int = 0
    is_bounded: bool = False
    mean_share: float = 1.0
    limited: int = 0


AS_STATED = NoisePlan()


def noise_plan(settings: SearchAndConfirm, first: int) -> NoisePlan:
    """Of a campaign that visits ``first`` points."""
    spare = max(settings.measurements - first - settings.references, 0)
    if settings.noise == KNOWN:
        checked = planned_freedom(spare) >= CHECKED
        return NoisePlan(margin=1.0 if checked else settings.noise_margin)
    if settings.wrong_rate:
        # The law of clipped scores is known for a stated noise alone, or one that is no larger.
        return NoisePlan(mean_share=1.0 - _NOISE_PART, limited=settings.noise_freedom)
    estimating = 0 if settings.noise_freedom else estimating_freedom(spare)
    freedom = settings.noise_freedom or estimating
    if not freedom:
        return NoisePlan(is_bounded=True, mean_share=1.0 - _NOISE_PART)
    of_arm = settings.error_of == VISIT and settings.arm_mm is None
    share = 1.0 - _NOISE_PART if of_arm else 1.0
    return NoisePlan(freedom=freedom, estimating=estimating, mean_share=share)


def noise_faults(settings: SearchAndConfirm) -> list[Problem]:
    """What of the settings of noise and of the arm's own share in it cannot be."""
    problems, freedom, arm = [], settings.noise_freedom, settings.arm_mm
    if freedom and settings.noise == KNOWN:
        problems.append(Problem("noise_freedom", f"{freedom}", f"0 where noise is {KNOWN}"))
    elif freedom != 0 and not freedom >= FEWEST:
        allowed = f"0 without a test before, or at least {FEWEST}; {ENOUGH} are asked for"
        problems.append(Problem("noise_freedom", f"{freedom}", allowed))
    if arm is not None and settings.error_of != VISIT:
        problems.append(Problem("arm_mm", f"{arm}", f"nothing where error_of is not {VISIT}"))
    elif arm is not None and not 0.0 <= arm < math.inf:
        problems.append(Problem("arm_mm", f"{arm}", "0 or above, in mm"))
    return problems


class CampaignNoise:
    """The noise of one campaign, by its settings and the readings of its ledger.

    ``blocks``: of every reading of the ledger the number of its block.
    """

    def __init__(
        self,
        settings: SearchAndConfirm,
        plan: NoisePlan,
        ledger: Ledger,
        blocks: Sequence[int],
        first: int,
    ) -> None:
        self.settings, self.plan, self.ledger = settings, plan, ledger
        self.first, self._blocks = first, blocks
        self._known: tuple[int, Contrasts] | None = None

    @property
    def contrasts(self) -> Contrasts:
        """Differences within the blocks of all readings so far."""
        taken = self.ledger.taken
        if self._known is None or self._known[0] != taken:
            self._known = taken, contrasts(self.ledger, self._blocks)
        return self._known[1]

    @property
    def telling(self) -> Contrasts:
        """Those that tell of the noise: of blocks without a wrong reading, where some may be."""
        if self.settings.wrong_rate > 0.0:
            return without_wrong_blocks(self.contrasts, self._blocks)
        return self.contrasts

    def missing(self) -> Reason | None:
        """Why the noise is not known yet; None where it is."""
        if self.plan.estimating and self.contrasts.freedom < self.plan.estimating:
            found = {"freedom": self.contrasts.freedom, "needed": self.plan.estimating}
            return Reason("noise_unknown", found)
        if self.plan.is_bounded and len(self.ledger.visited) < self.first:
            return Reason("first_visit", {"left": self.first - len(self.ledger.visited)})
        return None

    def taken(self, error: float) -> NoiseTaken:
        """The noise for bounds that may err with this probability; not where it is ``missing``."""
        points = self.ledger.candidates.points
        if self.settings.noise == KNOWN:
            most, said = self._stated_or_shown()
            return NoiseTaken(known_factor(points, most), 1.0, most, said)
        part = _NOISE_PART * error
        if self.plan.is_bounded:
            rows, readings = self._first_readings()
            most = largest_factor(self.ledger.candidates, rows, readings, part)
            said = Reason("noise_bounded", {"factor": most})
            return NoiseTaken(known_factor(points, most), 0.0, most, said)
        if self.plan.limited:
            tested = replace(known_factor(points), freedom=self.plan.limited)
            least, most = tested.at_least(part), tested.at_most(part)
            said = Reason("noise_limited", {"factor": most, "freedom": self.plan.limited})
            return NoiseTaken(known_factor(points, most), least, most, said)
        factor = estimated_factor(self.contrasts, self.plan.estimating, points, self.plan.freedom)
        numbers = {"factor": factor.value, "freedom": self.plan.freedom}
        said = Reason("noise_tested", numbers)
        if self.plan.estimating:
            said = Reason("noise_estimated", numbers)
        return NoiseTaken(factor, factor.at_least(part), factor.at_most(part), said)

    def alarms(self) -> tuple[Reason, ...]:
        """What readings of the same block say against the noise stated, and against normal ones."""
        found, scatter = self.telling, None
        tails = None if self.settings.wrong_rate > 0.0 else tails_alarm(found)
        if not self.plan.estimating and not self.plan.is_bounded:
            scatter = scatter_alarm(
                found,
                tested=self.settings.noise_freedom or math.inf,
                margin=self.plan.margin,
                false=false_scatter(self.settings.references),
            )
        return tuple(each for each in (scatter, tails) if each is not None)

    def usual_scatter(self) -> float:
        """Factor on the noise planned that most differences within blocks have; 0 where few are.

        By their median, which a few wrong readings do not turn, and only where it is clearly above
        what is planned: the chance of a false suspicion is never larger by it.
        """
        squares = np.sum(self.contrasts.values**2, axis=1)
        if 3 * len(squares) < FEWEST:
            return 0.0
        usual = math.sqrt(float(np.median(squares)) / _MEDIAN)
        return usual if usual > 1.0 + _CLEARLY / math.sqrt(len(squares)) else 0.0

    def arms_mm(self, noise: NoiseTaken) -> tuple[float, float, float]:
        """The arm's own standard deviation: at least, likely, at most."""
        if self.settings.arm_mm is not None:
            return (self.settings.arm_mm,) * 3
        visited, own = self.ledger.visited, noise.factor.own / noise.factor.value
        variances = np.linalg.eigvalsh(self.ledger.candidates.covariance_mm2[visited])
        unknown = self.plan.is_bounded or self.settings.noise == KNOWN
        likely = float(np.sqrt(variances.mean())) * (1.0 if unknown else noise.factor.value)
        least = noise.least * math.sqrt(float(variances.min()))
        most = noise.most * float((own[visited] * np.sqrt(variances[:, -1])).max())
        return least, likely, most

    def _stated_or_shown(self) -> tuple[float, Reason | None]:
        """Factor on a noise that is stated: what bounds allow for, or more where repeats show more.

        Where the noise is as stated, bounds are never less sure for being wider.
        """
        found, margin = self.telling, self.plan.margin
        shown = math.sqrt(float(np.sum(found.values**2)) / max(found.freedom, 1))
        if found.freedom >= FEWEST and shown > margin:
            return shown, Reason("noise_shown", {"factor": shown, "freedom": found.freedom})
        return margin, Reason("noise_margin", {"margin": margin}) if margin > 1.0 else None

    def _first_readings(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows (first,) and first readings (first, 3) of the visit."""
        read: dict[int, list[float]] = {}
        for row, reading, _ in self.ledger.readings:
            read.setdefault(row, reading)
        rows = self.ledger.visited[: self.first]
        return np.array(rows), np.array([read[row] for row in rows])


def false_scatter(references: int) -> float:
    """Probability that noise as stated is ever called larger, beside so many references."""
    return BESIDE_REFERENCES if references else SCATTER


def without_wrong_blocks(found: Contrasts, blocks: Sequence[int]) -> Contrasts:
    """Differences of blocks without a reading far off, ``blocks`` being those of all readings.

    Readings that go wrong and are guarded against tell nothing of the noise of others; one is in
    many differences of its block.
    """
    own = np.asarray(blocks)[found.places]
    near = ~np.isin(own, own[np.sum(found.values**2, axis=1) > _FAR])
    return Contrasts(found.rows[near], found.places[near], found.values[near])

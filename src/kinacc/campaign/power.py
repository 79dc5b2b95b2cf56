"""What budgets bring: widths, and how often a wanted width or a decision is reached."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinacc.assess.conformity import ACCEPT, REJECT, UNDECIDED, decide
from kinacc.assess.counts import binomial_interval
from kinacc.campaign.simulate import Outcome, quantiles

VERDICTS = (ACCEPT, REJECT, UNDECIDED)
_MOST_REPETITIONS = 2000


@dataclass(frozen=True)
class Aim:
    """What is wanted of a campaign: bounds on ``target`` no further apart than ``width_mm``, or a
    decision on ``tolerance_mm`` (None: not asked for), with probability ``power``."""

    target: str
    width_mm: float | None = None
    tolerance_mm: float | None = None
    power: float = 0.8


@dataclass(frozen=True)
class Row:
    """Simulated campaigns of one budget on one kind of errors.

    ``width_mm``: 5, 50 and 95 % quantiles of upper minus lower bound, 0 where they contradict each
    other (infinite: no bound).
    ``stated``: share with an upper bound. Of the upper bounds stated: ``excess_mm``, mean of bound
    minus truth, and ``holds``, share at or above the truth (NaN where there are none); ``judged``
    is how many these are, ``holding`` how many of them hold.
    ``attainable_mm``, ``proven_mm``: the same excess of the best design that knows all errors, and
    what no bound that can be relied on stays below; NaN or infinite where none can be had.
    ``within``: share whose width is as wanted, ``interval`` its exact 95 % limits.
    ``decisions``: share by decision on the tolerance.
    """

    errors: str
    budget: int
    readings: float
    repetitions: int
    truth_mm: float
    width_mm: tuple[float, float, float]
    excess_mm: float
    holds: float
    stated: float
    within: float
    interval: tuple[float, float]
    decisions: dict[str, float]
    judged: int = 0
    holding: int = 0
    attainable_mm: float = math.nan
    proven_mm: float = math.nan

    @property
    def holds_interval(self) -> tuple[float, float]:
        """Exact 95 % limits of ``holds``; NaN where no bound is judged."""
        if not self.judged:
            return math.nan, math.nan
        return binomial_interval(self.holding, self.judged)

    def reaches(self, aim: Aim) -> float:
        """Share of campaigns that do what is wanted: the width, the right decision, or both."""
        shares = []
        if aim.width_mm is not None:
            shares.append(self.within)
        if aim.tolerance_mm is not None:
            shares.append(1.0 - self.decisions[UNDECIDED])
        return min(shares, default=self.stated)

    def shows(self, aim: Aim) -> float:
        """Share that so many campaigns show to do what is wanted, with 97.5 % confidence."""
        return binomial_interval(round(self.reaches(aim) * self.repetitions), self.repetitions)[0]


def rows(found: Sequence[Outcome], aim: Aim) -> list[Row]:
    """Summary of simulated campaigns, by errors and budget in the order they came."""
    groups: dict[tuple[str, int], list[Outcome]] = {}
    for each in found:
        if each.said.target == aim.target:
            groups.setdefault((each.field, each.budget), []).append(each)
    return [_row(errors, budget, group, aim) for (errors, budget), group in groups.items()]


def smallest_budget(found: Sequence[Row], aim: Aim, shown: bool = False) -> int | None:
    """The smallest budget that reaches the aim with the wanted power on all errors; None if none.

    A larger budget that was simulated must reach it as well. ``shown``: the campaigns simulated
    have to show it, and not only to do so often enough.
    """
    share = Row.shows if shown else Row.reaches
    enough = None
    for budget in sorted({row.budget for row in found}, reverse=True):
        if any(share(row, aim) < aim.power for row in found if row.budget == budget):
            break
        enough = budget
    return enough


def repetitions_to_show(share: float, power: float) -> int | None:
    """The fewest campaigns of which a ``share`` shows ``power`` with 97.5 % confidence; None if
    that takes more than is worth simulating."""
    for count in range(2, _MOST_REPETITIONS + 1):
        hits = math.floor(share * count + 1e-9)
        if binomial_interval(hits, count)[0] >= power:
            return count
    return None


def _row(errors: str, budget: int, group: list[Outcome], aim: Aim) -> Row:
    count = len(group)
    stated = [each for each in group if not math.isnan(each.said.upper_mm)]
    holds = [each.said.upper_mm >= each.truth_mm for each in stated]
    wanted = math.inf if aim.width_mm is None else aim.width_mm
    within = sum(each.width_mm <= wanted for each in stated)
    said = []
    if aim.tolerance_mm is not None:
        said = [decide(each.said, aim.tolerance_mm).verdict for each in group]
    return Row(
        errors,
        budget,
        float(np.mean([each.readings for each in group])),
        count,
        float(np.mean([each.truth_mm for each in group])),
        tuple(quantiles([max(each.width_mm, 0.0) for each in group], (0.05, 0.5, 0.95))),
        _mean([each.said.upper_mm - each.truth_mm for each in stated]),
        _mean(holds),
        len(stated) / count,
        within / count,
        binomial_interval(within, count),
        {kind: said.count(kind) / count for kind in VERDICTS} if said else {},
        len(holds),
        sum(holds),
        _mean([each.limits.attainable_mm for each in stated]),
        _mean([each.limits.proven_mm for each in stated]),
    )


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else math.nan

"""What a claim is: a statement of the paper, the statistic that tests it, and the verdict rule."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from kinacc.tables.columns import Columns

Tables = Mapping[str, Columns]


@dataclass(frozen=True)
class Finding:
    """A statistic and, for a sentence, whether the sentence holds (None: cannot be told)."""

    value: float
    holds: bool | None = None


@dataclass(frozen=True)
class Claim:
    """One checkable statement.

    ``statistic`` says in words what is computed and when the statement holds; ``evidence`` names
    the artefacts it is computed from and nothing else. A claim with a ``paper`` value agrees when
    the value is met within ``tolerance`` (same unit); a sentence agrees when its finding holds.
    ``arm_specific`` claims compare with the paper's own arm and say nothing on another robot. A
    sentence that was ``used_to_choose`` a reading of the paper is no evidence for it.
    """

    id: str
    statement: str
    statistic: str
    evidence: tuple[str, ...]
    compute: Callable[[Tables], Finding]
    paper: float = math.nan
    tolerance: float = math.nan
    arm_specific: bool = False
    used_to_choose: bool = False


def verdict(claim: Claim, finding: Finding) -> str:
    """``agrees``, ``differs`` or ``not comparable`` for a finding under the claim's own rule."""
    if finding.holds is not None:
        return "agrees" if finding.holds else "differs"
    if math.isnan(finding.value) or math.isnan(claim.tolerance):
        return "not comparable"
    # A value on the tolerance's edge agrees: the tolerance is part of the claim, rounding is not.
    slack = 1e-12 * max(1.0, abs(claim.paper))
    return "agrees" if abs(finding.value - claim.paper) <= claim.tolerance + slack else "differs"


def above(value: float, limit: float) -> Finding:
    """Holds when the value exceeds the limit; a NaN cannot be told."""
    return Finding(value, None if math.isnan(value) else value > limit)


def below(value: float, limit: float) -> Finding:
    """Holds when the value stays under the limit; a NaN cannot be told."""
    return Finding(value, None if math.isnan(value) else value < limit)


def within(value: float, limit: float) -> Finding:
    """Holds when the value's magnitude is at most the limit; a NaN cannot be told."""
    return Finding(value, None if math.isnan(value) else abs(value) <= limit)


def positive(value: float) -> Finding:
    """Holds when the value is above zero; a NaN cannot be told."""
    return above(value, 0.0)


def negative(value: float) -> Finding:
    """Holds when the value is below zero; a NaN cannot be told."""
    return below(value, 0.0)

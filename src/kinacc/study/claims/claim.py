"""What a claim is: a statement of the paper, the statistic that tests it, and the verdict rule."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from kinacc.tables.columns import Columns

Tables = Mapping[str, Columns]
Statistic = Callable[[Tables], float]
SENTENCES = Path(__file__).with_name("sentences.yaml")
_RULES: dict[str, Callable[[float, float], bool]] = {
    ">": operator.gt,
    ">=": operator.ge,
    "<": operator.lt,
    "<=": operator.le,
    "+-": lambda value, limit: abs(value) <= limit,
}


@dataclass(frozen=True)
class Claim:
    """One checkable statement.

    ``statistic`` says in words what ``compute`` computes (NaN where it cannot) and when the
    statement holds; ``evidence`` is the artefact it is computed from. A claim with a ``paper``
    value agrees when the value is met within ``tolerance`` (same unit); a sentence agrees when its
    value ``holds`` (a rule and its limit, as ``> 0``). ``arm_specific`` claims compare with the
    paper's own arm and say nothing on another robot. A sentence that was ``used_to_choose`` a
    reading of the paper is no evidence for it.
    """

    id: str
    statement: str
    statistic: str
    evidence: str
    compute: Statistic
    paper: float = math.nan
    tolerance: float = math.nan
    holds: str = ""
    arm_specific: bool = False
    used_to_choose: bool = False


def sentences(section: str, compute: Mapping[str, Statistic]) -> list[Claim]:
    """Claims of a section of ``sentences.yaml``, with the function that computes each."""
    stated: dict[str, dict[str, Any]] = yaml.safe_load(SENTENCES.read_text("utf-8"))[section]
    return [Claim(name, compute=compute[name], **fields) for name, fields in stated.items()]


def verdict(claim: Claim, value: float) -> str:
    """``agrees``, ``differs`` or ``not comparable`` for a value under the claim's own rule."""
    if math.isnan(value) or not (claim.holds or claim.tolerance >= 0.0):
        return "not comparable"
    if claim.holds:
        rule, limit = claim.holds.split()
        agrees = _RULES[rule](value, float(limit))
    else:
        # A value on the tolerance's edge agrees: the tolerance is part of the claim.
        slack = 1e-12 * max(1.0, abs(claim.paper))
        agrees = abs(value - claim.paper) <= claim.tolerance + slack
    return "agrees" if agrees else "differs"

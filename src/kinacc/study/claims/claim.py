"""What a claim is: a statement of the paper, the statistic that tests it, and the verdict rule."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from kinacc.tables.columns import Tables

HERE = Path(__file__).parent
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

    ``statistic`` says in words what its value is and when the statement holds; ``evidence`` is the
    artefact it is computed from. A claim with a ``paper`` value agrees when the value is met within
    ``tolerance`` (same unit); a sentence agrees when its value ``holds`` (a rule and its limit, as
    ``> 0``). ``arm_specific`` claims compare with the paper's own arm and say nothing on another
    robot: all numbers, each compared with the first cell of ``column`` in the rows ``where`` a
    condition holds. A sentence that was ``used_to_choose`` a reading of the paper is no evidence
    for it.
    """

    id: str
    statement: str
    statistic: str
    evidence: str
    paper: float = math.nan
    tolerance: float = math.nan
    holds: str = ""
    arm_specific: bool = False
    used_to_choose: bool = False
    where: str = ""
    column: str = ""


@cache
def sentences() -> dict[str, list[Claim]]:
    """Claims of ``sentences.yaml`` by section: ``map``, ``study`` and ``history``."""
    stated: dict[str, dict[str, dict[str, Any]]]
    stated = yaml.safe_load((HERE / "sentences.yaml").read_text("utf-8"))
    return {
        section: [Claim(name, **fields) for name, fields in claims.items()]
        for section, claims in stated.items()
    }


@cache
def number_claims() -> list[Claim]:
    """Claims on every number of Tables I to III and on the true accuracy: ``numbers.csv``.

    Theta 5 of Table II is read as q5 - 3.141 (printed 3.114 would turn the wrist by 1.6 degrees).
    Axes 2 and 3 are antiparallel: of d2 and d3 only the difference can be seen.
    """
    rows = pd.read_csv(HERE / "numbers.csv").to_dict("records")
    return [Claim(arm_specific=True, **row) for row in rows]


def number_values(tables: Tables) -> dict[str, float]:
    """Values of the numbers whose evidence is there; an angle by the turn nearest to the paper."""
    values = {}
    for claim in number_claims():
        if claim.evidence in tables:
            rows = pd.DataFrame(dict(tables[claim.evidence]))
            cells = rows.eval(claim.column)[rows.eval(claim.where)]
            value = float(cells.iloc[0]) if len(cells) else math.nan
            if claim.column.endswith("_rad"):
                value = claim.paper + math.remainder(value - claim.paper, 2.0 * math.pi)
            values[claim.id] = value
    return values


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

"""What a claim is: a statement of the paper, the statistic that tests it, and the verdict rule."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from kinacc.tables.columns import Tables

Statistic = Callable[[Tables], float]
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


@lru_cache(maxsize=1)
def _stated() -> dict[str, dict[str, dict[str, Any]]]:
    stated: dict[str, dict[str, dict[str, Any]]]
    stated = yaml.safe_load((HERE / "sentences.yaml").read_text("utf-8"))
    return stated


def sentences(section: str, compute: Mapping[str, Statistic]) -> list[Claim]:
    """Claims of a section of ``sentences.yaml``, with the function that computes each."""
    stated = _stated()[section]
    return [Claim(name, compute=compute[name], **fields) for name, fields in stated.items()]


def number_claims() -> list[Claim]:
    """Claims on every number of Tables I to III and on the true accuracy: ``numbers.csv``.

    Of ``where`` and ``column`` the cell that a number is compared with. Theta 5 of Table II is read
    as q5 - 3.141 (printed 3.114 would turn the wrist by 1.6 degrees). Axes 2 and 3 are
    antiparallel: of d2 and d3 only the difference can be seen.
    """
    claims = []
    for row in pd.read_csv(HERE / "numbers.csv").to_dict("records"):
        where, column = row.pop("where"), row.pop("column")
        compute = _cell(row["evidence"], where, column, row["paper"])
        claims.append(Claim(compute=compute, arm_specific=True, **row))
    return claims


def _cell(evidence: str, where: str, column: str, paper: float) -> Statistic:
    """The first cell of a column where a condition holds; an angle by the turn nearest to paper."""

    def compute(tables: Tables) -> float:
        rows = pd.DataFrame(dict(tables[evidence]))
        cells = rows.eval(column)[rows.eval(where)]
        value = float(cells.iloc[0]) if len(cells) else math.nan
        turned = paper + math.remainder(value - paper, 2.0 * math.pi)
        return turned if column.endswith("_rad") else value

    return compute


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

"""The paper beside what was recomputed: Tables I to III, and every claim with its verdict."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from kinacc.kinematics.robot import Robot
from kinacc.report.page import Part, records
from kinacc.tables.allowed import VERDICTS
from kinacc.tables.columns import Columns

_DIFFERS = VERDICTS[1]
_STATISTICS = {"mean": "mean", "max": "largest", "gamma99": "99 % gamma"}
_PARAMETERS = ("theta_offset", "d", "a", "alpha")


def tables_section(tables: Mapping[str, Columns], robot: Robot) -> Part:
    """The section of a page on Tables I to III, as ``claims`` holds them beside the paper's."""
    known = {each["claim"]: each for each in records(tables["claims"])}
    residuals = {
        table: [
            _row(f"{what}, {unit}", known, f"{table}_{what}_{{}}", _STATISTICS)
            for what, unit in (("position", "mm"), ("orientation", "mrad"))
        ]
        for table in ("table1", "table3")
    }
    parameters = [
        _row(joint, known, f"table2_{{}}_{joint}", _PARAMETERS)
        for joint in range(1, 1 + sum(name.startswith("table2_alpha_") for name in known))
    ]
    values = {
        **residuals,
        "table2": parameters,
        "statistics": _STATISTICS,
        "apart": known["table2_d_2_minus_d_3"],
    }
    return Part("paper-tables", values)


def _row(first: object, known: Mapping[str, dict], pattern: str, names: Iterable[str]) -> dict:
    """Pairs of the paper's number and the one here; the remark names those that differ."""
    claims = {name: known[pattern.format(name)] for name in names}
    row = {"of": first}
    for name, claim in claims.items():
        row |= {f"{name}_paper": claim["paper"], f"{name}_here": claim["reproduced"]}
    differs = [name for name, claim in claims.items() if claim["verdict"] == _DIFFERS]
    if differs:
        words = ", ".join(_STATISTICS.get(name, name.partition("_")[0]) for name in differs)
        row["remark"] = f"{words} differs"
    return row


def claims_section(tables: Mapping[str, Columns], robot: Robot) -> Part:
    """The section of a page on every row of ``claims``, those that differ first."""
    claims = tables["claims"]
    chose = np.asarray(claims["used_to_choose"], dtype=bool)
    verdicts = list(claims["verdict"][~chose])
    counts = ", ".join(f"{verdicts.count(name)} {name}" for name in VERDICTS)
    counted = f"{len(verdicts)} claims: {counts}"
    if chose.any():
        counted += f" ({chose.sum()} that chose a reading are not counted)"
    return Part("claims", {"claims": records(claims), "counted": counted})

"""The paper beside what was recomputed: Tables I to III, and every claim with its verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from kinacc.artifacts.allowed import VERDICTS
from kinacc.artifacts.columns import Columns
from kinacc.kinematics.robot import Robot
from kinacc.report.page import Block, Section, Table, Text
from kinacc.study.summary import claims_counted

_AGREES, _DIFFERS, _NOT_COMPARABLE = VERDICTS
_STATISTICS = (("mean", "mean"), ("max", "largest"), ("gamma99", "99 % gamma"))
_RESIDUALS = (
    ("table1", "Table I: VEC model and robot, at the poses the model was fitted to"),
    ("table3", "Table III: DH and VEC model, at the poses both were fitted to"),
)
_QUANTITIES = (("position", "position, mm"), ("orientation", "orientation, mrad"))
_PARAMETERS = (
    ("theta_offset", "theta, rad"), ("d", "d, mm"), ("a", "a, mm"), ("alpha", "alpha, rad"),
)  # fmt: skip
_HERE = "on this synthetic arm; the paper's own measurements are not public"


def tables_section(tables: Mapping[str, Columns], robot: Robot) -> Section:
    """The section of a page on Tables I to III, as ``claims`` holds them beside the paper's."""
    known = _by_name(tables["claims"])
    one, three = (_residuals(known, *each) for each in _RESIDUALS)
    return Section(
        "paper-tables",
        "Tables I to III of the paper",
        f"Fits {_HERE}. Tables I and III are about poses that were fitted, which flatters: the "
        "errors of poses no fit has seen stand under Residuals",
        "Each number of the paper beside the one recomputed here.",
        "Good: every pair agrees within the tolerance (10 % in Tables I and III; in Table II "
        "1 mm and 0.003 rad); one that does not is named at the right of its row. The arm was "
        "chosen to meet these tables, so that they agree is no finding of its own.",
        "Nothing, where all agree. Where one differs, look at its claim below and at the arm: "
        "another draw of it is under measurements.synthetic.",
        (one, _parameters(known), three),
    )


def claims_section(tables: Mapping[str, Columns], robot: Robot) -> Section:
    """The section of a page on every row of ``claims``, those that differ first."""
    claims = tables["claims"]
    chose = np.flatnonzero(claims["used_to_choose"])
    return Section(
        "claims",
        "Claims of the paper",
        f"{len(claims['claim'])} numbers and sentences of the paper, each tested {_HERE}",
        f"What the paper says and whether it holds here: {claims_counted(claims)}.",
        "A sentence agrees by the limit that its test states, a number within its tolerance. One "
        "that differs here may hold on another arm or with another choice the paper leaves open: "
        "docs/claims.md tells which do.",
        "Read those that differ with their tests before you rely on them for another robot.",
        (
            *(_of_verdict(claims, each) for each in (_DIFFERS, _NOT_COMPARABLE, _AGREES)),
            _table(claims, "Sentences that chose a reading of the paper: no evidence", chose),
        ),
    )


def _by_name(claims: Columns) -> dict[str, dict]:
    columns = ("paper", "reproduced", "verdict")
    rows = zip(*(claims[name] for name in columns), strict=True)
    return {
        str(claim): dict(zip(columns, row, strict=True))
        for claim, row in zip(claims["claim"], rows, strict=True)
    }


def _number(value: float, digits: int = 3) -> str:
    """A number as the paper prints it; a dash where there is none."""
    return f"{value:.{digits}f}" if np.isfinite(value) else "-"


def _pairs(known: Mapping[str, dict], names: Sequence[str]) -> tuple[str, ...]:
    """The paper's number and the one here, claim after claim."""
    return tuple(
        _number(float(known[name][column])) for name in names for column in ("paper", "reproduced")
    )


def _remark(known: Mapping[str, dict], names: Sequence[tuple[str, str]]) -> str:
    """What differs in a row: claims with the words of their columns."""
    differs = [words for name, words in names if known[name]["verdict"] == _DIFFERS]
    return f"{', '.join(differs)} differs" if differs else ""


def _rows(
    known: Mapping[str, dict], named: Sequence[tuple[str, Sequence[tuple[str, str]]]]
) -> tuple[tuple[tuple[str, ...], ...], dict[int, str]]:
    """Rows of pairs, each under its first cell, and remarks by row."""
    rows = tuple((first, *_pairs(known, [name for name, _ in names])) for first, names in named)
    remarks = {number: _remark(known, names) for number, (_, names) in enumerate(named)}
    return rows, {number: words for number, words in remarks.items() if words}


def _heads(first: str, columns: Sequence[tuple[str, str]]) -> tuple[str, ...]:
    return (first, *(f"{words}, {who}" for _, words in columns for who in ("paper", "here")))


def _residuals(known: Mapping[str, dict], table: str, caption: str) -> Table:
    named = [
        (words, [(f"{table}_{quantity}_{name}", told) for name, told in _STATISTICS])
        for quantity, words in _QUANTITIES
    ]
    rows, remarks = _rows(known, named)
    return Table(caption, _heads("residual", _STATISTICS), rows, frozenset(range(1, 7)), remarks)


def _parameters(known: Mapping[str, dict]) -> Table:
    joints = range(1, 1 + sum(name.startswith("table2_alpha_") for name in known))
    named = [
        (str(joint), [(f"table2_{name}_{joint}", name) for name, _ in _PARAMETERS])
        for joint in joints
    ]
    rows, remarks = _rows(known, named)
    caption = (
        "Table II: DH parameters fitted. Of d 2 and d 3 only the difference can be seen, the paper "
        "has {} mm, here it is {} mm; theta 5 is read as -3.141, the paper prints -3.114"
    ).format(*_pairs(known, ["table2_d_2_minus_d_3"]))
    return Table(caption, _heads("joint", _PARAMETERS), rows, frozenset(range(1, 9)), remarks)


def _of_verdict(claims: Columns, verdict: str) -> Block:
    """The claims of one verdict; those that differ are open to be read, the others folded."""
    counted = ~np.asarray(claims["used_to_choose"], dtype=bool)
    mine = np.flatnonzero((claims["verdict"] == verdict) & counted)
    caption = {
        _DIFFERS: "Differs here",
        _AGREES: "Agrees",
        _NOT_COMPARABLE: "Not comparable: nothing to judge it by here",
    }[verdict]
    return _table(claims, caption, mine, folded=verdict != _DIFFERS)


def _table(claims: Columns, caption: str, mine: np.ndarray, folded: bool = True) -> Block:
    if not mine.size:
        return Text(f"{caption}: none.")
    shared = np.isfinite(np.asarray(claims["share"], dtype=float))
    heads = ("the paper says", "paper", "here", "tolerance", "how it is tested", "claim")
    heads += ("holds on further arms",) if shared.any() else ()
    heads += ("verdict",) if claims["used_to_choose"][mine].any() else ()
    rows = []
    for i in mine:
        numbers = (_short(float(claims[name][i])) for name in ("paper", "reproduced", "tolerance"))
        share = float(claims["share"][i])
        held = (f"{share:.0%}" if np.isfinite(share) else "-",) if shared.any() else ()
        held += (str(claims["verdict"][i]),) if claims["used_to_choose"][i] else ()
        rows.append(
            (str(claims["statement"][i]), *numbers, str(claims["statistic"][i]),
             str(claims["claim"][i]), *held)
        )  # fmt: skip
    return Table(caption, heads, tuple(rows), frozenset({1, 2, 3}), folded=folded)


def _short(value: float) -> str:
    return f"{value:.4g}" if np.isfinite(value) else "-"

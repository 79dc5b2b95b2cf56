"""docs/claims.md: which of the paper's statements hold whatever one chooses, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from kinacc.artifacts.columns import Columns
from kinacc.config.records import value_at
from kinacc.config.schema import defaults
from kinacc.study.choices.open_choices import (
    ALL_AND_ARM,
    ARM,
    DEFAULT,
    FIG_5,
    OPEN,
    SAMPLES,
    STATED,
    Choice,
)
from kinacc.study.choices.properties import ABOUT
from kinacc.study.choices.reasons import (
    EVERYWHERE,
    NOWHERE,
    ON_ARM,
    ON_BOTH,
    ON_CHOICE,
    STEADY,
    by_value,
    table_of,
)
from kinacc.study.claims.claim import Claim
from kinacc.study.claims.evaluate import all_claims
from kinacc.study.claims.numbers import TRUE_ACCURACY_MM
from kinacc.study.claims.study_sentences import study_claims

_SHARES = ("arms", "alone", "all", "all_and_arm")
_TABLES = {"table1_": "Table I", "table2_": "Table II", "table3_": "Table III"}
_TABLES["true_accuracy"] = "true accuracy"
_FOLLOWED = ("fig5_approaches_alpha", "fig5_worst_point_resampled")
_HEAD = ["the paper says", "here", "arms", "one choice", "all choices", "and the arm"]
_HEAD += ["what changes it most", "alone it is changed by"]

Tables = Mapping[str, Columns]
Row = dict[str, object]


class _Told(NamedTuple):
    """Rows of both tables by claim, and what alone changes each verdict, in words."""

    shares: Mapping[str, Row]
    reasons: list[Row]
    alone: Mapping[str, str]


def claims_page(tables: Tables, marks: Mapping[str, str]) -> str:
    """The page from ``choices``, ``choices_factors``, ``claim_shares`` and ``claim_reasons``.

    ``marks``: provenance of the tables.
    """
    shares = {str(row["claim"]): row for row in _rows(tables["claim_shares"])}
    reasons = _rows(tables["claim_reasons"])
    told = _Told(shares, reasons, _alone(tables["choices"]))
    sentences = [each for each in all_claims() if not each.id.startswith(tuple(_TABLES))]
    grouped: dict[str, list[Claim]] = {}
    for each in sentences:
        grouped.setdefault(str(shares[each.id]["holds"]), []).append(each)
    parts = [
        _introduction(tables["choices"]),
        _summary(grouped, tables),
        _section(
            "Hold whatever one chooses",
            "These are about the methods. Neither another arm nor another choice changes them in "
            f"more than {1.0 - STEADY:.0%} of the runs.",
            grouped.get(EVERYWHERE, []),
            told,
        ),
        _section(
            "Hang on the arm",
            "Choices alone hardly change these; another arm that meets the paper's tables as well "
            "does.",
            grouped.get(ON_ARM, []),
            told,
        ),
        _section(
            "Hang on a choice",
            "These are the same on nearly every arm, and another choice changes them.",
            grouped.get(ON_CHOICE, []),
            told,
        ),
        _section(
            "Hang on the arm and on choices",
            "Both change these: they say as much about the arm and the way it is assessed as about "
            "the methods.",
            grouped.get(ON_BOTH, []),
            told,
        ),
        _section(
            "Hold nowhere",
            "No arm and no choice tried brings these about.",
            grouped.get(NOWHERE, []),
            told,
        ),
        _numbers(shares, reasons),
        _figure_5(tables),
        _choices(tables["choices_factors"]),
        "Written by `python tools/document_claims.py` from the tables in `docs/claims/`; do not "
        "edit. Provenance: " + ", ".join(f"{key} `{value}`" for key, value in marks.items()) + ".",
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _introduction(choices: Columns) -> str:
    runs = {name: np.unique(choices["run"][choices["choice"] == name]).size for name in SAMPLES}
    arms = np.unique(choices["run"][choices["choice"] == ARM]).size
    inside = ~np.isin(choices["choice"], (DEFAULT, ARM, *SAMPLES))
    alone = np.unique(choices["run"][inside]).size
    varied = np.unique(choices["choice"][inside]).size
    return f"""\
# What the paper's statements hang on

The paper leaves choices open, such as where its evaluation space begins or in which attitude the
flange is before it is turned; kinacc makes each by a stated default
([reading the paper](reading-the-paper.md)). This page says which statements of the paper hold
whatever one chooses, which hang on a choice, and which on the arm: the paper's own measurements are
not public, and many arms meet its Tables I to III.

Every statement was judged again in {1 + alone + arms + sum(runs.values())} runs of the whole study:

- *arms*: on {arms} further arms that meet the tables, with the default choices;
- *one choice*: each of {varied} choices varied alone, {alone} runs on the arm of `results/mh180`;
- *all choices*: {runs["all"]} runs on that arm in which all choices vary at once (Sobol points);
- *and the arm*: the same {runs[ALL_AND_ARM]} runs, each on an arm drawn from all of them;
- for Figs. 5 and 6, {runs[FIG_5]} runs over arm, noise, alpha and seed.

A share is that of the runs in which the statement holds, by the statistic and the limit that
`claims.parquet` states; runs in which it cannot be judged are left out. *Here* is the verdict with
the default choices. *What changes it most*: among the runs of the last column, the share at the
value of a choice where the statement holds most often less that where it holds least often; a
property of the arm counts as two values, its smaller and its larger half. Only differences are
named that chance would make in less than one of a hundred statements; two at most.
`claim_reasons.parquet` has all of them. *Alone it is changed by*: the values that change the
verdict here although every other choice keeps its default.

![Shares of runs in which each sentence holds, and the choices that change them](claims/choices.png)

*Left: the share of runs in which each sentence of the paper holds. Right: which choices and which
properties of the arm and its points change that share, and by how much.*"""


def _summary(grouped: Mapping[str, list[Claim]], tables: Tables) -> str:
    count = {name: len(claims) for name, claims in grouped.items()}
    told = [
        f"{count.get(EVERYWHERE, 0)} hold whatever one chooses",
        f"{count.get(ON_ARM, 0)} hang on the arm",
        f"{count.get(ON_CHOICE, 0)} on a choice",
        f"{count.get(ON_BOTH, 0)} on both",
        f"{count.get(NOWHERE, 0)} hold nowhere",
    ]
    found = f"Of {sum(count.values())} sentences of the paper {', '.join(told)}."
    return "\n\n".join(filter(None, [found, _beside_noise(tables)]))


def _beside_noise(tables: Tables) -> str:
    """How the sentences on Fig. 4 fare where the largest true error is small, and large."""
    sample = table_of(tables["choices"], tables["choices_factors"], ALL_AND_ARM)
    if "largest_mm" not in sample.factors:
        return ""
    largest_mm = sample.factors["largest_mm"]
    agrees = np.array([sample.agrees[claim.id] for claim in study_claims()])
    middle = float(np.nanmedian(largest_mm))
    small, large = (
        np.nanmean(agrees[:, side]) for side in (largest_mm <= middle, largest_mm > middle)
    )
    return (
        f"Varying all choices also makes the largest true error larger: in half of the runs it is "
        f"above {middle:.2f} mm, where the paper has {TRUE_ACCURACY_MM} mm beside noise of 0.05 to "
        f"0.3 mm. The sentences on Fig. 4 hold on average in {small:.0%} of the runs below that "
        f"and in {large:.0%} of those above: they are about noise that counts beside the error."
    )


def _section(title: str, lead: str, claims: list[Claim], told: _Told) -> str:
    if not claims:
        return ""
    lines = [f"| {' | '.join(_HEAD)} |", "|" + "---|" * len(_HEAD)]
    for claim in sorted(claims, key=lambda each: -float(told.shares[each.id]["all_and_arm_share"])):
        row = told.shares[claim.id]
        cells = [claim.statement, str(row["verdict"]), *(_share(row, name) for name in _SHARES)]
        cells += [_most(claim.id, told.reasons), told.alone.get(claim.id, "-")]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join([f"## {title}", "", lead, "", *lines])


def _alone(choices: Columns) -> dict[str, str]:
    """By claim: the values that change its verdict although nothing else is varied."""
    usual = choices["choice"] == DEFAULT
    default = dict(zip(choices["claim"][usual], choices["verdict"][usual], strict=True))
    found: dict[str, dict[str, list[str]]] = {}
    for row in _rows(choices):
        single = row["choice"] not in (DEFAULT, ARM, *SAMPLES)
        claim = str(row["claim"])
        if single and row["verdict"] not in (default[claim], "not comparable"):
            values = found.setdefault(claim, {}).setdefault(str(row["choice"]), [])
            values.append(str(row["value"]))
    return {
        claim: "; ".join(f"`{name}` {', '.join(values)}" for name, values in named.items())
        for claim, named in found.items()
    }


def _most(claim: str, reasons: list[Row], sample: str = ALL_AND_ARM, count: int = 2) -> str:
    """The factors that change the share of a claim most, in words; a dash where there is none."""
    found = [
        f"{_words(str(row['factor']))} ({row['least_value']}: {row['least_share']:.0%} of "
        f"{row['least_runs']}, {row['most_value']}: {row['most_share']:.0%} of {row['most_runs']})"
        for row in reasons
        if row["claim"] == claim and row["sample"] == sample and row["decides"]
    ]
    return "; ".join(found[:count]) or "-"


def _words(factor: str) -> str:
    return ABOUT.get(factor, f"`{factor}`")


def _numbers(shares: Mapping[str, Row], reasons: list[Row]) -> str:
    """Tables I to III: how many of their numbers agree, and what moves them."""
    lines = ["| table | numbers | arms | one choice | all choices | and the arm | moved most by |"]
    lines.append("|---|---|---|---|---|---|---|")
    for prefix, title in _TABLES.items():
        mine = [row for name, row in shares.items() if name.startswith(prefix)]
        mine = [row for row in mine if row["verdict"] != "not comparable"]
        means = [np.nanmean([float(row[f"{name}_share"]) for row in mine]) for name in _SHARES]
        moved: dict[str, list[float]] = {}
        for row in reasons:
            mine_too = str(row["claim"]).startswith(prefix) and row["sample"] == ALL_AND_ARM
            if mine_too and row["decides"]:
                moved.setdefault(str(row["factor"]), []).append(float(row["difference"]))
        most = sorted(moved, key=lambda name: -sum(moved[name]))[:2]
        cells = [title, str(len(mine)), *(f"{mean:.0%}" for mean in means)]
        lines.append(f"| {' | '.join([*cells, ', '.join(map(_words, most)) or '-'])} |")
    return "\n".join(
        [
            "## Numbers of Tables I to III, and the true accuracy",
            "",
            "These are about the paper's own arm. The arms here were accepted because they meet "
            "them with the default choices, so the column *arms* says nothing new; the others say "
            "how far a choice moves them out of their tolerances (the arm is not tuned again).",
            "",
            *lines,
        ]
    )


def _figure_5(tables: Tables) -> str:
    """The two sentences on Fig. 5 that hang on the arm, by what is varied for them."""
    told = table_of(tables["choices"], tables["choices_factors"], FIG_5)
    known = {each.id: each for each in all_claims()}
    if not all(claim in told.agrees for claim in _FOLLOWED):
        return ""
    lines = [
        "| over | value | runs | " + " | ".join(_QUOTED.values()) + " |",
        "|---|---|---|---|---|",
    ]
    for factor in (*(each.name for each in STATED), *ABOUT):
        if factor not in told.factors:
            continue
        columns = [by_value(told.agrees[claim], told.factors[factor]) for claim in _FOLLOWED]
        for value in sorted(columns[0], key=_sortable):
            cells = [f"{column[value][0]:.0%}" if value in column else "-" for column in columns]
            lines.append(
                f"| {_words(factor)} | {value} | {columns[0][value][1]} | {' | '.join(cells)} |"
            )
    reasons = _rows(tables["claim_reasons"])
    decided = [
        f"- *{known[claim].statement}* hangs most on {_most(claim, reasons, FIG_5)}."
        for claim in _FOLLOWED
        if _most(claim, reasons, FIG_5) != "-"
    ]
    return "\n".join(
        [
            "## The worst point of Fig. 5",
            "",
            "Two sentences on Fig. 5 differ on the arm of `results/mh180`: that the rejection "
            "probability approaches alpha after only 20 iterations, and that the worst point, once "
            "found, is measured again for the rest of the run. Both are about one simulation on "
            "one arm. Over arms, noise, alpha and seeds they hold as follows (the simulation shown "
            "is chosen anew each time, by the rule that `histories.parquet` states):",
            "",
            *lines,
            "",
            *decided,
        ]
    )


_QUOTED = {
    "fig5_approaches_alpha": "approaches alpha after 20 iterations",
    "fig5_worst_point_resampled": "worst point measured again to the end",
}


def _choices(factors: Columns) -> str:
    lines = ["| choice | what is chosen | values (the default first) | key |", "|---|---|---|---|"]
    lines += [
        _described(each, set(factors["value"][factors["factor"] == each.name]))
        for each in (*OPEN, *STATED)
    ]
    return "\n".join(
        [
            "## The choices",
            "",
            "The last three are stated by the paper and varied for Figs. 5 and 6 only. Not varied "
            "is which turn of joints 4 and 6 is taken: the calibration poses hold both joints "
            "within one turn, and outside of it the fitted model says nothing.",
            "",
            *lines,
        ]
    )


def _described(choice: Choice, tried: set[str]) -> str:
    known = defaults()
    own = tuple(value_at(known, key) for key in choice.keys)
    words = [word for word in choice.values if word in tried]
    words.sort(key=lambda word: choice.values[word] != own)
    keys = ", ".join(f"`{key}`" for key in choice.keys)
    return f"| `{choice.name}` | {choice.about} | {', '.join(words)} | {keys} |"


def _share(row: Row, name: str) -> str:
    share = float(row[f"{name}_share"])
    return "-" if np.isnan(share) else f"{share:.0%}"


def _sortable(value: str) -> tuple[int, float, str]:
    """Numbers by size, the smaller half before the larger one."""
    try:
        return 0, float(value), ""
    except ValueError:
        return 1, 0.0, value.replace("up to", "a").replace("above", "b")


def _rows(table: Columns) -> list[Row]:
    return [dict(zip(table, each, strict=True)) for each in zip(*table.values(), strict=True)]

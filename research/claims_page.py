"""docs/claims.md: which of the paper's statements hold whatever one chooses, in words."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd

from kinacc.config.schema import defaults
from kinacc.study.claims.claim import number_claims, sentences
from kinacc.study.claims.evaluate import all_claims
from research import reasons
from research.dotted import value_at
from research.judged_runs import ABOUT
from research.open_choices import (
    ALL,
    ALL_AND_ARM,
    ARM,
    DEFAULT,
    FIG_5,
    OPEN,
    SAMPLES,
    STATED,
    Choice,
)
from research.reasons import GROUPS

_TABLES = {"table1_": "Table I", "table2_": "Table II", "table3_": "Table III"}
_TABLES["true_accuracy"] = "true accuracy"
_SHARES = ("arms", "one choice", "all choices", "and the arm")
_HEAD = ("the paper says", "here", *_SHARES, "what changes it most", "alone it is changed by")
_SECTIONS = {
    reasons.EVERYWHERE: (
        "Hold whatever one chooses",
        "These are about the methods. Neither another arm nor another choice changes them in more "
        f"than {1.0 - reasons.STEADY:.0%} of the runs.",
    ),
    reasons.ON_ARM: (
        "Hang on the arm",
        "Choices alone hardly change these; another arm that meets the paper's tables as well "
        "does.",
    ),
    reasons.ON_CHOICE: (
        "Hang on a choice",
        "These are the same on nearly every arm, and another choice changes them.",
    ),
    reasons.ON_BOTH: (
        "Hang on the arm and on choices",
        "Both change these: they say as much about the arm and the way it is assessed as about the "
        "methods.",
    ),
    reasons.NOWHERE: ("Hold nowhere", "No arm and no choice tried brings these about."),
}
_FIG_5 = {
    "fig5_approaches_alpha": "approaches alpha after 20 iterations",
    "fig5_worst_point_resampled": "worst point measured again to the end",
}


def claims_page(choices: pd.DataFrame, factors: pd.DataFrame) -> str:
    """The page from ``choices`` and ``choices_factors``."""
    shares = reasons.shares(choices).set_index("claim", drop=False)
    why = reasons.reasons(choices, factors)
    sentences = [each for each in all_claims() if not each.id.startswith(tuple(_TABLES))]
    holds = {name: [each for each in sentences if shares["holds"][each.id] == name]
             for name in _SECTIONS}  # fmt: skip
    counts = ", ".join(f"{len(each)} {_SECTIONS[name][0].lower()}" for name, each in holds.items())
    parts = [_introduction(choices), f"Of {len(sentences)} sentences of the paper {counts}."]
    parts.append(_beside_noise(choices, factors))
    alone = _alone(choices)
    for name, claims in holds.items():
        rows = [
            [each.statement, shares["verdict"][each.id], *_percent(shares.loc[each.id]),
             _most(why, each.id), alone.get(each.id, "-")]
            for each in sorted(claims, key=lambda each: -shares["all_and_arm_share"][each.id])
        ]  # fmt: skip
        title, lead = _SECTIONS[name]
        parts += [f"## {title}", lead, _grid(_HEAD, rows)] if rows else []
    parts += [_numbers(shares, why), _figure_5(choices, factors, why), _choices(factors)]
    parts.append("Written by the rule `claims_page` of `research/Snakefile`; do not edit.")
    return "\n\n".join(parts) + "\n"


def _introduction(choices: pd.DataFrame) -> str:
    runs = choices.groupby("choice")["run"].nunique()
    one = runs.drop([DEFAULT, ARM, *SAMPLES], errors="ignore")
    return f"""\
# What the paper's statements hang on

The paper leaves choices open, such as where its evaluation space begins or in which attitude the
flange is before it is turned; kinacc makes each by a stated default
([reading the paper](reading-the-paper.md)). This page says which statements of the paper hold
whatever one chooses, which hang on a choice, and which on the arm: the paper's own measurements are
not public, and many arms meet its Tables I to III.

Every statement was judged again in {runs.sum()} runs of the whole study:

- *arms*: on {runs[ARM]} further arms that meet the tables, with the default choices;
- *one choice*: each of {one.size} choices varied alone, {one.sum()} runs on the arm of
  `results/mh180`;
- *all choices*: {runs[ALL]} runs on that arm in which all choices vary at once (Sobol points);
- *and the arm*: the same {runs[ALL_AND_ARM]} runs, each on an arm drawn from all of them;
- for Figs. 5 and 6, {runs[FIG_5]} runs over arm, noise, alpha and seed.

A share is that of the runs in which the statement holds, by the statistic and the limit that
`claims.parquet` states; runs in which it cannot be judged are left out. *Here* is the verdict with
the default choices. *What changes it most*: among the runs of the last column, the share at the
value of a choice where the statement holds most often less that where it holds least often; a
property of the arm counts as two values, its smaller and its larger half. Only differences are
named that chance would make in less than one of a hundred statements; two at most. *Alone it is
changed by*: the values that change the verdict here although every other choice keeps its default.

![Shares of runs in which each sentence holds, and the choices that change them](claims.png)

*Left: the share of runs in which each sentence of the paper holds. Right: which choices and which
properties of the arm and its points change that share, and by how much.*"""


def _beside_noise(choices: pd.DataFrame, factors: pd.DataFrame) -> str:
    """How the sentences on Fig. 4 fare where the largest true error is small, and large."""
    agrees, values = reasons.table_of(choices, factors, ALL_AND_ARM)
    middle = values["largest_mm"].median()
    paper_mm = next(claim.paper for claim in number_claims() if claim.id == "true_accuracy")
    held = agrees[[claim.id for claim in sentences()["study"]]]
    small, large = (
        np.nanmean(held[side].to_numpy())
        for side in (values["largest_mm"] <= middle, values["largest_mm"] > middle)
    )
    return (
        "Varying all choices also makes the largest true error larger: in half of the runs it is "
        f"above {middle:.2f} mm, where the paper has {paper_mm} mm beside noise of 0.05 to "
        f"0.3 mm. The sentences on Fig. 4 hold on average in {small:.0%} of the runs below that "
        f"and in {large:.0%} of those above: they are about noise that counts beside the error."
    )


def _alone(choices: pd.DataFrame) -> dict[str, str]:
    """By claim: the values that change its verdict although nothing else is varied."""
    usual = choices[choices["choice"] == DEFAULT].set_index("claim")["verdict"]
    single = choices[~choices["choice"].isin([DEFAULT, ARM, *SAMPLES])]
    changed = ~single["verdict"].isin(["not comparable"])
    changed &= single["verdict"] != single["claim"].map(usual)
    found: dict[str, list[str]] = {}
    for (claim, name), own in single[changed].groupby(["claim", "choice"], sort=False):
        found.setdefault(claim, []).append(f"`{name}` {', '.join(own['value'])}")
    return {claim: "; ".join(each) for claim, each in found.items()}


def _most(why: pd.DataFrame, claim: str, sample: str = ALL_AND_ARM) -> str:
    """The two factors that change the share of a claim most, in words; a dash where none does."""
    mine = why[(why["claim"] == claim) & (why["sample"] == sample) & (why["decides"] == 1)]
    return "; ".join(
        f"{_words(row.factor)} ({row.least_value}: {row.least_share:.0%} of {row.least_runs}, "
        f"{row.most_value}: {row.most_share:.0%} of {row.most_runs})"
        for row in mine.head(2).itertuples()
    ) or "-"  # fmt: skip


def _numbers(shares: pd.DataFrame, why: pd.DataFrame) -> str:
    """Tables I to III: how many of their numbers agree, and what moves them."""
    rows = []
    why = why[(why["sample"] == ALL_AND_ARM) & (why["decides"] == 1)]
    for prefix, title in _TABLES.items():
        own = shares[shares["claim"].str.startswith(prefix)]
        own = own[own["verdict"] != "not comparable"]
        moved = why[why["claim"].str.startswith(prefix)].groupby("factor")["difference"].sum()
        most = ", ".join(map(_words, moved.sort_values(ascending=False).index[:2])) or "-"
        means = own[[f"{name}_share" for name in GROUPS]].mean()
        rows.append([title, len(own), *_percent(means), most])
    return "\n\n".join(
        [
            "## Numbers of Tables I to III, and the true accuracy",
            "These are about the paper's own arm. The arms here were accepted because they meet "
            "them with the default choices, so the column *arms* says nothing new; the others say "
            "how far a choice moves them out of their tolerances (the arm is not tuned again).",
            _grid(("table", "numbers", *_SHARES, "moved most by"), rows),
        ]
    )


def _figure_5(choices: pd.DataFrame, factors: pd.DataFrame, why: pd.DataFrame) -> str:
    """The two sentences on Fig. 5 that hang on the arm, by what is varied for them."""
    agrees, values = reasons.table_of(choices, factors, FIG_5)
    rows = []
    for factor in (name for name in (*(each.name for each in STATED), *ABOUT) if name in values):
        found = [reasons.by_value(agrees[claim], values[factor]) for claim in _FIG_5]
        for value in sorted(found[0].index, key=_sortable):
            held = [f"{each['share'][value]:.0%}" if value in each.index else "-" for each in found]
            rows.append([_words(factor), value, found[0]["runs"][value], *held])
    statements = {each.id: each.statement for each in all_claims()}
    return "\n\n".join(
        [
            "## The worst point of Fig. 5",
            "Two sentences on Fig. 5, that the rejection probability approaches alpha after only "
            "20 iterations and that the worst point, once found, is measured again for the rest of "
            "the run, are about one simulation on one arm. Over arms, noise, alpha and seeds they "
            "hold as follows (the simulation shown is chosen anew each time, by the rule that "
            "`histories.parquet` states):",
            _grid(("over", "value", "runs", *_FIG_5.values()), rows),
            "\n".join(
                f"- *{statements[claim]}* hangs most on {_most(why, claim, FIG_5)}."
                for claim in _FIG_5
                if _most(why, claim, FIG_5) != "-"
            ),
        ]
    )


def _choices(factors: pd.DataFrame) -> str:
    known = defaults()

    def row(choice: Choice) -> list[str]:
        own = tuple(value_at(known, key) for key in choice.keys)
        tried = set(factors["value"][factors["factor"] == choice.name])
        words = sorted(
            (word for word in choice.values if word in tried),
            key=lambda word: choice.values[word] != own,
        )
        keys = ", ".join(f"`{key}`" for key in choice.keys)
        return [f"`{choice.name}`", choice.about, ", ".join(words), keys]

    head = ("choice", "what is chosen", "values (the default first)", "key")
    return "\n\n".join(
        [
            "## The choices",
            "The last three are stated by the paper and varied for Figs. 5 and 6 only. Not varied "
            "is which turn of joints 4 and 6 is taken: the calibration poses hold both joints "
            "within one turn, and outside of it the fitted model says nothing.",
            _grid(head, [row(each) for each in (*OPEN, *STATED)]),
        ]
    )


def _grid(head: Iterable[str], rows: Iterable[Iterable]) -> str:
    lines = [head, ["---"] * len([*head]), *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def _percent(row: pd.Series) -> list[str]:
    told = [row[f"{name}_share"] for name in GROUPS]
    return ["-" if np.isnan(share) else f"{share:.0%}" for share in told]


def _words(factor: str) -> str:
    return ABOUT.get(factor, f"`{factor}`")


def _sortable(value: str) -> tuple[int, float, str]:
    """Numbers by size, the smaller half before the larger one."""
    try:
        return 0, float(value), ""
    except ValueError:
        return 1, 0.0, value.replace("up to", "a").replace("above", "b")

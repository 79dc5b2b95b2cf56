"""What claims hang on: planted causes are found, chance is not taken for one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from kinacc.study.claims.evaluate import all_claims
from research import reasons
from research.claims_page import claims_page

RUNS = 200
CLAIM = "map_nonlinear"  # any sentence


def planted(agrees, *, arms=(True,) * 20, default="agrees") -> tuple:
    """Tables in which one claim ``agrees(order, stands_out, rng)`` over a sample; the others do."""
    rng = np.random.default_rng(3)
    orders = rng.choice(["4", "5", "8"], RUNS)
    rules = rng.choice(["normal", "iqr"], RUNS)
    stands_out, sizes_mm = rng.uniform(1.0, 1.3, RUNS), rng.uniform(0.5, 2.0, RUNS)
    verdicts = {False: "differs", True: "agrees"}
    judged, factors = [], []

    def told(run, choice, value, claim, holds):
        judged.append((run, choice, value, claim, verdicts[bool(holds)], 0.0, None))

    names = [claim.id for claim in all_claims()]
    for name in names:
        told(0, "default", None, name, name != CLAIM or default == "agrees")
        told(1, "vec_order", "4", name, True)
        for run, holds in enumerate(arms, 2):
            told(run, "arm", str(run), name, holds or name != CLAIM)
    for place in range(RUNS):
        holds = agrees(orders[place], stands_out[place], rng)
        for first, choice in ((100, "all"), (1000, "all_and_arm"), (2000, "fig5")):
            run = first + place
            for name in names:
                told(run, choice, None, name, holds or name != CLAIM)
            factors.append((run, "vec_order", "choice", orders[place], None))
            factors.append((run, "outlier_rule", "choice", rules[place], None))
            factors.append((run, "largest_mm", "property", None, sizes_mm[place]))
            factors.append((run, "largest_over_second", "property", None, stands_out[place]))
    choices = ["run", "choice", "value", "claim", "verdict", "statistic", "why"]
    chosen = ["run", "factor", "kind", "value", "number"]
    return pd.DataFrame(judged, columns=choices), pd.DataFrame(factors, columns=chosen), orders


def rows_of(choices, factors, claim=CLAIM, sample="all_and_arm") -> list[dict]:
    table = reasons.reasons(choices, factors)
    return [
        row for row in table.to_dict("records") if row["claim"] == claim and row["sample"] == sample
    ]


def holds_of(choices, claim=CLAIM) -> str:
    table = reasons.shares(choices)
    return dict(zip(table["claim"], table["holds"], strict=True))[claim]


def test_the_choice_that_decides_a_claim_is_named_first_with_its_shares():
    choices, factors, orders = planted(lambda order, _, rng: order != "8")
    first, *others = rows_of(choices, factors)
    assert (first["factor"], first["decides"]) == ("vec_order", 1)
    assert (first["least_value"], first["least_share"]) == ("8", 0.0)
    assert first["most_share"] == first["difference"] == 1.0
    assert first["least_runs"] == np.sum(orders == "8")
    assert not any(row["decides"] for row in others)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_chance_is_not_named_as_a_reason(share):
    choices, factors, _ = planted(lambda _, __, rng: rng.random() < share)
    assert not any(row["decides"] for row in rows_of(choices, factors))


@pytest.mark.parametrize(
    ("agrees", "arms", "wanted"),
    [
        (lambda *_: True, [True] * 20, "everywhere"),
        (lambda *_: False, [False] * 20, "nowhere"),
        (lambda order, *_: order == "8", [True] * 20, "hangs on a choice"),
        (lambda *_: True, [True] * 10 + [False] * 10, "hangs on the arm"),
        (lambda order, *_: order == "8", [True] * 10 + [False] * 10, "hangs on both"),
    ],
)
def test_where_a_claim_holds_follows_from_its_shares_over_arms_and_choices(agrees, arms, wanted):
    choices, _, _ = planted(agrees, arms=arms)
    assert holds_of(choices) == wanted


def test_the_page_in_the_documentation_is_what_its_tables_say():
    top = Path(__file__).parents[2]
    tables = (
        top / "research" / "data" / f"{name}.parquet" for name in ("choices", "choices_factors")
    )
    page = (top / "docs" / "claims.md").read_text(encoding="utf-8")
    assert page == claims_page(*map(pd.read_parquet, tables))

"""What claims hang on: planted causes are found, chance is not taken for one."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from shared_data import ROOT

from research import reasons
from research.claims_page import claims_page

RUNS = 200
CLAIM = "map_nonlinear"  # any sentence


def planted(agrees, arms=(True,) * 20) -> tuple:
    """Tables in which one claim ``agrees(order, rng)`` over a sample, and by ``arms`` elsewhere."""
    rng = np.random.default_rng(3)
    orders = rng.choice(["4", "5", "8"], RUNS)
    rules = rng.choice(["normal", "iqr"], RUNS)
    stands_out, sizes_mm = rng.uniform(1.0, 1.3, RUNS), rng.uniform(0.5, 2.0, RUNS)
    judged, factors = [(0, "default", None, True), (1, "vec_order", "4", True)], []
    judged += [(run, "arm", str(run), holds) for run, holds in enumerate(arms, 2)]
    for place, order in enumerate(orders):
        holds = agrees(order, rng)
        for first, choice in ((100, "all"), (1000, "all_and_arm"), (2000, "fig5")):
            run = first + place
            judged.append((run, choice, None, holds))
            factors.append((run, "vec_order", "choice", order, None))
            factors.append((run, "outlier_rule", "choice", rules[place], None))
            factors.append((run, "largest_mm", "property", None, sizes_mm[place]))
            factors.append((run, "largest_over_second", "property", None, stands_out[place]))
    choices = pd.DataFrame(judged, columns=["run", "choice", "value", "holds"])
    choices["verdict"] = np.where(choices.pop("holds"), "agrees", "differs")
    choices = choices.assign(claim=CLAIM, statistic=0.0, why=None)
    names = ["run", "factor", "kind", "value", "number"]
    return choices, pd.DataFrame(factors, columns=names), orders


def rows_of(choices, factors) -> list[dict]:
    table = reasons.reasons(choices, factors)
    return table.query("claim == @CLAIM and sample == 'all_and_arm'").to_dict("records")


def test_the_choice_that_decides_a_claim_is_named_first_with_its_shares():
    choices, factors, orders = planted(lambda order, _: order != "8")
    first, *others = rows_of(choices, factors)
    assert (first["factor"], first["decides"]) == ("vec_order", 1)
    assert (first["least_value"], first["least_share"]) == ("8", 0.0)
    assert first["most_share"] == first["difference"] == 1.0
    assert first["least_runs"] == np.sum(orders == "8")
    assert not any(row["decides"] for row in others)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_chance_is_not_named_as_a_reason(share):
    choices, factors, _ = planted(lambda _, rng: rng.random() < share)
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
    assert reasons.shares(choices).set_index("claim")["holds"][CLAIM] == wanted


def test_the_page_in_the_documentation_is_what_its_tables_say():
    tables = (
        ROOT / "research" / "data" / f"{name}.parquet" for name in ("choices", "choices_factors")
    )
    page = (ROOT / "docs" / "claims.md").read_text(encoding="utf-8")
    assert page == claims_page(*map(pd.read_parquet, tables))

"""``kinacc campaign plan``: simulated widths and shares are those of campaigns run one by one."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from campaign_on_disk import refusal
from command_line import answer, call

from kinacc.assess.attainable import width_limits
from kinacc.assess.region_share import RegionShare
from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.assess.single_shot import SingleShot
from kinacc.assess.statement import CANDIDATES
from kinacc.assess.world import conduct, drawn_world, key_of
from kinacc.campaign.planning import Aim, counted, simulate, smallest_budget
from kinacc.errors import InputError
from kinacc.study.fields import ErrorField


def field(count=100, seed=0):
    return ErrorField("normal", np.random.default_rng(seed).normal(size=(count, 3)) * 0.2)


def test_a_simulated_campaign_is_one_run_in_memory():
    errors, sigma = field(), 0.05
    budgets = (SearchAndConfirm(measurements=30), SearchAndConfirm(measurements=50))
    found = simulate([errors], 40, sigma**2 * np.eye(3), budgets, 3, 9, Aim())
    assert len(found) == 2 * 3
    for each in found.itertuples():
        chosen = np.random.default_rng([9, 0, each.repetition]).permutation(100)[:40]
        world = drawn_world(errors.error_mm[chosen], sigma, key_of(9, 0, each.repetition), 60)
        campaign = conduct(SearchAndConfirm(measurements=each.budget), world)
        wanted = next(s for s in campaign.statements() if s.target == CANDIDATES)
        assert each.upper_mm == pytest.approx(wanted.upper_mm, rel=1e-9)
        assert each.lower_mm == pytest.approx(wanted.lower_mm, rel=1e-9)
        assert each.readings == campaign.ledger.taken
        sizes = errors.size_mm[chosen]
        assert each.true_mm == np.sort(sizes)[-1 - each.excepted]
        # The excess of bounds that know the errors, where the bound is on all points.
        known = width_limits(sizes, sigma, each.budget, 0.05)
        assert (each.excepted > 0) == math.isnan(each.attainable_mm) == math.isnan(each.proven_mm)
        if not each.excepted:
            assert each.attainable_mm == pytest.approx(known.attainable_mm)
            assert each.proven_mm == pytest.approx(known.proven_mm)


def runs(*bounds):
    """Simulated campaigns by lower and upper bound, truth and verdict."""
    table = pd.DataFrame(bounds, columns=["lower_mm", "upper_mm", "true_mm", "verdict"])
    return table.assign(
        errors="x", budget=10, readings=10, excepted=0, attainable_mm=0.0, proven_mm=0.0
    )


def test_rows_count_what_is_stated_wanted_held_and_decided():
    table = runs(
        (0.9, 1.1, 1.0, "accept"),
        (0.5, 0.9, 1.0, "undecided"),
        (1.3, 2.0, 1.5, "reject"),
        (0.9, math.nan, 1.0, "undecided"),
    ).assign(attainable_mm=[0.1, 0.1, 0.3, 0.7])
    wide = counted(table.assign(excepted=[0, 1, 0, 0]), Aim(width_mm=0.5)).loc[0]
    assert (wide["excepted"], wide["reached"], wide["width_median_mm"]) == (
        1,
        1,
        pytest.approx(0.7),
    )
    (row,) = counted(table, Aim(width_mm=0.5, tolerance_mm=1.2)).itertuples()
    assert (row.stated, row.within, row.reached) == (0.75, 0.5, 1)
    assert (row.holding, row.judged) == (2, 3)
    # Clopper, Pearson: one or more of four, 1 - (1 - p)^4 = 0.025
    assert row.reached_low == pytest.approx(0.006309, abs=1e-6)
    assert (row.excess_mm, row.attainable_mm) == pytest.approx((0.5 / 3.0, 0.3))
    assert (row.accept, row.reject, row.undecided) == (0.25, 0.25, 0.5)
    assert (row.width_q05_mm, row.width_median_mm) == pytest.approx((0.2, 0.4))
    assert row.width_q95_mm == math.inf


def test_the_budget_named_is_enough_on_all_errors_and_beyond():
    aim = Aim(width_mm=0.5, power=0.8)

    def enough(**shares):
        budgets = pd.Series([10, 20, 30] * len(shares))
        return smallest_budget(budgets, pd.Series(np.concatenate([*shares.values()])), aim)

    assert enough(a=[0.9, 0.9, 0.9], b=[0.1, 0.8, 1.0]) == 20
    assert enough(a=[1.0, 1.0, 1.0], b=[0.7, 0.7, 0.8]) == 30
    assert enough(a=[0.9, 0.9, 0.9], b=[0.9, 0.1, 1.0]) == 30
    assert enough(a=[0.9, 0.9, 0.7]) is None


def test_fewer_errors_than_candidates_and_targets_without_a_statement_are_refused():
    with pytest.raises(InputError, match="only 100"):
        simulate([field()], 101, np.eye(3), [SingleShot(measurements=200)], 1, 0, Aim())
    with pytest.raises(InputError, match="states nothing about candidates"):
        simulate([field()], 40, np.eye(3), [RegionShare(measurements=40)], 1, 0, Aim())


def test_the_command_answers_with_table_picture_and_budget(tmp_path):
    picture, table = tmp_path / "width.svg", tmp_path / "plan.csv"
    words = ("campaign", "plan", "--noise-mm", "0.05", "--candidates", 30, "--errors", "smooth",
             "--width-mm", "0.2", "--power", "0.5", "--repetitions", 6, "--budget", 15,
             "--budget", 60)  # fmt: skip
    first = call(*words, "--picture", picture, "-o", table, code=0).output.splitlines()[0]
    # Six of six leave room for a share of 0.025 ** (1 / 6) = 54 %.
    assert first.startswith("60 readings give")
    assert "6 of 6" in first
    assert "54%" in first
    assert picture.stat().st_size > 1000
    content = answer(*words)
    assert content["budget"] == 60
    assert content["noise_mm"] == [0.05] * 3
    assert [row["budget"] for row in content["rows"]] == [15, 60]
    assert pd.read_csv(table)["true_mm"].iloc[1] == pytest.approx(content["rows"][1]["true_mm"])


@pytest.mark.parametrize(
    ("words", "place"),
    [
        ((), "--noise-mm"),
        (("--noise-mm", "0.1", "--errors", "nowhere"), "smooth, workshop"),
        (("--noise-mm", "0.1", "--width-mm", "-1"), "--width-mm"),
        (("--noise-mm", "0.1", "--tolerance-mm", "nan"), "--tolerance-mm"),
    ],
)
def test_what_cannot_be_simulated_is_named(words, place):
    assert place in refusal("campaign", "plan", *words)

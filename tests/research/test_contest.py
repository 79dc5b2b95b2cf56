"""Worlds and sums of the tournament: fixed, fair and counted right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import paper_settings as paper
import pytest
from scipy.stats import binomtest

from kinacc.assess.attainable import width_limits
from kinacc.assess.random_numbers import key_of
from kinacc.assess.registry import ASSESSORS
from kinacc.assess.world import drawn_world
from kinacc.study.fields import ErrorField
from research import contest, verdicts

SMALL = contest.Size((0.1, 0.3), {20: (10, 40)}, 3, (0,))


@pytest.fixture(scope="module")
def field() -> ErrorField:
    """Thirty errors in random directions."""
    rng = np.random.default_rng(1)
    q_rad = rng.uniform(-0.5, 0.5, (30, 6))
    return ErrorField("made_up", 0.4 * rng.normal(size=(30, 3)), q_rad, "synthetic")


@pytest.fixture(scope="module")
def rows(field):
    """All campaigns of the small tournament."""
    work = contest.jobs([field], SMALL)
    everyone = contest.Contest(SMALL, 5, contest.CONTESTANTS, paper.study())
    made = [contest.campaigns(job, range(3), everyone) for job in work]
    return pd.concat(made, ignore_index=True)


def test_every_assessor_is_in_every_cell(rows):
    assert set(rows["assessor"]) == set(ASSESSORS)
    first = rows["assessor"] == "search_and_confirm"
    first &= rows["target"] == "measured"
    assert first.sum() == 2 * 2 * 3
    assert np.all(rows["measurements"] <= rows["budget"])
    assert np.all(rows["points_visited"] <= rows["candidates"])


def test_larger_budgets_see_the_same_first_readings(field):
    cell = contest.Cell(field, 20, 0.1)
    few, many = (contest.world_of(cell, 1, visits, 5) for visits in (10, 40))
    assert np.array_equal(few.error_mm, many.error_mm)
    assert np.array_equal(few.reading_mm(3, 9), many.reading_mm(3, 9))


def test_a_field_takes_part_with_the_candidate_counts_it_is_large_enough_for(field):
    def counts(*wanted):
        size = replace(SMALL, budgets=dict.fromkeys(wanted, (10,)))
        return {cell.candidates for cell in contest.cells([field], size)}

    assert counts(20, 31) == {20}
    assert counts(40, 50) == {30}  # smaller than all of them: as it is
    assert {job.budget for job in contest.jobs([field], replace(SMALL, budgets={40: (7,)}))} == {7}


def test_each_target_is_graded_against_its_own_truth(rows):
    one = (rows["assessor"] == "search_and_confirm") & (rows["budget"] == 10)
    measured, everywhere = (
        rows["true_mm"][one & (rows["target"] == target)].to_numpy()
        for target in ("measured", "candidates")
    )
    assert np.all(measured <= everywhere)
    assert np.any(measured < everywhere)


def test_every_bound_on_enough_readings_is_told_how_near_it_could_be(rows, field):
    enough = (rows["budget"] == 40) & (rows["repetition"] == 1) & ~np.isnan(rows["upper_mm"])
    enough &= np.isin(rows["target"], ("measured", "candidates"))
    assert enough.sum() > 5
    job = contest.Job(contest.Cell(field, 20, 0.1), 40)
    world = contest.world_of(job.cell, 1, 40, 5)
    size = np.linalg.norm(world.error_mm, axis=1)
    known = width_limits(size, 0.1, 40, 0.05)
    of_all = enough & (rows["noise_mm"] == 0.1) & (rows["points_visited"] == 20)
    assert of_all.any()
    np.testing.assert_allclose(rows["attainable_mm"][of_all], known.attainable_mm, rtol=1e-9)
    np.testing.assert_allclose(rows["proven_mm"][of_all], known.proven_mm, rtol=1e-9)
    assert np.all(rows["proven_mm"][enough] < rows["attainable_mm"][enough])
    assert np.isnan(rows["attainable_mm"][np.isnan(rows["upper_mm"])]).all()
    # With fewer readings than candidates nothing bounds them all; those measured can be.
    few = (rows["budget"] == 10) & ~np.isnan(rows["upper_mm"])
    assert not np.isfinite(rows["attainable_mm"][few & (rows["target"] == "candidates")]).any()
    assert np.isfinite(rows["attainable_mm"][few & (rows["target"] == "measured")]).all()


def test_a_cell_sums_up_the_limits_of_those_campaigns_that_have_them():
    said = graded(
        attainable_mm=[0.1, 0.3, np.nan, np.inf, np.nan], proven_mm=[0.1, 0.1, 0.1, 0.3, np.nan]
    )
    cell = one_cell(said)
    assert cell["attainable_mm"] == pytest.approx(0.2)
    assert cell["proven_mm"] == pytest.approx(0.15)
    cell = one_cell(graded(attainable_mm=np.inf))
    assert np.isnan(cell["attainable_mm"])


def one_cell(rows: pd.DataFrame) -> pd.Series:
    table = verdicts.cells(rows)
    assert len(table) == 1
    return table.iloc[0]


def verdict_of(rows: pd.DataFrame, times: int = 200) -> pd.Series:
    """The verdict on campaigns that came out so again and again."""
    (found,) = verdicts.judged(verdicts.cells(pd.concat([rows] * times))).to_dict("records")
    return found


def graded(**columns) -> pd.DataFrame:
    """Rows of one cell, five campaigns."""
    row = {
        "assessor": "a",
        "target": "measured",
        "field": "f",
        "candidates": 20,
        "noise_mm": 0.1,
        "budget": 10,
        "setup": "plain",
        "world": "stated",
        "true_mm": 1.0,
        "bounded_mm": columns.get("true_mm", 1.0),
        "value_mm": 1.1,
        "lower_mm": 0.9,
        "upper_mm": 1.2,
        "confidence": 0.95,
        "excepted": 0,
        "alarmed": False,
        "assumption": "none",
        "measurements": 10,
        "points_visited": 8,
        "attainable_mm": np.nan,
        "proven_mm": np.nan,
        **columns,
    }
    return pd.DataFrame(row, index=range(5))


def test_a_cell_is_summed_up_as_by_hand():
    said = graded(
        upper_mm=[1.2, 0.8, 1.4, np.nan, 9.0],
        assumption=["holds", "holds", "none", "none", "broken"],
        value_mm=[1.1, 0.9, 1.1, 0.9, 1.3],
        lower_mm=[0.9, 1.1, 0.9, np.nan, 0.9],
    )
    cell = one_cell(said)
    assert (cell["repetitions"], cell["stated"], cell["broken"]) == (5, 4, 1)
    assert cell["sound"] == 4
    assert cell["upper_holds"] == pytest.approx(2 / 3)
    assert cell["excess_mm"] == pytest.approx((0.2 - 0.2 + 0.4) / 3)
    assert cell["lower_holds"] == pytest.approx(3 / 4)
    assert cell["bias_mm"] == pytest.approx(0.06)
    assert cell["rmse_mm"] == pytest.approx(np.sqrt((4 * 0.01 + 0.09) / 5))
    exact = binomtest(2, 3).proportion_ci(0.95, "exact")
    assert (cell["upper_low"], cell["upper_high"]) == pytest.approx((exact.low, exact.high))


def test_holm_stops_at_the_first_that_is_not_small_enough():
    chances = np.array([0.004, 0.5, 0.001, 0.003, 0.0051])
    assert verdicts.holm(chances, 0.01).tolist() == [False, False, True, False, False]
    assert verdicts.holm(np.array([0.001, 0.002, 0.9]), 0.01).tolist() == [True, True, False]


def test_an_assessor_that_claims_too_much_is_caught():
    assert verdict_of(graded())["rejected"] == 0
    found = verdict_of(graded(upper_mm=[1.2, 1.2, 1.2, 1.2, 0.9]))
    assert (found["rejected"], found["below"]) == (1, 1)
    assert found["worst_holds"] == pytest.approx(0.8)


def test_silence_counts_where_what_it_would_rest_on_is_true():
    said = graded(
        upper_mm=[1.2, np.nan, np.nan, np.nan, 1.3],
        assumption=["holds", "holds", "broken", "broken", "broken"],
    )
    found = verdict_of(said, 1)
    assert found["withheld"] == pytest.approx(3 / 5)
    assert found["withheld_sound"] == pytest.approx(1 / 2)


def test_a_bound_of_all_points_but_some_is_held_to_the_largest_of_these(field):
    cell, plain = contest.Cell(field, 30, 0.05), contest.Setup()
    everyone = contest.Contest(SMALL, 5, ("search_and_confirm",), paper.study())
    rows = contest.campaigns(contest.Job(cell, 20, plain), range(3), everyone)
    rows = rows[rows["target"] == "candidates"]
    left = rows["excepted"].to_numpy()
    assert left.min() > 0
    size = np.sort(field.size_mm)[::-1]
    assert rows["true_mm"].tolist() == [size[0]] * 3
    assert rows["bounded_mm"].tolist() == size[left].tolist()
    summed = one_cell(rows)
    assert summed["upper_holds"] == np.mean(rows["upper_mm"] >= size[left])
    assert summed["lower_holds"] == np.mean(rows["lower_mm"] <= size[0])
    assert summed["excepted"] == left.mean()


def test_lower_bounds_that_claim_too_much_are_caught_and_silence_is_not():
    found = verdict_of(graded(lower_mm=[0.9, 0.9, 0.9, 0.9, 1.1]))
    assert (found["rejected"], found["lower_rejected"]) == (0, 1)
    assert found["lower_worst"] == pytest.approx(0.8)
    silent = graded(upper_mm=[1.2, np.nan, np.nan, np.nan, 0.9], alarmed=[0, 1, 1, 1, 0])
    found = verdict_of(silent, 1)
    assert found["worst_holds"] == pytest.approx(1 / 2)
    assert found["worst_begun"] == pytest.approx(4 / 5)
    assert found["alarmed"] == pytest.approx(3 / 5)


def test_every_world_with_every_setup_is_a_row_of_its_own(field):
    setups = (
        contest.Setup(worlds=("stated", "noise_1.2")),
        contest.Setup("estimated", {"noise": "estimated"}, ("noise_1.2",)),
    )
    size = replace(SMALL, noise_mm=(0.1,), budgets={20: (40,)}, setups=setups)
    names = ("maximum", "search_and_confirm", "single_shot")
    given = contest.Contest(size, 5, names, paper.study())
    found = contest.summed(contest.jobs([field], size), given)
    of_all = found["target"] == "candidates"
    kinds = zip(*(found[n][of_all] for n in ("assessor", "setup", "world")), strict=True)
    assert sorted(kinds) == [
        ("maximum", "plain", "stated"),  # looks back: it has readings as stated alone
        ("search_and_confirm", "estimated", "noise_1.2"),
        ("search_and_confirm", "plain", "noise_1.2"),
        ("search_and_confirm", "plain", "stated"),
        ("single_shot", "plain", "noise_1.2"),
        ("single_shot", "plain", "stated"),  # knows no setting `noise`
    ]


def test_few_campaigns_do_not_tell_three_points_from_chance():
    few = graded(upper_mm=[1.2, 1.2, 1.2, 1.2, 0.9])
    assert verdict_of(few, 1)["below"] == 0


@pytest.mark.parametrize("name", ["maximum", "single_shot"])
def test_either_interface_tells_what_it_took(name):
    errors = np.random.default_rng(5).normal(size=(12, 3))
    world = drawn_world(errors, 1e-6, key_of(4), 20)
    found = contest.assessed(name, paper.study(measurements=12), world)
    assert found.measurements == found.points_visited == 12
    assert (found.visited is None) == (name == "maximum")
    assert found.visited is None or sorted(found.visited) == list(range(12))
    size = np.linalg.norm(errors, axis=1)
    assert found.statements[0].value_mm == pytest.approx(size.max(), abs=1e-4)

"""Fields, worlds and sums of the tournament: fixed, fair and counted right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import paper_settings as paper
import pytest
from scipy.stats import binomtest

from kinacc.assess.attainable import width_limits
from kinacc.assess.error_effects import joint_errors
from kinacc.assess.registry import ASSESSORS
from kinacc.errors import InputError
from kinacc.kinematics import robot
from kinacc.study.tournament import contest, summary
from kinacc.study.tournament.fields import (
    FAMILIES,
    ErrorField,
    of_measurements,
    of_points,
    synthetic,
)

SMALL = contest.Size((0.1, 0.3), {20: (10, 40)}, 3, 2, (0,))


@pytest.fixture(scope="module")
def field() -> ErrorField:
    """Thirty errors in random directions."""
    rng = np.random.default_rng(1)
    q_rad = rng.uniform(-0.5, 0.5, (30, 6))
    error_mm = 0.4 * rng.normal(size=(30, 3))
    effects = joint_errors(robot.load("mh180"), q_rad)
    return ErrorField("made_up", error_mm, q_rad, effects, "synthetic")


@pytest.fixture(scope="module")
def rows(field):
    """All campaigns of the small tournament."""
    work = contest.jobs([field], SMALL)
    everyone = contest.Contest(SMALL, 5, contest.CONTESTANTS, paper.study())
    parts = [contest.campaigns(job, range(3), everyone)[0] for job in work]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


@pytest.mark.parametrize("name", FAMILIES)
def test_synthetic_fields_are_the_size_of_a_calibrated_arms_errors(name):
    made = synthetic(name, 0)
    size = np.linalg.norm(made.error_mm, axis=1)
    assert made.points == 1000
    assert 0.05 < size.mean() < 2.0
    assert 0.3 < size.max() < 5.0
    assert np.array_equal(made.error_mm, synthetic(name, 0).error_mm)


def test_a_defect_and_rare_poses_make_a_heavier_tail_than_smooth_errors():
    def tail(name):
        size = np.linalg.norm(synthetic(name, 0).error_mm, axis=1)
        return size.max() / np.median(size)

    assert tail("defect") > 1.2 * tail("smooth")
    assert tail("rare") > 3.0 * tail("smooth")


def test_measured_fields_average_the_readings_of_a_pose_and_leave_out_what_was_fitted():
    errors = {
        "comparison": np.array(["dh_vs_measured"] * 4 + ["vec_vs_measured"], object),
        "estimate": np.array(["cross_validated"] * 3 + ["train"] * 2, object),
        "pose": np.array([7, 7, 8, 9, 9]),
        "target": np.array(["tool"] * 5, object),
        "ex_mm": np.array([1.0, 3.0, 5.0, 50.0, 50.0]),
        "ey_mm": np.zeros(5),
        "ez_mm": np.zeros(5),
    }
    measurements = {"pose": np.array([9, 8, 7, 7]), "q1": np.array([0.9, 0.8, 0.7, 0.71])}
    made = of_measurements("arm", None, errors, measurements)
    assert made.error_mm[:, 0].tolist() == [2.0, 5.0]
    assert made.q_rad[:, 0].tolist() == [0.7, 0.8]


def test_a_field_without_cross_validated_errors_says_what_to_do():
    columns = {name: np.array(["train"], object) for name in ("comparison", "estimate")}
    with pytest.raises(InputError, match=r"measurements\.folds"):
        of_measurements("arm", None, columns, {})


def test_points_of_the_paper_become_its_field():
    points = {f"q{i}": np.arange(3.0) for i in range(1, 7)}
    points |= {f"e{axis}_mm": np.arange(3.0) for axis in "xyz"} | {"true_error_mm": np.zeros(3)}
    assert of_points("mh180", robot.load("mh180"), points).error_mm.shape == (3, 3)


def test_errors_that_are_not_finite_are_refused():
    with pytest.raises(InputError, match="not finite"):
        ErrorField("bad", np.full((2, 3), np.nan), np.zeros((2, 6)))


def test_every_assessor_is_in_every_cell(rows):
    assert set(rows["assessor"]) == set(ASSESSORS)
    first = rows["assessor"] == "search_and_confirm"
    first &= rows["target"] == "measured"
    assert first.sum() == 2 * 2 * 3
    assert np.all(rows["measurements"] <= rows["budget"])
    assert np.all(rows["points_visited"] <= rows["candidates"])


def test_parts_of_any_number_give_the_same_table(field):
    names = ("maximum", "single_shot")
    two = contest.Contest(replace(SMALL, repetitions=2), 5, names, paper.study())

    def table(parts):
        found = []
        for number in range(1, parts + 1):
            work = contest.part_of(contest.jobs([field], SMALL), number, parts)
            found.append(contest.summed(work, two))
        joined = {name: np.concatenate([each[name] for each in found]) for name in found[0]}
        return summary.in_order(joined)

    whole, scattered = table(1), table(7)
    assert len(whole["assessor"]) == 4 + 4 * 2
    for name, column in whole.items():
        assert repr(column.tolist()) == repr(scattered[name].tolist())


def test_larger_budgets_see_the_same_first_readings(field):
    cell = contest.Cell(field, 20, 0.1)
    few, many = (contest.world_of(cell, 1, visits, 5)[0] for visits in (10, 40))
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
        rows["true_mm"][one & (rows["target"] == target)] for target in ("measured", "candidates")
    )
    assert np.all(measured <= everywhere)
    assert np.any(measured < everywhere)


def test_every_bound_on_enough_readings_is_told_how_near_it_could_be(rows, field):
    enough = (rows["budget"] == 40) & (rows["repetition"] == 1) & ~np.isnan(rows["upper_mm"])
    enough &= np.isin(rows["target"], ("measured", "candidates"))
    assert enough.sum() > 5
    job = contest.Job(contest.Cell(field, 20, 0.1), 40)
    world, _ = contest.world_of(job.cell, 1, 40, 5)
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
    (cell,) = summary.cells(said)
    assert cell["attainable_mm"] == pytest.approx(0.2)
    assert cell["proven_mm"] == pytest.approx(0.15)
    (cell,) = summary.cells(graded(attainable_mm=np.inf))
    assert np.isnan(cell["attainable_mm"])


def graded(**columns) -> dict:
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
    text = ("assessor", "target", "field", "assumption", "setup", "world")
    return {
        name: np.array(np.broadcast_to(value, 5), object if name in text else None)
        for name, value in row.items()
    }


def test_a_cell_is_summed_up_as_by_hand():
    said = graded(
        upper_mm=[1.2, 0.8, 1.4, np.nan, 9.0],
        assumption=np.array(["holds", "holds", "none", "none", "broken"], object),
        value_mm=[1.1, 0.9, 1.1, 0.9, 1.3],
        lower_mm=[0.9, 1.1, 0.9, np.nan, 0.9],
    )
    (cell,) = summary.cells(said)
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
    assert summary.holm(chances, 0.01).tolist() == [False, False, True, False, False]
    assert summary.holm(np.array([0.001, 0.002, 0.9]), 0.01).tolist() == [True, True, False]


def test_an_assessor_that_claims_too_much_is_caught():
    honest = {name: np.tile(column, 200) for name, column in graded().items()}
    assert summary.judged(summary.summed(honest))["rejected"].tolist() == [0]
    bold = graded(upper_mm=[1.2, 1.2, 1.2, 1.2, 0.9])
    bold = {name: np.tile(column, 200) for name, column in bold.items()}
    found = summary.judged(summary.summed(bold))
    assert (found["rejected"][0], found["below"][0]) == (1, 1)
    assert found["worst_holds"][0] == pytest.approx(0.8)


def test_silence_counts_where_what_it_would_rest_on_is_true():
    said = graded(
        upper_mm=[1.2, np.nan, np.nan, np.nan, 1.3],
        assumption=np.array(["holds", "holds", "broken", "broken", "broken"], object),
    )
    found = summary.judged(summary.summed(said))
    assert found["withheld"].tolist() == [pytest.approx(3 / 5)]
    assert found["withheld_sound"].tolist() == [pytest.approx(1 / 2)]


def test_a_bound_of_all_points_but_some_is_held_to_the_largest_of_these(field):
    cell, plain = contest.Cell(field, 30, 0.05), contest.Setup()
    everyone = contest.Contest(SMALL, 5, ("search_and_confirm",), paper.study())
    rows, _ = contest.campaigns(contest.Job(cell, 20, plain), range(3), everyone)
    rows = {name: column[rows["target"] == "candidates"] for name, column in rows.items()}
    left = rows["excepted"].astype(int)
    assert left.min() > 0
    size = np.sort(field.size_mm)[::-1]
    assert rows["true_mm"].tolist() == [size[0]] * 3
    assert rows["bounded_mm"].tolist() == size[left].tolist()
    (summed,) = summary.cells(rows)
    assert summed["upper_holds"] == np.mean(rows["upper_mm"] >= size[left])
    assert summed["lower_holds"] == np.mean(rows["lower_mm"] <= size[0])
    assert summed["excepted"] == left.mean()


def test_lower_bounds_that_claim_too_much_are_caught_and_silence_is_not():
    bold = graded(lower_mm=[0.9, 0.9, 0.9, 0.9, 1.1])
    found = summary.judged(summary.summed({n: np.tile(c, 200) for n, c in bold.items()}))
    assert (found["rejected"][0], found["lower_rejected"][0]) == (0, 1)
    assert found["lower_worst"][0] == pytest.approx(0.8)
    silent = graded(upper_mm=[1.2, np.nan, np.nan, np.nan, 0.9], alarmed=[0, 1, 1, 1, 0])
    found = summary.judged(summary.summed(silent))
    assert found["worst_holds"][0] == pytest.approx(1 / 2)
    assert found["worst_begun"][0] == pytest.approx(4 / 5)
    assert found["alarmed"][0] == pytest.approx(3 / 5)


def test_every_world_with_every_setup_is_a_row_of_its_own(field):
    setups = (
        contest.Setup(worlds=("stated", "noise_1.2")),
        contest.Setup("estimated", {"noise": "estimated"}, ("noise_1.2",)),
    )
    size = replace(SMALL, noise_mm=(0.1,), budgets={20: (40,)}, setups=setups)
    names = ("maximum", "search_and_confirm", "sequential")
    given = contest.Contest(size, 5, names, paper.study())
    found = summary.in_order(contest.summed(contest.jobs([field], size), given))
    of_all = found["target"] == "candidates"
    kinds = zip(*(found[n][of_all] for n in ("assessor", "setup", "world")), strict=True)
    assert sorted(kinds) == [
        ("maximum", "plain", "stated"),  # looks back: it has readings as stated alone
        ("search_and_confirm", "estimated", "noise_1.2"),
        ("search_and_confirm", "plain", "noise_1.2"),
        ("search_and_confirm", "plain", "stated"),
        ("sequential", "plain", "noise_1.2"),
        ("sequential", "plain", "stated"),  # knows no setting `noise`
    ]


def test_few_campaigns_do_not_tell_three_points_from_chance():
    few = graded(upper_mm=[1.2, 1.2, 1.2, 1.2, 0.9])
    assert summary.judged(summary.summed(few))["below"].tolist() == [0]

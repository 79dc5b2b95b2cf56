"""The adaptive assessors: one interface, honest bounds, nothing lost and nothing taken amiss."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import paper_settings as paper
import pytest

from kinacc.assess.adaptive import Candidates, Ledger
from kinacc.assess.counts import excepted
from kinacc.assess.error_effects import joint_errors
from kinacc.assess.invalidation_calibrated import InvalidationCalibrated
from kinacc.assess.population import largest_size
from kinacc.assess.random_numbers import key_of
from kinacc.assess.registry import ADAPTIVE, ASSESSORS, RECOMMENDED
from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.assess.simulate import conduct
from kinacc.assess.single_shot import SingleShot
from kinacc.assess.statement import CANDIDATES, MEASURED, TARGETS
from kinacc.assess.world import drawn_world
from kinacc.errors import InputError
from kinacc.kinematics import robot

BOUNDING = [SingleShot, InvalidationCalibrated, SearchAndConfirm]
LIVE = [paper.assessor(name, measurements=40) for name in ADAPTIVE]


def directions(points: int, seed: int = 5) -> np.ndarray:
    """Unit vectors."""
    vectors = np.random.default_rng(seed).normal(size=(points, 3))
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


def field(points: int, seed: int = 5) -> np.ndarray:
    """Errors of 0.2 to 1 mm, larger ones rarer."""
    size = 1.0 - 0.8 * np.random.default_rng(seed).uniform(size=points) ** 0.5
    return directions(points, seed) * size[:, None]


def world(points: int = 30, sigma: float = 0.1, seed: int = 1, visits: int = 200):
    return drawn_world(field(points), sigma, key_of(seed), visits)


def arm_at(points: int) -> dict[str, np.ndarray]:
    """Joints and effects of points, for assessors that use them."""
    q_rad = np.random.default_rng(11).uniform(-0.8, 0.8, (points, 6))
    return {"q_rad": q_rad, "effects": joint_errors(robot.load("mh180"), q_rad)}


def some_candidates(points: int = 30) -> Candidates:
    """Candidates with everything that may be known of them."""
    return Candidates.with_equal_noise(np.full(points, 0.1), **arm_at(points))


@pytest.mark.parametrize("assessor", LIVE, ids=lambda each: each.name)
@pytest.mark.parametrize("points", [1, 2, 15, 60])
def test_every_assessor_keeps_its_budget_and_says_something_at_the_end(assessor, points):
    campaign = conduct(assessor, world(points), **arm_at(points))
    said = campaign.statements()
    assert {each.target for each in said} <= set(TARGETS)
    assert said[0].value_mm > 0.0 or said[0].withheld
    assert not said[0].withheld or type(assessor) not in BOUNDING
    assert campaign.ledger.taken <= assessor.measurements
    for each in said:
        if not each.withheld and not math.isnan(each.upper_mm):
            assert each.lower_mm <= each.upper_mm
            assert each.confidence == 0.95
    assert campaign.next() is None


@pytest.mark.parametrize("assessor", LIVE, ids=lambda each: each.name)
def test_a_campaign_told_its_readings_again_goes_on_as_before(assessor):
    readings, candidates = world(), some_candidates()
    first, reads, told = assessor.begin(candidates), np.zeros(30, int), []
    while (point := first.next()) is not None:
        if len(told) % 9 == 0:
            again = assessor.begin(candidates)
            for each in told:
                assert again.next() == each[0]
                again.record(*each)
            assert again.next() == point
        told.append((point, readings.reading_mm(point, int(reads[point])).copy()))
        first.record(*told[-1])
        reads[point] += 1
    assert 1 <= len(told) <= 40


@pytest.mark.parametrize("assessor", LIVE, ids=lambda each: each.name)
def test_asking_for_the_next_point_or_a_statement_changes_nothing(assessor):
    readings, candidates = world(), some_candidates()
    asked, other = assessor.begin(candidates), assessor.begin(candidates)
    reads = np.zeros(30, int)
    while (point := other.next()) is not None:
        if other.ledger.taken % 9 == 0:
            asked.statements()
            assert asked.next() == asked.next()
        for campaign in (asked, other):
            campaign.record(point, readings.reading_mm(point, int(reads[point])))
        reads[point] += 1
    assert repr(asked.statements()) == repr(other.statements())


@pytest.mark.parametrize("assessor", LIVE, ids=lambda each: each.name)
def test_an_assessor_begins_with_what_it_says_it_needs_and_not_with_less(assessor):
    sigma, arm = np.full(30, 0.1), arm_at(30)
    needed = {name: arm[name] for name in assessor.needs}
    assert conduct(assessor, world(), **needed).statements()
    if needed:
        with pytest.raises(InputError, match="needs to know the arm") as caught:
            assessor.begin(Candidates.with_equal_noise(sigma))
        assert len(caught.value.problems) == len(needed)


@pytest.mark.parametrize("cls", BOUNDING)
def test_hardly_any_noise_leaves_hardly_any_doubt(cls):
    shell = directions(30) * np.linspace(0.98, 1.0, 30)[:, None]
    said = conduct(
        paper.assessor(cls, measurements=60), drawn_world(shell, 1e-6, key_of(2), 60)
    ).statements()[0]
    assert said.value_mm == pytest.approx(1.0, abs=0.02)
    assert said.upper_mm == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("cls", BOUNDING)
def test_points_that_are_all_equal_are_no_trouble(cls):
    errors = np.tile([0.3, 0.0, 0.0], (20, 1))
    said = conduct(
        paper.assessor(cls, measurements=50), drawn_world(errors, 0.05, key_of(3), 50)
    ).statements()[0]
    assert said.lower_mm <= 0.3 <= said.upper_mm


@pytest.mark.parametrize("assessor", LIVE, ids=lambda each: each.name)
def test_a_reading_that_cannot_be_used_changes_nothing(assessor):
    readings, candidates = world(), some_candidates()
    one, other = assessor.begin(candidates), assessor.begin(candidates)
    bad = [
        (0, [math.nan, 0.0, 0.0], None),
        (0, [0.0, 0.0], None),
        (30, [0.0, 0.0, 0.0], None),
        (-1, [0.0, 0.0, 0.0], None),
        (0, [0.1, 0.0, 0.0], np.zeros((3, 3))),
        (0, [0.1, 0.0, 0.0], np.diag([1.0, 1.0, -1.0])),
        (0, [0.1, 0.0, 0.0], [[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        (0, [0.1, 0.0, 0.0], np.eye(2)),
    ]
    reads = np.zeros(30, int)
    while (point := one.next()) is not None:
        for wrong in bad:
            with pytest.raises(InputError):
                other.record(*wrong)
        for campaign in (one, other):
            campaign.record(point, readings.reading_mm(point, int(reads[point])))
        reads[point] += 1
        assert other.next() == one.next()
    assert repr(other.statements()) == repr(one.statements())


@pytest.mark.parametrize(
    ("covariance", "said"),
    [
        (np.zeros((2, 3, 3)), "not positive definite"),
        (np.stack([np.eye(3), np.diag([1.0, 1.0, -1e-3])]), "point 1: not positive definite"),
        (np.array([[[1.0, 0.9, 0], [0, 1, 0], [0, 0, 1]]]), "not symmetric"),
        (np.full((1, 3, 3), np.nan), "not finite"),
        (np.eye(3), "shape"),
        (np.ones((3, 3, 3)), "not positive definite"),
    ],
)
def test_covariances_that_are_none_are_refused_with_their_point(covariance, said):
    with pytest.raises(InputError, match=said):
        Candidates(covariance)


@pytest.mark.parametrize("cls", BOUNDING)
def test_settings_that_make_no_sense_are_refused_together(cls):
    with pytest.raises(InputError) as caught:
        paper.assessor(cls, measurements=0, confidence=1.5)
    assert {"measurements", "confidence"} <= {each.where for each in caught.value.problems}


def test_unequal_noise_is_weighted_as_least_squares_would():
    ledger = Ledger(Candidates.with_equal_noise(np.full(2, 0.1)))
    rng = np.random.default_rng(6)
    readings = rng.normal(size=(5, 3))
    spreads = [np.diag(rng.uniform(0.5, 2.0, 3)) + 0.2 for _ in readings]
    spreads[0] = 0.01 * np.eye(3)
    for reading, spread in zip(readings, spreads, strict=True):
        ledger.record(1, reading, spread)
    inverses = [np.linalg.inv(each) for each in spreads]
    total = np.linalg.inv(sum(inverses))
    weighted = sum(each @ reading for each, reading in zip(inverses, readings, strict=True))
    assert ledger.mean_mm[1] == pytest.approx(total @ weighted)
    assert ledger.noise(1) == pytest.approx(total)


def coverage(assessor, errors, sigma, draws, target=MEASURED):
    """Share of campaigns whose upper bound, and lower bound, hold."""
    size = np.linalg.norm(errors, axis=1)
    upper = lower = said_any = 0
    for draw in range(draws):
        order = np.random.default_rng([draw, 3]).permutation(len(errors))
        readings = drawn_world(errors[order], sigma, key_of(4, draw), assessor.measurements)
        campaign = conduct(assessor, readings)
        said = next(each for each in campaign.statements() if each.target == target)
        truth = size[order][campaign.ledger.visited].max() if target == MEASURED else size.max()
        if not said.withheld:
            said_any += 1
            upper += said.upper_mm >= truth
            lower += said.lower_mm <= truth
    return upper / said_any, lower / said_any


def least(draws: int) -> float:
    """Share of bounds that 95 % confidence may fall to by chance in a test of many."""
    return 0.95 - 3.5 * math.sqrt(0.05 * 0.95 / draws)


@pytest.mark.parametrize("cls", BOUNDING)
@pytest.mark.parametrize("shape", ["one", "equal", "spread"])
def test_the_bound_on_the_measured_points_holds(cls, shape):
    # One large error is the hardest for the upper limit: no other point's noise comes to its aid.
    errors = {
        "one": np.vstack([[[1.0, 0.0, 0.0]], 1e-3 * directions(24)]),
        "equal": directions(25),
        "spread": field(25),
    }[shape]
    draws = 400
    upper, lower = coverage(paper.assessor(cls, measurements=40), errors, 0.2, draws)
    assert upper >= least(draws)
    assert lower >= least(draws)


def test_the_single_shot_bound_is_exact_where_one_point_decides():
    errors = np.vstack([[[1.0, 0.0, 0.0]], 1e-3 * directions(24)])
    upper, _ = coverage(ADAPTIVE["single_shot"](measurements=25), errors, 0.1, 1500)
    assert upper == pytest.approx(0.95, abs=0.02)


def test_the_recommended_bound_on_all_but_a_few_candidates_holds_whatever_is_missed():
    # As many large errors as are excepted, and one more: the hardest that there is.
    points, budget, draws = 40, 20, 400
    settings = SearchAndConfirm(budget)
    size = np.full(points, 1e-3)
    size[: excepted(points, settings.visit(points), 0.025) + 1] = 1.0
    held = 0
    for draw in range(draws):
        order = np.random.default_rng([draw, 9]).permutation(points)
        errors = (directions(points) * size[:, None])[order]
        said = conduct(settings, drawn_world(errors, 0.2, key_of(12, draw), budget)).statements()[1]
        held += said.upper_mm >= np.sort(size)[::-1][said.excepted]
    assert 0 < said.excepted < points // 2
    assert held / draws >= least(draws)


def test_a_visit_ended_early_speaks_of_all_but_the_points_that_all_can_be_missed():
    campaign = SearchAndConfirm(40).begin(Candidates.with_equal_noise(np.full(40, 0.05)))
    for row, reading in enumerate(field(40)[:30]):
        assert campaign.next() == row
        campaign.record(row, reading)
    about = campaign.statements()[1]
    left = about.excepted
    ways = [math.comb(40 - count, 30) / math.comb(40, 30) for count in (left, left + 1)]
    assert ways[0] > 0.025 >= ways[1]
    assert not about.assumption


def test_no_recommended_bound_is_below_its_value():
    errors = field(40)
    for draw in range(60):
        campaign = conduct(SearchAndConfirm(40), drawn_world(errors, 0.3, key_of(6, draw), 40))
        for said in campaign.statements():
            assert said.upper_mm >= said.value_mm


def test_with_a_reading_for_nearly_every_candidate_the_recommended_bound_assumes_nothing():
    # The largest error all alone: whoever misses it knows nothing of it.
    errors = np.vstack([[[1.0, 0.0, 0.0]], 1e-3 * directions(59)])
    upper, _ = coverage(SearchAndConfirm(60), errors, 0.1, 400, CANDIDATES)
    assert upper >= least(400)
    campaign = conduct(SearchAndConfirm(60), drawn_world(errors, 0.1, key_of(5), 60))
    assert len(campaign.ledger.visited) == 59
    assert not campaign.statements()[1].assumption


def test_more_budget_than_candidates_visits_them_all_and_needs_no_assumption():
    measured, everywhere = conduct(SearchAndConfirm(60), world(30)).statements()
    assert everywhere.upper_mm == measured.upper_mm
    assert not everywhere.assumption


def test_the_population_shrinks_the_largest_of_many_noisy_readings():
    rng = np.random.default_rng(9)
    errors = np.linalg.norm(0.4 * directions(200) + 0.3 * rng.normal(size=(200, 3)), axis=1)
    found = largest_size(errors, np.full(200, 0.3), 0)
    assert 0.4 < found.quantile_mm(0.5) < 0.8 * errors.max()
    exact = largest_size(errors, np.full(200, 1e-4), 0)
    assert exact.quantile_mm(0.5) == pytest.approx(errors.max(), rel=0.01)


@pytest.mark.parametrize("assessor", LIVE, ids=lambda each: each.name)
def test_every_measured_point_has_limits_and_no_other(assessor):
    campaign = assessor.begin(some_candidates())
    assert campaign.point_limits() == {}
    readings, reads = world(seed=3), np.zeros(30, int)
    while (point := campaign.next()) is not None:
        campaign.record(point, readings.reading_mm(point, int(reads[point])))
        reads[point] += 1
        if campaign.ledger.taken % 9 == 0:
            assert set(campaign.point_limits()) == set(campaign.ledger.visited)
    limits = campaign.point_limits()
    size = np.linalg.norm(field(30), axis=1)
    assert all(0.0 <= lower < upper for lower, upper in limits.values())
    assert all(lower <= size[row] for row, (lower, _) in limits.items())
    assert np.mean([size[row] <= upper for row, (_, upper) in limits.items()]) > 0.8


def test_the_registry_names_the_recommended_assessor():
    assert RECOMMENDED in ADAPTIVE
    assert all(cls.name == name and cls.__doc__ for name, cls in ASSESSORS.items())


def test_looking_through_the_registry_imports_no_assessor():
    code = "import sys, kinacc.assess.registry as r; list(r.ADAPTIVE), 'maximum' in r.ASSESSORS; "
    code += "print([each for each in sys.modules if each.startswith(('kinacc.assess.', 'numpy'))])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "['kinacc.assess.registry']"

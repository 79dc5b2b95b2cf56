"""Assessors that were no better than those of kinacc: what they state still holds."""

from __future__ import annotations

import math

import numpy as np
import paper_settings as paper
import pytest

from kinacc.assess.adaptive import Candidates
from kinacc.assess.random_numbers import key_of
from kinacc.assess.simulate import carry_on, conduct
from kinacc.assess.statement import CANDIDATES, MEASURED, Reason
from kinacc.assess.world import drawn_world
from kinacc.errors import InputError
from kinacc.kinematics import robot
from research.error_effects import joint_errors
from research.kinematic import Kinematic
from research.kinematic_model import Basis, fitted_scales
from research.sequential import Sequential
from research.two_stage import TwoStage

ARM = robot.load("mh180")


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


@pytest.mark.parametrize("cls", [TwoStage, Sequential])
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


def test_a_budget_smaller_than_the_two_stages_is_refused():
    with pytest.raises(InputError, match="do not cover one point and its 4 repeats"):
        TwoStage(measurements=4)


def test_stopping_early_when_the_bounds_are_close_saves_measurements():
    campaign = conduct(Sequential(400, width_mm=0.25), world(30, 0.05))
    said = campaign.statements()[0]
    assert said.upper_mm - said.lower_mm <= 0.25
    assert campaign.ledger.taken < 200


def test_a_suspect_of_the_second_stage_is_known_by_its_new_readings_alone():
    campaign = TwoStage(measurements=10, repeats=4).begin(
        Candidates.with_equal_noise(np.full(6, 0.1))
    )
    for row in range(6):
        campaign.record(row, [0.1 * row, 0.0, 0.0])
    assert campaign.next() == 5
    campaign.record(5, [0.3, 0.0, 0.0])
    campaign.record(5, [0.1, 0.0, 0.0])
    assert campaign.ledger.mean_mm[5] == pytest.approx([0.2, 0.0, 0.0])
    assert campaign.ledger.noise(5) == pytest.approx(0.1 / math.sqrt(2.0))
    assert campaign.ledger.taken == 8
    assert campaign.ledger.visited == [0, 1, 2, 3, 4, 5]


def test_one_first_reading_far_off_does_not_carry_the_lower_bound_where_its_point_is_read_again():
    rng = np.random.default_rng(16)
    errors = np.full((30, 3), 0.3 / math.sqrt(3.0))
    campaign = Sequential(60).begin(Candidates.with_equal_noise(np.full(30, 0.1)))
    far = 1.5 / 0.3 * errors[7]
    carry_on(
        campaign,
        lambda row, visit: (
            far if (row, visit) == (7, 0) else errors[row] + 0.1 * rng.normal(size=3)
        ),
    )
    assert 0.2 < campaign.statements()[0].lower_mm < 0.3


def joints(points: int, seed: int = 2) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-0.9, 0.9, (points, 6))


def smooth_errors(q_rad: np.ndarray, seed: int = 3) -> np.ndarray:
    """Errors (m, 3) of about 0.5 mm by two waves in every error of every joint."""
    rng = np.random.default_rng(seed)
    effects = joint_errors(ARM, q_rad)
    angle = np.repeat(q_rad, 6, axis=1)
    causes = rng.normal(size=36) * np.sin(1.5 * angle) + rng.normal(size=36) * np.cos(2.5 * angle)
    errors = np.einsum("nic,nc->ni", effects, causes)
    return 0.5 * errors / np.sqrt(np.mean(np.sum(errors**2, axis=1)))


def known(q_rad: np.ndarray) -> dict[str, np.ndarray]:
    return {"q_rad": q_rad, "effects": joint_errors(ARM, q_rad)}


def test_smooth_errors_of_joints_are_told_from_local_ones():
    q_rad = joints(150)
    errors = smooth_errors(q_rad)
    local = 0.15 * np.random.default_rng(9).normal(size=errors.shape)
    basis = Basis.of(**known(q_rad))
    noise = np.full(150, 0.01)
    assert fitted_scales(basis, np.arange(150), errors, noise).local_mm2 < 0.03**2
    found = fitted_scales(basis, np.arange(150), errors + local, noise).local_mm2
    assert 0.1**2 < found < 0.2**2


def test_the_kinematic_process_finds_and_bounds_the_largest_of_smooth_errors():
    q_rad = joints(160)
    errors = smooth_errors(q_rad)
    readings = drawn_world(errors, 0.1, key_of(10), 150)
    campaign = conduct(Kinematic(150, **known(q_rad)), readings)
    everywhere, measured = campaign.statements()
    truth = np.linalg.norm(errors, axis=1).max()
    assert (everywhere.target, measured.target) == (CANDIDATES, MEASURED)
    assert everywhere.lower_mm <= truth <= everywhere.upper_mm
    assert everywhere.upper_mm - truth < 0.15
    assert len(campaign.ledger.visited) < 150
    assert measured.assumption == Reason("smooth")
    assert everywhere.assumption.numbers["crowd"] > 0


def test_the_kinematic_process_withholds_what_joints_do_not_explain():
    q_rad = joints(150)
    defect = smooth_errors(q_rad)
    defect[:3] += [1.5, 0.0, 0.0]
    said = conduct(Kinematic(150, **known(q_rad)), drawn_world(defect, 0.05, key_of(11), 150))
    assert said.statements()[0].withheld.code == "unexplained_reading"
    chance = 0.4 * np.random.default_rng(12).normal(size=(150, 3))
    said = conduct(Kinematic(150, **known(q_rad)), drawn_world(chance, 0.05, key_of(11), 150))
    assert said.statements()[0].withheld
    few = conduct(Kinematic(60, **known(q_rad)), drawn_world(chance, 0.05, key_of(11), 60))
    assert few.statements()[0].withheld == Reason("few_for_model", {"first": 36, "needed": 84})


def test_the_kinematic_process_asks_for_what_it_needs():
    with pytest.raises(InputError) as caught:
        Kinematic(20).begin(Candidates.with_equal_noise(np.full(5, 0.1)))
    assert [each.where for each in caught.value.problems] == [
        "q_rad",
        "effects",
    ]


def test_the_kinematic_process_needs_a_component_for_every_coefficient():
    """Two causes a joint, each a polynomial of order 2: the first visit must hold their number."""
    enough = paper.assessor(Kinematic, measurements=600)
    assert enough.shortfall(400, 6) is None
    few = paper.assessor(Kinematic, measurements=6).shortfall(400, 6)
    assert few.code == "no_bound_ahead"
    needed = few.numbers["needed"]
    assert paper.assessor(Kinematic, measurements=6).shortfall(400, 12).numbers["needed"] == (
        pytest.approx(2 * needed, abs=1)
    )
    # All of so many points are visited at first where the budget is half as large again.
    assert enough.shortfall(needed, 6) is None
    assert enough.shortfall(needed - 1, 6) == few

"""Chosen poses against brute force on tiny sets, the indices, and sets taken at random."""

from itertools import combinations

import numpy as np
import paper_settings as paper
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinacc.deployment.planning import candidates, exchange, observability
from kinacc.deployment.planning.information import information
from kinacc.errors import InputError
from kinacc.kinematics import robot


def tiny(seed, count=11, components=2, directions=4):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(count, components, directions)) * rng.uniform(0.3, 3.0, directions)


def brute_force(rows, count, index):
    """Index of every set, by numpy's singular values."""
    return {
        chosen: observability.of_poses(index, rows, np.array(chosen))
        for chosen in combinations(range(len(rows)), count)
    }


@pytest.mark.parametrize("index", observability.INDICES)
def test_indices_are_those_of_the_literature(index):
    rows = tiny(0)
    chosen = np.array([1, 4, 5, 9])
    values = np.linalg.svd(rows[chosen].reshape(-1, 4), compute_uv=False)
    wanted = {
        "O1": np.prod(values) ** (1 / 4) / np.sqrt(4),
        "O2": values[-1] / values[0],
        "O3": values[-1],
        "O4": values[-1] ** 2 / values[0],
        "O5": 1.0 / np.sum(1.0 / values),
    }
    assert observability.of_poses(index, rows, chosen) == pytest.approx(wanted[index], rel=1e-12)


@settings(max_examples=60)
@given(st.integers(0, 100_000), st.sampled_from(sorted(observability.INDICES)))
def test_the_best_addition_is_the_best_of_all(seed, index):
    rows = tiny(seed, count=40)
    start = np.arange(3)
    normal = sum(rows[i].T @ rows[i] for i in start)
    free = np.arange(3, 40)
    best, value = observability.best_addition(index, normal, rows, free, 4)
    every = [observability.of_poses(index, rows, np.array([*start, j])) for j in free]
    assert value == pytest.approx(max(every), rel=1e-8)
    assert every[best - 3] == pytest.approx(max(every), rel=1e-8)


@pytest.mark.parametrize("index", observability.INDICES)
def test_no_single_swap_improves_and_the_best_set_is_near(index):
    shares, above = [], []
    for seed in range(12):
        rows = tiny(seed)
        found = exchange.choose(rows, 4, index)
        assert len(set(found.chosen.tolist())) == 4
        for place in range(4):
            for other in set(range(len(rows))) - set(found.chosen.tolist()):
                swapped = found.chosen.copy()
                swapped[place] = other
                assert observability.of_poses(index, rows, swapped) <= found.value * (1 + 1e-8)
        every = brute_force(rows, 4, index)
        assert found.value <= max(every.values()) * (1 + 1e-12)
        shares.append(found.value / max(every.values()))
        above.append(np.mean(np.array(list(every.values())) > found.value * (1 + 1e-9)))
    assert np.median(shares) > 0.97
    assert min(shares) > 0.8
    # Far up among all sets, if not on top of them.
    assert np.mean(above) < 0.01
    assert max(above) < 0.1


@pytest.mark.parametrize("index", observability.INDICES)
def test_planned_poses_of_an_arm_beat_random_ones(index):
    arm = robot.load("ur10")
    joints = candidates.spread(arm, 200)
    told = information(arm, joints, paper.experiment(robot.carried(arm), hayati_joints=(2, 3)))
    found = exchange.choose(told.rows, 15, index)
    random = exchange.random_sets(told.rows, np.array([15]), index, 100, 0)
    assert found.value > random.max()
    assert found.value >= found.path[-1]
    assert (found.path[:4] == 0.0).all()  # four full poses cannot tell thirty directions
    again = exchange.choose(told.rows, 15, index)
    assert again.chosen.tolist() == found.chosen.tolist()


def test_a_d_optimal_set_shrinks_the_volume_of_the_uncertainty():
    """The determinant of a real fit's covariance falls as O1 says it does."""
    arm = robot.load("mh180")
    joints = candidates.spread(arm, 150)
    told = information(arm, joints, paper.experiment(robot.carried(arm), frames_estimated=False))
    found = exchange.choose(told.rows, 12, "O1")
    flat = told.rows[found.chosen].reshape(-1, told.rows.shape[2])
    _, log_determinant = np.linalg.slogdet(np.linalg.inv(flat.T @ flat))
    by_index = -2.0 * told.rank * np.log(found.value * np.sqrt(12))
    assert log_determinant == pytest.approx(by_index, rel=1e-9)


def test_what_cannot_be_chosen_is_said_all_at_once():
    with pytest.raises(InputError) as caught:
        exchange.choose(tiny(0), 20, "O7")
    assert len(caught.value.problems) == 2
    with pytest.raises(InputError, match="at least 2"):
        exchange.choose(tiny(0), 1, "O1")


@pytest.mark.parametrize("seed", range(20, 32))
def test_the_fewest_poses_that_tell_everything(seed):
    """Without any one of them a direction is lost, which rounding may hide or not."""
    rows = np.random.default_rng(seed).integers(-2, 3, (30, 3, 7)).astype(float)
    found = exchange.choose(rows, 3, "O1")
    flat = rows[found.chosen].reshape(-1, 7)
    assert np.linalg.matrix_rank(flat) == 7

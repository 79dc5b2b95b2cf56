"""The shipped draws of the synthetic arm: numbered, repeatable, and for this arm alone."""

from __future__ import annotations

import numpy as np
import pytest

from kinacc.config.schema import defaults
from kinacc.errors import InputError
from kinacc.study import in_memory
from kinacc.synthetic import accepted, measure


@pytest.fixture(scope="module")
def config() -> dict:
    return {"robot": "mh180", **defaults()}


def seeds() -> list[int]:
    return [int(row["seed"]) for row in accepted.rows()]


def test_a_shipped_draw_and_twenty_further_in_seed_order():
    assert len(seeds()) >= 21
    assert seeds() == sorted(set(seeds()))


def test_an_unknown_draw_says_how_many_there_are():
    with pytest.raises(InputError, match=r"0 to \d+"):
        accepted.accepted_draw(10_000)
    with pytest.raises(InputError, match="at most"):
        accepted.further_draws(0, 10_000)


def test_further_draws_leave_the_own_one_out():
    assert accepted.further_draws(0, 3) == [1, 2, 3]
    assert accepted.further_draws(2, 3) == [0, 1, 3]


def test_another_arm_is_refused():
    from kinacc.kinematics import robot

    settings = {"draw": 0, "poses": 10, "tracker_noise_mm": 0.0}
    with pytest.raises(InputError, match="ur10"):
        measure(robot.load("ur10"), settings)


def test_measurements_repeat_to_the_bit(config):
    from kinacc.kinematics import robot

    arm, settings = robot.load("mh180"), config["measurements"]["synthetic"]
    one, two = measure(arm, settings), measure(arm, settings)
    assert all(np.array_equal(one[name], two[name]) for name in one)


def test_next_to_no_pose_of_the_map_is_beyond_the_fitted_range(config):
    coarse = {**config, "map": {**config["map"], "grid_mm": 100.0}}
    made = in_memory.run(("measurements", "vec", "dh", "accuracy_map"), coarse, {})["accuracy_map"]
    # 0.2 % of the shipped map's combinations, and more of a coarse grid's, which has more of edges.
    assert np.sum(made["extrapolating"]) < 0.01 * np.sum(made["wanted"])
    assert np.all(made["solutions"] > 0)

"""Planned poses: what they show is that of a fit, sets beat random ones, paths are near the
shortest.
"""

from itertools import combinations, permutations

import numpy as np
import paper_settings as paper
import pytest

from kinacc.calibration import fitting
from kinacc.calibration.dh_estimator import free_parameters
from kinacc.calibration.observations import full_poses
from kinacc.deployment.planning import (
    between,
    choose,
    distances,
    information,
    observability,
    plan_poses,
    shortest_path,
    spread,
)
from kinacc.errors import InputError
from kinacc.geometry import Pose, compose, exp_so3
from kinacc.kinematics import dh, robot

TOOL = Pose(exp_so3(np.array([0.1, -0.3, 0.2])), np.array([40.0, 15.0, 120.0]))


@pytest.mark.parametrize(("name", "hayati"), [("mh180", ()), ("ur10", (2, 3))])
def test_the_rank_is_that_of_a_fit_to_the_same_poses(name, hayati):
    arm = robot.load(name)
    joints = spread(arm, 120)
    shown = information(arm, joints, paper.experiment(TOOL, hayati_joints=hayati))
    q_dh = joints @ arm.joint_map.T
    fit = fitting.fit(
        full_poses(q_dh, compose(dh.forward(arm.dh, q_dh), TOOL)),
        arm.dh,
        free=free_parameters(6, hayati),
        rotation_weight_mm_per_rad=500.0,
        threshold=1e-3,
    )
    assert shown.rank == 12 + fit.solution.spectrum.rank
    assert shown.rows.shape == (120, 6, shown.rank)


def test_candidates_between_measured_poses_are_on_the_way_to_one_of_the_nearest():
    measured = np.arange(40.0)[:, None] * [1.0, 0.0]
    found = between(measured, np.ones(2), 500, 1)
    ends = np.abs(found[:, :1] - measured[:, 0]).min(axis=1)
    assert ends.min() > 0.0  # and no pose again
    assert (found[:, 1] == 0.0).all()
    assert 0.0 < found[:, 0].min() < found[:, 0].max() < 39.0


def test_candidates_are_where_they_were_asked_to_be():
    arm = robot.load("mh180")

    def inside(position_mm):
        return (position_mm[:, 2] > 0.0) & (position_mm[:, 0] > 800.0)

    joints = spread(arm, 60, None, inside, TOOL)
    assert inside(compose(dh.forward(arm.dh, joints), TOOL).position_mm).all()
    assert ((joints >= arm.q_min_rad) & (joints <= arm.q_max_rad)).all()
    assert len(np.unique(joints, axis=0)) == 60
    with pytest.raises(InputError, match="only 0 of"):
        spread(arm, 10, None, lambda position_mm: position_mm[:, 0] > 9000.0)
    low, high = arm.q_min_rad.copy(), arm.q_max_rad.copy()
    low[2], high[2] = 4.0, 5.0
    with pytest.raises(InputError, match="joint 3"):
        spread(arm, 10, (low, high))


def test_no_single_swap_improves_and_the_best_set_is_near():
    shares = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        rows = rng.normal(size=(11, 2, 4)) * rng.uniform(0.3, 3.0, 4)
        chosen, index = choose(rows, 4)
        assert index[-1] == pytest.approx(observability(rows[chosen]), rel=1e-12)
        values = np.linalg.svd(rows[chosen].reshape(-1, 4), compute_uv=False)
        assert index[-1] == pytest.approx(np.prod(values) ** 0.25 / 2.0, rel=1e-12)
        for place in range(4):
            for other in set(range(11)) - set(chosen.tolist()):
                swapped = chosen.copy()
                swapped[place] = other
                assert observability(rows[swapped]) <= index[-1] * (1 + 2e-6)
        sets = rows[[*combinations(range(11), 4)]].reshape(-1, 8, 4)
        best = (np.linalg.svd(sets, compute_uv=False).prod(axis=1) ** 0.25 / 2.0).max()
        shares.append(index[-1] / best)
    assert np.median(shares) > 0.97
    assert 0.8 < min(shares) <= max(shares) <= 1.0 + 1e-12


def test_planned_poses_of_an_arm_beat_random_ones_and_are_driven_on_a_short_way():
    arm = robot.load("ur10")
    joints = spread(arm, 200)
    asked = paper.experiment(robot.carried(arm), hayati_joints=(2, 3))
    plan = plan_poses(arm, joints, asked, 15, np.zeros(6))
    rows, rng = information(arm, joints, asked).rows, np.random.default_rng(0)
    random = [observability(rows[rng.permutation(200)[:15]]) for _ in range(100)]
    assert plan.index[-1] > max(random)
    assert (plan.index[:4] == 0.0).all()  # four full poses cannot tell thirty directions
    assert len(set(plan.chosen.tolist())) == 15
    assert plan.moves_rad.sum() < plan.candidate_travel_rad
    moves = np.diff(joints[plan.chosen], axis=0, prepend=0.0)
    np.testing.assert_allclose(plan.moves_rad, np.abs(moves).max(axis=1))
    with pytest.raises(InputError, match="at most"):
        choose(rows, 201)
    with pytest.raises(InputError, match="at least"):
        choose(rows, 1)


def test_paths_are_near_the_shortest_of_all():
    shares = []
    for seed in range(15):
        places = np.random.default_rng(seed).uniform(-2, 2, (7, 6))
        distance = distances(places)

        def length(path, distance=distance):
            return distance[path[:-1], path[1:]].sum()

        path = shortest_path(places)
        assert path[0] == 0
        assert sorted(path.tolist()) == list(range(7))
        best = min(length(np.array([0, *rest])) for rest in permutations(range(1, 7)))
        shares.append(length(path) / best)
    assert min(shares) >= 1.0 - 1e-12
    assert np.mean(shares) < 1.05

"""Which of many whole turns a joint takes: every turn tried by brute force."""

from __future__ import annotations

import numpy as np
import pytest

from kinacc.kinematics import dh, inverse, robot
from kinacc.kinematics.inverse.limits import reported_joints, take_turns

TURN = 2.0 * np.pi


def best_turn(angle, limits, preferred=None):
    """The rule as the documentation states it, for one angle."""
    turns = [angle + TURN * n for n in range(-6, 7)]
    allowed = [each for each in turns if limits[0] <= each <= limits[1]]
    if preferred is not None:
        liked = [each for each in allowed if preferred[0] <= each <= preferred[1]]
        allowed = liked or allowed
    else:
        liked = allowed
    if not allowed:
        return next(each for each in turns if -np.pi < each <= np.pi)
    return min(allowed, key=abs)


@pytest.mark.parametrize(
    ("limits_deg", "preferred_deg"),
    [
        ((-720.0, 720.0), None),
        ((-180.0, 180.0), None),
        ((200.0, 700.0), None),
        ((-719.0, -365.0), None),
        ((-10.0, 10.0), None),
        ((-360.0, 360.0), (90.0, 330.0)),
        ((-720.0, 720.0), (380.0, 700.0)),
        ((-720.0, 720.0), (-700.0, -600.0)),
        ((-360.0, 360.0), (-350.0, -200.0)),
    ],
)
def test_a_joint_takes_the_turn_that_the_rule_names(limits_deg, preferred_deg):
    rng = np.random.default_rng(3)
    q = rng.uniform(-3.0 * TURN, 3.0 * TURN, (700, 2))
    limits = tuple(np.full(2, np.deg2rad(each)) for each in limits_deg)
    preferred = preferred_deg and tuple(np.full(2, np.deg2rad(each)) for each in preferred_deg)
    taken = take_turns(q, limits, preferred)
    box = None if preferred is None else (preferred[0][0], preferred[1][0])
    wanted = [best_turn(each, (limits[0][0], limits[1][0]), box) for each in q.ravel()]
    np.testing.assert_allclose(taken.ravel(), wanted, atol=1e-9)


def test_half_a_turn_is_half_a_turn_forwards_and_a_slide_stays_where_it_is():
    limits = (np.full(2, -TURN), np.full(2, TURN))
    q = np.array([[-np.pi, 900.0], [np.pi, -900.0], [3.0 * np.pi, 7.0]])
    taken = take_turns(q, limits, prismatic=np.array([False, True]))
    np.testing.assert_allclose(taken[:, 0], np.pi)
    np.testing.assert_array_equal(taken[:, 1], q[:, 1])


@pytest.mark.parametrize("name", ["fanuc_lrmate200id", "fanuc_m710ic_50", "irb2400_12_155"])
def test_every_posture_within_the_limits_of_coupled_joints_is_found_there(name):
    arm = robot.load(name)
    own = np.random.default_rng(0).uniform(arm.q_min_rad, arm.q_max_rad, (60, 6))
    found = inverse.solve(arm, arm.dh, dh.forward(arm.dh, arm.dh_joints(own)))
    reported = reported_joints(arm, found.q_rad)
    gap = reported - own[:, None]
    same = np.abs(gap - TURN * np.rint(gap / TURN)).max(axis=-1) < 1e-6
    assert (same & (found.status == inverse.Status.FOUND)).any(axis=1).all()

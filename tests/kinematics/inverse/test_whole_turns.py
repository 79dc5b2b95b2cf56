"""Which of many whole turns a joint takes: every turn tried by brute force."""

from __future__ import annotations

from dataclasses import replace

import arms
import numpy as np
import pytest
from oracles.inverse import best_turn

from kinacc.kinematics import dh, inverse, robot
from kinacc.kinematics.inverse.limits import reported_joints, take_turns, within

TURN, ARM = 2.0 * np.pi, robot.load("mh180")
COUPLED = [
    *map(robot.load, ("fanuc_lrmate200id", "fanuc_m710ic_50", "irb2400_12_155")),
    replace(  # searched; joint 3 is reported against the horizontal
        arms.OFFSET_WRIST,
        joint_map=np.eye(6) - np.diag([0, 1, 0, 0, 0], -1),
        q_min_rad=np.full(6, -1.0),
    ),
]


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
        ((-180.0, 180.0), (200.0, 500.0)),
    ],
)
def test_a_joint_takes_the_turn_that_the_rule_names(limits_deg, preferred_deg):
    q = np.random.default_rng(3).uniform(-3.0 * TURN, 3.0 * TURN, (200, 6))
    limits, preferred = np.deg2rad(limits_deg), np.deg2rad(preferred_deg or (-1e6, 1e6))
    arm = replace(ARM, q_min_rad=np.full(6, limits[0]), q_max_rad=np.full(6, limits[1]))
    taken = take_turns(arm, q, preferred_deg and tuple(np.full((2, 6), preferred[:, None])))
    wanted = [best_turn(angle, limits, preferred) for angle in q.ravel()]
    np.testing.assert_allclose(taken.ravel(), wanted, atol=1e-9)


def test_half_a_turn_is_half_a_turn_forwards_and_a_slide_stays_where_it_is():
    slides = np.arange(6) == 1
    free = np.full(6, TURN)
    arm = replace(ARM, dh=replace(ARM.dh, prismatic=slides), q_min_rad=-free, q_max_rad=free)
    q = np.multiply.outer([-np.pi, np.pi, 3.0 * np.pi], np.ones(6))
    taken = take_turns(arm, q)
    np.testing.assert_allclose(taken[:, ~slides], np.pi)
    np.testing.assert_array_equal(taken[:, slides], q[:, slides])


@pytest.mark.parametrize("arm", COUPLED, ids=lambda arm: arm.name)
def test_every_posture_within_the_limits_of_coupled_joints_is_found_there(arm):
    own = np.random.default_rng(0).uniform(arm.q_min_rad, arm.q_max_rad, (60, 6))
    found = inverse.solve(arm, arm.dh, dh.forward(arm.dh, arm.dh_joints(own)))
    reported, inside = reported_joints(arm, found.q_rad), found.status == inverse.Status.FOUND
    assert within(reported[inside], arm.q_min_rad, arm.q_max_rad).all()
    gap = reported - own[:, None]
    same = np.abs(gap - TURN * np.rint(gap / TURN)).max(axis=-1) < 1e-6
    assert (same & inside).any(axis=1).all()

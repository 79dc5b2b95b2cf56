"""Arms that are nearly a wrist-partitioned one: what keeps each from the closed form, in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinacc.kinematics import robot
from kinacc.kinematics.inverse.closed_form import missing_properties, recognise

ARM = robot.load("mh180").dh


def changed(name, joint, by):
    column = np.array(getattr(ARM, name), dtype=float)
    column[joint - 1] += by
    return replace(ARM, **{name: column})


def degrees(joint, by):
    return f"{np.rad2deg(ARM.alpha_rad[joint - 1]) + by:.6g}"


@pytest.mark.parametrize(
    ("name", "joint", "by", "said"),
    [
        ("alpha_rad", 1, np.deg2rad(2.0), f"alpha of joint 1 is {degrees(1, 2)} deg, not +-90"),
        ("alpha_rad", 4, np.deg2rad(2.0), f"alpha of joint 4 is {degrees(4, 2)} deg, not +-90"),
        ("alpha_rad", 5, np.deg2rad(-2.0), f"alpha of joint 5 is {degrees(5, -2)} deg, not +-90"),
        ("alpha_rad", 2, 1e-6, "axes 2 and 3 are not parallel"),
        ("a_mm", 4, 1.5, "the wrist is not spherical: a of joint 4 is 1.5 mm, not 0"),
        ("d_mm", 5, -1.5, "the wrist is not spherical: d of joint 5 is -1.5 mm, not 0"),
        ("a_mm", 5, 1.5, "the wrist is not spherical: a of joint 5 is 1.5 mm, not 0"),
        ("beta_rad", 2, 1e-6, "a joint before the last has a Hayati beta"),
        ("beta_rad", 5, -1e-6, "a joint before the last has a Hayati beta"),
        ("a_mm", 2, -ARM.a_mm[1], "the upper arm has no length"),
    ],
)
def test_what_is_missing_is_named_with_its_joint(name, joint, by, said):
    arm = changed(name, joint, by)
    assert missing_properties(arm) == [said]
    assert recognise(arm) is None


def test_nothing_is_missing_where_only_lengths_offsets_and_the_last_joint_differ():
    for name, joint in (("theta_offset_rad", 3), ("d_mm", 1), ("d_mm", 6), ("a_mm", 1),
                        ("a_mm", 6), ("alpha_rad", 6), ("beta_rad", 6)):  # fmt: skip
        assert missing_properties(changed(name, joint, 0.1)) == []
    assert missing_properties(ARM) == []
    assert recognise(ARM) is not None


def test_several_faults_are_told_together_and_sliding_joints_by_number():
    arm = changed("a_mm", 4, 2.0)
    arm = replace(arm, prismatic=np.array([False, True, False, False, False, True]))
    assert missing_properties(arm) == [
        "joint 2 slides",
        "joint 6 slides",
        "the wrist is not spherical: a of joint 4 is 2 mm, not 0",
    ]


def test_a_forearm_of_no_length_is_missing_one():
    arm = changed("a_mm", 3, -ARM.a_mm[2])
    d_mm = np.array(arm.d_mm)
    d_mm[3] = 0.0
    assert missing_properties(replace(arm, d_mm=d_mm)) == ["the forearm has no length"]
    assert missing_properties(arm) == []


@pytest.mark.parametrize("name", ["ur10", "iiwa14"])
def test_arms_of_another_shape_are_told_why(name):
    assert missing_properties(robot.load(name).dh)


def test_another_number_of_joints_is_said_alone():
    assert missing_properties(robot.load("iiwa14").dh) == [
        "it has 7 joints, the closed form needs 6"
    ]

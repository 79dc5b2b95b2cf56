"""What poses leave open, said of directions whose meaning is plain from the names alone."""

from __future__ import annotations

import numpy as np
import pytest

from kinacc.calibration.blind_words import parameter_name, sentence, short_name
from kinacc.calibration.frames import known
from kinacc.geometry import Pose, exp_so3

MOTIONS = ("x_mm", "y_mm", "z_mm", "rx_rad", "ry_rad", "rz_rad")
BASE = [f"base.{each}" for each in MOTIONS]
TOOL = [f"tool.{each}" for each in MOTIONS]
ARM = ["j1.theta_offset_rad", "j1.d_mm", "j2.theta_offset_rad", "j2.d_mm", "j3.d_mm", "j4.d_mm"]
NAMES = [*ARM, *BASE, *TOOL]


def said(frames=None, names=NAMES, **parts):
    """The sentence on one direction, given by the parts that are not zero."""
    direction = np.zeros(len(names))
    for name, value in parts.items():
        direction[names.index(name.replace("__", "."))] = value
    return sentence(direction[None], names, frames or known())


@pytest.mark.parametrize(
    ("parts", "moved"),
    [
        ({"base__z_mm": 1.0}, "a shift of the base along the axis of joint 1"),
        ({"base__rz_rad": 1.0}, "a turn of the base about the axis of joint 1"),
        ({"base__z_mm": 0.4, "base__rz_rad": 1.0}, "a screw of the base along the axis of joint 1"),
        ({"base__x_mm": 1.0}, "a shift of the base along x of the robot's base"),
        ({"base__x_mm": 1.0, "base__y_mm": 0.5}, "a shift of the base along x, y of ROBOT"),
        ({"base__ry_rad": 1.0}, "a turn of the base about y of the robot's base"),
        ({"base__rx_rad": 1.0, "base__rz_rad": 0.3}, "a turn of the base about x, z of ROBOT"),
        (
            {"base__y_mm": 1.0, "base__rx_rad": 0.5},
            "a motion of the base (shift along y, turn about x of the robot's base)",
        ),
        ({"tool__z_mm": 1.0}, "a shift of the tool along z of the last frame"),
        ({"tool__rz_rad": 1.0}, "a turn of the tool about z of the last frame"),
        ({"tool__y_mm": 1.0}, "a shift of the tool along y of the last frame"),
    ],
)  # fmt: skip
def test_a_motion_of_base_or_tool_is_called_what_it_is(parts, moved):
    moved = moved.replace("ROBOT", "the robot's base")
    assert said(**parts) == f"{moved} changes no measured pose"
    assert said(j1__d_mm=1.0, **parts) == f"d of joint 1 cannot be told from {moved}"


def test_what_is_hardly_in_a_direction_is_not_worth_a_word():
    assert said(base__z_mm=1.0, base__x_mm=0.019) == said(base__z_mm=1.0)
    assert "along x, z" in said(base__z_mm=1.0, base__x_mm=0.021)
    assert said(j1__d_mm=0.019, base__z_mm=1.0) == said(base__z_mm=1.0)


def test_a_motion_of_the_base_is_told_in_the_robots_axes():
    """The instrument's x is the robot's z where the base stands turned by a right angle about y."""
    turned = Pose(exp_so3(np.array([0.0, np.pi / 2, 0.0])), np.zeros(3))
    assert said(known(turned), base__x_mm=1.0) == said(base__z_mm=1.0)
    assert said(known(turned), base__rx_rad=1.0) == said(base__rz_rad=1.0)


def test_base_against_tool_without_the_arm():
    text = said(base__z_mm=1.0, tool__z_mm=-1.0)
    assert text == (
        "a shift of the base along the axis of joint 1 cannot be told from a shift of the tool "
        "along z of the last frame"
    )


def test_several_bases_that_move_alike_are_every_base_and_others_are_each_named():
    names = [f"base{number}.{each}" for number in ("", "2") for each in MOTIONS]
    frames = known(sessions=2)
    both = {"base__z_mm": 1.0, "base2__z_mm": 1.0}
    assert said(frames, names, **both) == (
        "a shift of every base along the axis of joint 1 changes no measured pose"
    )
    against = {"base__z_mm": 1.0, "base2__x_mm": 1.0}
    assert said(frames, names, **against) == (
        "a shift of the base along the axis of joint 1 cannot be told from a shift of the base2 "
        "along x of the robot's base"
    )


def test_targets_that_turn_as_one_body_are_one_motion():
    """A turn of the last frame about z moves a point at (x, y, 0) by (-y, x, 0) per radian."""
    names = [f"{each}.{motion}" for each in ("mA", "mB") for motion in MOTIONS[:3]]
    frames = known(targets=2)
    frames.targets.position_mm[:] = [[100.0, 0.0, 0.0], [0.0, 50.0, 0.0]]
    turn = {"mA__y_mm": 1.0, "mB__x_mm": -0.5}
    assert said(frames, names, **turn) == (
        "a turn of the targets about z of the last frame changes no measured pose"
    )
    apart = said(frames, names, mA__y_mm=1.0, mB__x_mm=0.5)
    assert apart == (
        "a shift of the mA along y of the last frame cannot be told from a shift of the mB along x "
        "of the last frame"
    )


@pytest.mark.parametrize(
    ("parts", "how"),
    [
        ({"j1__d_mm": 1.0}, "changes no measured pose"),
        # What leaves poses alone is moving both apart: only what they add up to is seen.
        ({"j1__d_mm": 1.0, "j2__d_mm": -1.0}, "and d of joint 2 appear only as their sum"),
        ({"j1__d_mm": 1.0, "j2__d_mm": 1.0}, "and d of joint 2 appear only as their difference"),
    ],
)  # fmt: skip
def test_parameters_of_the_arm_alone(parts, how):
    assert said(**parts) == f"d of joint 1 {how}"


def test_a_direction_of_three_is_told_by_its_amounts():
    text = said(j1__d_mm=1.0, j2__d_mm=-0.5, j1__theta_offset_rad=0.25)
    assert text == (
        "theta of joint 1, d of joint 1 and d of joint 2 appear only in combination: "
        "theta of joint 1 +0.25 mrad, d of joint 1 +1 mm, d of joint 2 -0.5 mm "
        "changes no measured pose"
    )


def directions(*rows):
    found = np.zeros((len(rows), len(NAMES)))
    for row, parts in zip(found, rows, strict=True):
        for name, value in parts.items():
            row[NAMES.index(name)] = value
    return found


def test_three_parameters_of_which_one_number_is_seen():
    first, second, third = "j1.d_mm", "j2.d_mm", "j3.d_mm"
    opened = directions({first: 1.0, second: -1.0}, {second: 1.0, third: -1.0})
    called = "d of joint 1, d of joint 2 and d of joint 3 appear only as"
    assert sentence(opened, NAMES, known()) == f"{called} their sum"
    opened = directions({first: 1.0, second: 1.0}, {second: 1.0, third: 1.0})
    assert sentence(opened, NAMES, known()) == (
        f"{called} d of joint 1 - d of joint 2 + d of joint 3"
    )
    # d1 + 2 d2 + 3 d3 is seen: these two leave it as it is.
    opened = directions({first: 1.0, second: -0.5}, {first: 1.0, third: -1.0 / 3.0})
    assert sentence(opened, NAMES, known()) == (
        f"{called} +1 (d of joint 1) +2 (d of joint 2) +3 (d of joint 3) (mm and mrad)"
    )


def test_many_parameters_are_counted_and_the_largest_four_named():
    parts = dict(zip(ARM, (0.1, 0.9, 0.2, 1.0, 0.8, 0.7), strict=True))
    text = sentence(directions(parts), NAMES, known())
    assert text == (
        "a mixture of 6 parameters, most of all d of joint 2, d of joint 1, d of joint 3 and d of "
        "joint 4, changes no measured pose"
    )
    with_base = sentence(directions(parts | {"base.z_mm": 1.0}), NAMES, known())
    assert with_base.endswith(
        "and d of joint 4, cannot be told from a shift of the base along the axis of joint 1"
    )


def test_up_to_four_parameters_are_named_together_with_the_motion():
    parts = {"j1.d_mm": 1.0, "j2.d_mm": 1.0, "base.z_mm": -1.0}
    assert sentence(directions(parts), NAMES, known()) == (
        "d of joint 1 and d of joint 2 together cannot be told from a shift of the base along the "
        "axis of joint 1"
    )


def test_parameters_have_a_long_and_a_short_name():
    assert parameter_name("j3.alpha_rad") == "alpha of joint 3"
    assert short_name("j3.alpha_rad") == "j3 alpha"
    assert parameter_name("base.rx_rad") == "base rx"
    assert short_name("tool.z_mm") == "tool z"

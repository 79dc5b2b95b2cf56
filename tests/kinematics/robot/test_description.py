"""Robot files: forms that say the same, and every fault named at once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.kinematics import trans, turn
from pose_checks import assert_same, of_matrices

from kinacc.errors import InputError
from kinacc.geometry import Pose, compose, exp_so3, rotation_x, rotation_z
from kinacc.kinematics import robot
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.robot.description import from_modified
from kinacc.kinematics.robot.record import outside_limits

GOOD = """\
name: small
source: made up
date: 2024-05-01
dh:
  - {theta_offset_deg: 0, d_mm: 290, a_mm: 0, alpha_deg: -90, limits_deg: [-165, 165]}
  - {theta_offset_deg: -90, d_mm: 0, a_mm: 270, alpha_deg: 0, limits_deg: [-110, 110], sign: -1}
  - {joint: prismatic, theta_offset_deg: 0, d_mm: 5, a_mm: 70, alpha_deg: -90, limits_mm: [0, 400]}
  - {theta_offset_deg: 0, d_mm: 302, a_mm: 0, alpha_deg: 90, limits_rad: [-2.8, 2.8], name: roll}
"""


@pytest.fixture
def arm(tmp_path: Path):
    """Loads a robot from the text of a YAML file."""

    def load(text: str) -> robot.Robot:
        path = tmp_path / "arm.yaml"
        path.write_text(text)
        return robot.load(path)

    return load


def test_units_kinds_signs_and_limits_are_read(arm):
    small = arm(GOOD)
    assert (small.name, small.source, small.date) == ("small", "made up", "2024-05-01")
    assert small.dh.prismatic.tolist() == [False, False, True, False]
    assert np.allclose(small.q_min_rad, [np.deg2rad(-165), np.deg2rad(-110), 0, -2.8])
    assert np.allclose(small.q_max_rad, [np.deg2rad(165), np.deg2rad(110), 400, 2.8])
    assert np.array_equal(small.joint_map, np.diag([1, -1, 1, 1]))
    assert small.joint_names == ("joint 1", "joint 2", "joint 3", "roll")
    in_other_units = arm(
        GOOD.replace("d_mm: 290", "d_m: 0.29")
        .replace("alpha_deg: -90, limits_deg: [-165, 165]", f"alpha_rad: {-np.pi / 2}, LIMITS")
        .replace("LIMITS", f"limits_rad: [{-np.deg2rad(165)}, {np.deg2rad(165)}]")
        .replace("limits_mm: [0, 400]", "limits_m: [0, 0.4]")
    )
    assert np.allclose(in_other_units.dh.d_mm, small.dh.d_mm)
    assert np.allclose(in_other_units.dh.alpha_rad, small.dh.alpha_rad)
    assert np.allclose(in_other_units.q_max_rad, small.q_max_rad)


def test_base_flange_and_tool_frames_are_read(arm):
    framed = arm(
        GOOD
        + "base: {position_m: [0, 0, 0.5], rpy_deg: [0, 0, 90]}\n"
        + "flange: {quaternion_wxyz: [0.7071067811865476, 0, 0, 0.7071067811865476]}\n"
        + "tool: {position_mm: [0, 0, 100], rotation_vector_deg: [0, 0, 45]}\n"
    )
    q = np.array([[0.1, 0.2, 30.0, 0.4]])
    base = Pose(rotation_z(np.pi / 2), np.array([0, 0, 500.0]))
    wanted = compose(base, compose(robot.forward(arm(GOOD), q), Pose(base.rotation, np.zeros(3))))
    assert_same(robot.forward(framed, q), wanted, 1e-9, 1e-12)
    assert np.allclose(robot.carried(framed).rotation, rotation_z(np.pi * 0.75))


def test_angles_of_a_frame_turn_about_the_fixed_axes_x_y_z(arm):
    angles = np.deg2rad(np.diag([10.0, 20.0, 30.0]))
    about_x, about_y, about_z = exp_so3(angles)
    carried = robot.carried(arm(GOOD + "tool: {rpy_deg: [10, 20, 30]}\n"))
    assert np.allclose(carried.rotation, about_z @ about_y @ about_x)


# --- modified tables ------------------------------------------------------------------------------


def craig(table: DHModel, q: np.ndarray) -> np.ndarray:
    """Product of a modified table, by Craig's Rx(alpha) Tx(a) Rz(theta) Tz(d) for one joint."""
    total = np.eye(4)
    for i, slides in enumerate(table.prismatic):
        theta, d = table.theta_offset_rad[i] + q[i] * (not slides), table.d_mm[i] + q[i] * slides
        total = total @ turn(0, table.alpha_rad[i]) @ trans(table.a_mm[i], 0.0, 0.0)
        total = total @ turn(2, theta) @ trans(0.0, 0.0, d)
    return total


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(4, 7))
def test_a_modified_table_is_the_same_arm(seed, count):
    rng = np.random.default_rng(seed)
    table = DHModel(
        rng.uniform(-3, 3, count),
        rng.uniform(-500, 500, count),
        rng.uniform(-500, 500, count),
        rng.uniform(-3, 3, count),
        np.zeros(count),
        rng.random(count) < 0.3,
    )
    chain, base = from_modified(table)
    arm = robot.Robot("any", chain, -np.ones(count), np.ones(count), np.eye(count), "", base=base)
    q = rng.uniform(-3, 3, (5, count))
    wanted = of_matrices([craig(table, row) for row in q])
    assert_same(robot.forward(arm, q), wanted, 1e-9, 1e-12)


def test_a_modified_file_with_a_hayati_term_is_converted(arm):
    text = GOOD.replace("dh:", "convention: modified\ndh:").replace(
        "a_mm: 270", "a_mm: 270, beta_deg: 2"
    )
    modified = arm(text)
    assert np.allclose(modified.dh.a_mm, [270, 70, 0, 0])
    assert np.allclose(modified.dh.beta_rad, [np.deg2rad(2), 0, 0, 0])
    assert np.allclose(modified.base.rotation, rotation_x(-np.pi / 2))


# --- faults ---------------------------------------------------------------------------------------


def faults(arm, text: str) -> str:
    with pytest.raises(InputError) as refusal:
        arm(text)
    return str(refusal.value)


def test_all_faults_are_listed_in_order_with_line_and_key(arm):
    text = (
        GOOD.replace("d_mm: 290", "d: 290")
        .replace("sign: -1", "sign: 2")
        .replace("a_mm: 0, alpha_deg: 90", "a_mm: zero, alpah_deg: 90")
        .replace("name: small", "nmae: small")
    )
    said = faults(arm, text)
    for words in (
        "arm.yaml:1, nmae: unknown key 'nmae'; did you mean name?",
        "arm.yaml:5, dh[0].d: unknown key 'd'",
        "arm.yaml:6, dh[1].sign: 2",
        "arm.yaml:8, dh[3].a_mm: 'zero'",
        "arm.yaml:8, dh[3].alpah_deg: unknown key 'alpah_deg'; did you mean alpha_deg?",
    ):
        assert words in said, (words, said)
    lines = [int(line.split("arm.yaml:")[1].split(",")[0]) for line in said.splitlines()[1:]]
    assert lines == sorted(lines)


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("alpha_deg: -90,", "alpha_rad: -90,", ":5, dh[0].alpha_rad"),
        ("limits_deg: [-165, 165]", "limits_rad: [-165, 165]", ":5, dh[0]"),
        ("limits_deg: [-165, 165]", "limits_deg: [165, -165]", ":5, dh[0]"),
        ("d_mm: 290", "d_mm: 290, d_m: 0.29", ":5, dh[0]"),
        ("d_mm: 290, ", "", ":5, dh[0]"),
        ("d_mm: 290", "d_mm: .nan", ":5, dh[0].d_mm"),
        ("d_mm: 290", "d_mm: 1e90", ":5, dh[0].d_mm"),
        ("limits_deg: [-165, 165]", "beta_deg: 0", "joint 1: its limits"),
        ("joint: prismatic", "joint: linear", ":7, dh[2].joint"),
        ("joint: prismatic, ", "", "joint 3: its limits"),
        ("source:", "convention: craig\nsource:", ":2, convention"),
        ("source:", "joint_map: [[1, 0], [0, 1]]\nsource:", "sign"),
        ("source:", "tool: {x_mm: 3}\nsource:", ":2, tool.x_mm"),
        ("source:", "tool: {position_mm: [1, 2]}\nsource:", ":2, tool.position_mm"),
        ("source:", "tool: {quaternion_wxyz: [1, 1, 0, 0]}\nsource:", ":2, tool"),
        ("source:", "tool: {rpy_deg: [0, 0, 1], rpy_rad: [0, 0, 1]}\nsource:", ":2, tool"),
        ("name: small", "name: small\nname: other", "name"),
        ("dh:", "dh: [", "arm.yaml"),
        ("dh:", "rows:", "has no dh"),
    ],
)
def test_each_fault_is_named_with_its_place(arm, old, new, place):
    assert old in GOOD
    assert place in faults(arm, GOOD.replace(old, new, 1))


def test_units_that_only_make_sense_in_another_are_noticed(arm):
    text = GOOD.replace("290", "0.29").replace("270", "0.27").replace(" 70", " 0.07")
    said = faults(arm, text.replace("302", "0.302").replace("d_mm: 5", "d_mm: 0.005"))
    assert "0.937 mm" in said
    text = "\n".join(line for line in GOOD.splitlines() if "prismatic" not in line)
    rad = text.replace("165", "2.88").replace("110", "1.92").replace("limits_rad", "limits_deg")
    more = "\n  - {theta_offset_deg: 0, d_mm: 2, a_mm: 0, alpha_deg: 90, limits_deg: [-3, 3]}\n"
    assert "limits_rad" in faults(arm, rad + more)


def test_too_few_and_too_many_joints_are_refused(arm):
    last = GOOD.splitlines()[-1] + "\n"
    assert "at most 7 items after validation, not 8" in faults(arm, GOOD + 4 * last)
    assert "at least 4 items after validation, not 3" in faults(arm, GOOD.removesuffix(last))


def test_joints_beyond_their_limits_are_given_by_joint_and_row():
    arm, joints = robot.load("irb120"), np.zeros((4, 6))
    joints[1, 2], joints[3, 4] = arm.q_max_rad[2] + 0.02, arm.q_min_rad[4] - 0.02
    joints[2, 0] = 250.0  # degrees
    outside = list(outside_limits(arm, joints, 0.01))
    assert [(joint.joint, *joint.rows) for joint in outside] == [(1, 2), (3, 1), (5, 3)]
    assert [joint.looks_like_degrees for joint in outside] == [True, False, False]
    assert outside[1].values == pytest.approx([np.rad2deg(joints[1, 2])])
    assert not list(outside_limits(arm, joints[1:2], 0.03))

"""URDF files: forward kinematics against pinocchio reading the same file, and every refusal."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pose_checks
import pytest
from by_pinocchio import seen_by_pinocchio
from hypothesis import given, settings
from hypothesis import strategies as st

from kinacc.errors import InputError
from kinacc.kinematics import robot
from kinacc.kinematics.robot import urdf

UR10 = [
    ("revolute", "0 0 0.1273", "0 0 0", "0 0 1"),
    ("revolute", "0 0.220941 0", "0 1.570796325 0", "0 1 0"),
    ("revolute", "0 -0.1719 0.612", "0 0 0", "0 1 0"),
    ("revolute", "0 0 0.5723", "0 1.570796325 0", "0 1 0"),
    ("revolute", "0 0.1149 0", "0 0 0", "0 0 1"),
    ("revolute", "0 0 0.1157", "0 0 0", "0 1 0"),
    ("fixed", "0 0.0922 0", "0 0 1.570796325", None),
]
SCARA = [
    ("revolute", "0 0 0.3", "0 0 0", "0 0 1"),
    ("revolute", "0.4 0 0", "0 0 0", "0 0 1"),
    ("prismatic", "0.25 0 0.1", "0 0 0", "0 0 -1"),
    ("revolute", "0 0 0", "3.141592653589793 0 0", "0 0 1"),
]


def text_of(joints, extra: str = "") -> str:
    """A URDF of a chain of (kind, xyz, rpy, axis)."""
    links = "".join(f'<link name="l{i}"/>' for i in range(len(joints) + 1))
    parts = []
    for i, (kind, xyz, rpy, axis) in enumerate(joints):
        axis_tag = f'<axis xyz="{axis}"/>' if axis else ""
        limit = '<limit lower="-2.5" upper="2.0" effort="1" velocity="1"/>'
        parts.append(
            f'<joint name="j{i}" type="{kind}"><origin xyz="{xyz}" rpy="{rpy}"/>'
            f'<parent link="l{i}"/><child link="l{i + 1}"/>{axis_tag}{limit}</joint>'
        )
    return f'<?xml version="1.0"?>\n<robot name="arm">{links}{"".join(parts)}{extra}</robot>'


def assert_same(path, arm: robot.Robot, tip: str, seed: int, count: int = 20, base: str = "l0"):
    """The arm stands at random joints as pinocchio has it."""
    model, slides = pin.buildModelFromUrdf(str(path)), arm.dh.prismatic
    q = np.random.default_rng(seed).uniform(-3, 3, (count, arm.dh.joints))
    q *= np.where(slides, 1e3, 1.0)
    theirs = seen_by_pinocchio(model, tip, q, slides, arm.joint_names, base)
    pose_checks.assert_same(robot.forward(arm, q), theirs, 1e-9, 1e-12)


EXACT = ["0", "1.5707963267948966", "-1.5707963267948966", "3.141592653589793"]
ANGLE = st.one_of(
    st.sampled_from(EXACT),
    st.sampled_from(["1.5708", "-1.571", "1.57", "3.14159", "0.0001", "1e-9", "0.019", "0.021"]),
    st.floats(-3.2, 3.2).map(repr),
)
LENGTH = st.one_of(st.sampled_from(["0", "0.25", "-0.1"]), st.floats(-0.8, 0.8).map(repr))
AXIS = st.one_of(
    st.sampled_from(["1 0 0", "0 1 0", "0 0 1", "0 0 -1", "-1 0 0", "0 0.6 0.8"]),
    st.tuples(*[st.floats(0.1, 1)] * 3).map(
        lambda v: " ".join(map(repr, (np.array(v) / np.linalg.norm(v)).tolist()))
    ),
)
XYZ, RPY = (st.tuples(each, each, each).map(" ".join) for each in (LENGTH, ANGLE))
JOINT = st.tuples(
    st.sampled_from(["revolute", "revolute", "continuous", "prismatic"]),
    XYZ,
    RPY,
    AXIS,
)
FIXED = st.tuples(
    st.just("fixed"),
    XYZ,
    RPY,
    st.none(),
)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(JOINT, min_size=4, max_size=7), st.lists(FIXED, max_size=2), st.integers(0, 9), FIXED
)
def test_any_chain_agrees_with_pinocchio(tmp_path_factory, joints, fixed, where, last):
    for number, each in enumerate(fixed):
        joints.insert((where + number) % len(joints), each)
    joints.append(last)
    path = tmp_path_factory.mktemp("urdf") / "arm.urdf"
    path.write_text(text_of(joints))
    assert_same(path, robot.load(path), f"l{len(joints)}", where, 5)


def test_limits_names_and_kinds_come_from_the_file(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(text_of(SCARA))
    arm = robot.load(path)
    assert arm.joint_names == ("j0", "j1", "j2", "j3")
    assert arm.dh.prismatic.tolist() == [False, False, True, False]
    assert np.allclose(arm.q_min_rad, [-2.5, -2.5, -2500, -2.5])
    path.write_text(text_of([*UR10[:5], ("continuous", *UR10[5][1:]), UR10[6]]))
    assert np.allclose(robot.load(path).q_max_rad, [2.0] * 5 + [2 * np.pi])
    assert "l0 to link l7" in robot.load(path).source


# --- which chain ----------------------------------------------------------------------------------

FINGERS = "".join(
    f'<link name="f{i}"/><joint name="finger{i}" type="prismatic"><parent link="l6"/>'
    f'<child link="f{i}"/><axis xyz="1 0 0"/>'
    f'<limit lower="0" upper="0.04" effort="1" velocity="1"/>{mimic}</joint>'
    for i, mimic in enumerate(["", '<mimic joint="finger0"/>'])
)


def refusal(function, *arguments) -> str:
    with pytest.raises(InputError) as refused:
        function(*arguments)
    return str(refused.value)


def test_an_open_end_is_asked_for_with_the_links_there_are(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(text_of(UR10, FINGERS))
    said = refusal(robot.load, path)
    for words in ("can end at 3 links", "l7 (6 moving joints)", "f0 (7 moving joints)", "tip_link"):
        assert words in said
    arm = urdf.load(path, tip_link="l7")
    assert arm.dh.joints == 6
    assert np.abs(arm.dh.d_mm).max() < 2000
    assert_same(path, arm, "l7", 2)
    part = urdf.load(path, "l1", "l6")
    assert part.dh.joints == 5
    assert_same(path, part, "l6", 2, base="l1")
    assert "can end at 3 links" in refusal(urdf.load, path, None, "tool")
    assert "from f0 can end at 0 links" in refusal(urdf.load, path, "f0", "l7")
    assert "l7 (2 moving joints)" in refusal(urdf.load, path, "l4", "l7")


def test_a_joint_that_follows_another_is_refused_in_the_chain_only(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(text_of(UR10, "<?xml-stylesheet href='x'?>" + FINGERS))
    said = refusal(urdf.load, path, None, "f1")
    assert "joint finger1: follows joint finger0 (mimic)" in said


def test_a_yaml_chooses_the_chain_and_adds_what_a_urdf_lacks(tmp_path):
    (tmp_path / "arm.urdf").write_text(text_of(UR10, FINGERS))
    path = tmp_path / "arm.yaml"
    path.write_text(
        "name: cell\nsource: the drawing\ndate: 2024-02-03\nurdf: arm.urdf\ntip_link: l6\n"
        "tool: {position_mm: [0, 0, 10]}\n"
        "joint_map: [[1,0,0,0,0,0],[0,1,0,0,0,0],[0,1,1,0,0,0],[0,0,0,1,0,0],[0,0,0,0,1,0],"
        "[0,0,0,0,0,-1]]\n"
    )
    arm = robot.load(path)
    assert (arm.name, arm.source, arm.date) == ("cell", "the drawing", "2024-02-03")
    assert arm.joint_map[2, 1] == 1
    assert np.allclose(arm.tool.position_mm, [0, 0, 10])
    assert robot.files(path) == [path, tmp_path / "arm.urdf"]
    path.write_text("urdf: arm.urdf\ntip_lnk: l6\ndh: []\n")
    said = refusal(robot.load, path)
    assert "did you mean tip_link?" in said
    assert "dh: unknown key 'dh'" in said
    path.write_text("urdf: other.urdf\n")
    assert "other.urdf: no such file" in refusal(robot.load, path)


# --- faults ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('name="j1" type="revolute"', 'name="j1" type="floating"', "its type is 'floating'"),
        ('xyz="0 0 0.1273"', 'xyz="0 0 127,3"', "origin xyz='0 0 127,3'; allowed: 3 finite"),
        ('xyz="0 0 0.1273"', 'xyz="0 0.1273"', "origin xyz='0 0.1273'"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', "axis has no direction"),
        ('upper="2.0"', 'upper="nan"', "limit upper='nan'"),
        ('lower="-2.5"', 'lower="3.0"', "limits 3 to 2"),
        ('<limit lower="-2.5" upper="2.0" effort="1" velocity="1"/>', "", "limits 0 to 0"),
        ('name="j2"', 'name="j1"', "joint j1 is given more than once"),
        ('<child link="l3"/>', '<child link="l2"/>', "child link l2 is given more than once"),
        ("</robot>", "", "is not XML"),
        ("?>\n", '?><!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]>\n', "entities"),
        ("0 0 0.1273", "0 0 1e308", "origin xyz='0 0 1e308'"),
        ('<link name="l1"/>', '<link name="l1"/>' + "<link>" * 1000, "depth"),
        ("</robot>", 20_000 * '<joint type="fixed"/>' + "</robot>", "has 20007 joints"),
        ("</robot>", 11_000_000 * " " + "</robot>", "at most 10 MB"),
        ('<robot name="arm">', "<robot>", "is no <robot"),
        ('<parent link="l3"/>', '<parent link="x3"/>', "'x3'"),
        (
            '<robot name="arm">',
            '<robot name="arm" xmlns:xacro="http://ros.org/wiki/xacro"><xacro:arm/>',
            "expand it with xacro first",
        ),
    ],
)
def test_each_fault_is_named(old, new, words, tmp_path):
    text = text_of(UR10)
    assert old in text
    path = tmp_path / "arm.urdf"
    path.write_text(text.replace(old, new, 1))
    message = refusal(robot.load, path)
    assert words in message
    assert len(message) < 1000

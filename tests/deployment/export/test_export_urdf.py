"""URDF of a calibrated arm: forward kinematics against pinocchio reading the same file."""

from dataclasses import replace
from functools import partial

import numpy as np
import pinocchio as pin
import pose_checks
import pytest
from by_pinocchio import seen_by_pinocchio
from calibration.simulated import disturbed

from kinacc.calibration.frames import closed_form_start
from kinacc.calibration.observations import full_poses
from kinacc.deployment.export import urdf
from kinacc.deployment.export.source import Source
from kinacc.deployment.record import TOOL, nominal
from kinacc.errors import InputError
from kinacc.geometry import Pose, compose, exp_so3
from kinacc.kinematics import dh, robot
from kinacc.kinematics.model import JointState

TOOL_POSE = Pose(exp_so3(np.array([0.3, -0.2, 0.9])), np.array([12.0, -40.0, 180.0]))

# A file whose links sit elsewhere on their axes than DH frames do, with fixed joints between.
UR10_FILE = """<?xml version="1.0"?>
<robot name="ur10">
  <!-- kept as it is -->
  <link name="world"/><link name="base"/><link name="shoulder"/><link name="upper"/>
  <link name="bracket"/><link name="fore"/><link name="w1"/><link name="w2"/><link name="w3"/>
  <link name="camera"/>
  <joint name="stand" type="fixed"><origin xyz="0.1 0.2 0.3" rpy="0 0 3.141592653589793"/>
    <parent link="world"/><child link="base"/></joint>
  <joint name="pan" type="revolute"><origin xyz="0 0 0.1273" rpy="0 0 0"/>
    <parent link="base"/><child link="shoulder"/><axis xyz="0 0 1"/>
    <limit lower="-6" upper="6" effort="330" velocity="2.16"/></joint>
  <joint name="lift" type="revolute"><origin xyz="0 0.220941 0" rpy="0 1.5707963267948966 0"/>
    <parent link="shoulder"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-6" upper="6" effort="330" velocity="2.16"/></joint>
  <joint name="mount" type="fixed"><origin xyz="0.05 0 0.2" rpy="0.4 0 0"/>
    <parent link="upper"/><child link="bracket"/></joint>
  <joint name="elbow" type="revolute">
    <origin xyz="-0.05 0.002109972162068041 0.44641814257204565" rpy="-0.4 0 0"/>
    <parent link="bracket"/><child link="fore"/><axis xyz="0 1 0"/>
    <limit lower="-6" upper="6" effort="150" velocity="3.15"/></joint>
  <joint name="wrist1" type="revolute"><origin xyz="0 0 0.5723" rpy="0 1.5707963267948966 0"/>
    <parent link="fore"/><child link="w1"/><axis xyz="0 1 0"/>
    <limit lower="-6" upper="6" effort="56" velocity="3.2"/></joint>
  <joint name="wrist2" type="revolute"><origin xyz="0 0.1149 0"/>
    <parent link="w1"/><child link="w2"/><axis xyz="0 0 1"/>
    <limit lower="-6" upper="6" effort="56" velocity="3.2"/></joint>
  <joint name="wrist3" type="revolute"><origin xyz="0 0 0.1157"/>
    <parent link="w2"/><child link="w3"/><axis xyz="0 1 0"/>
    <limit lower="-6" upper="6" effort="56" velocity="3.2"/></joint>
  TAIL
  <joint name="eye" type="fixed"><origin xyz="0.1 0 0"/>
    <parent link="w3"/><child link="camera"/></joint>
</robot>
"""
TAIL = """<link name="ee"/><link name="rod"/><link name="probe"/>
  <joint name="hand" type="fixed"><origin xyz="0 0.0922 0" rpy="0 0 1.5707963267948966"/>
    <parent link="w3"/><child link="ee"/></joint>
  <joint name="stick" type="fixed"><origin xyz="0 0 0.2" rpy="0.1 0.2 0.3"/>
    <parent link="ee"/><child link="rod"/></joint>
  <joint name="ball" type="fixed"><origin xyz="0.03 0 0.01" rpy="-0.4 0.1 0"/>
    <parent link="rod"/><child link="probe"/></joint>"""


def of(arm, path=None, tip=None):
    return Source(arm, {}, urdf_file=path, links=("world", tip))


def bent(arm, seed=0, size=1.0):
    """The arm with every DH parameter off, Hayati angles too, and a tool."""
    sizes = size * np.array([1.0, 1.0, 1.0, 1.0, 0.5])
    return replace(
        nominal(arm, "test"),
        choice="dh",
        model=disturbed(arm.dh, sizes, np.random.default_rng(seed), 2e-3, 0.5),
        targets={TOOL: compose(arm.flange, TOOL_POSE)},
    )


def some_joints(arm):
    share = np.random.default_rng(1).uniform(0.1, 0.9, (15, arm.dh.joints))
    return arm.q_min_rad + share * (arm.q_max_rad - arm.q_min_rad)


assert_close = partial(pose_checks.assert_same, mm=1e-6, matrix=1e-9)


@pytest.mark.parametrize("name", robot.shipped())
def test_a_generated_file_moves_as_the_calibrated_arm(name):
    arm = bent(replace(robot.load(name), base=TOOL_POSE))
    q_rad = some_joints(arm.robot)
    names = [f"joint_{i}" for i in range(1, arm.robot.dh.joints + 1)]
    names = [each.replace(" ", "_") for each in arm.robot.joint_names] or names
    q_dh = q_rad @ arm.robot.joint_map.T
    coupled = not np.array_equal(np.abs(arm.robot.joint_map), np.eye(len(names)))
    assert ("Joints of the URDF are those of the DH table" in urdf.text(of(arm))) == coupled
    model = urdf.to_pinocchio(of(arm))
    for link in ("tool", "flange"):
        shown = q_dh if coupled else q_rad
        theirs = seen_by_pinocchio(model, link, shown, arm.robot.dh.prismatic, names)
        assert_close(arm.pose(JointState(q_dh), "base", link), theirs)


@pytest.mark.parametrize("robot_from", ["file", "shipped"])
@pytest.mark.parametrize("tail", [TAIL, ""])
def test_a_file_of_ones_own_is_corrected_in_place(tmp_path, robot_from, tail):
    text = UR10_FILE.replace("TAIL", tail)
    path, tip = tmp_path / "ur10.urdf", "probe" if tail else "w3"
    path.write_text(text)
    base_robot = robot.urdf.load(path, "world", tip) if robot_from == "file" else robot.load("ur10")
    arm = bent(base_robot)
    done = urdf.text(of(arm, path, tip))
    joints = [joint.name for joint in robot.urdf.joints_between(path, "world", tip)]
    names = [name for name in joints if name not in ("stand", "mount", "hand", "stick", "ball")]
    q_rad = some_joints(base_robot)
    slides = np.zeros(6, dtype=bool)
    before = seen_by_pinocchio(pin.buildModelFromXML(text), tip, q_rad, slides, names, "world")
    # What the calibration says of the tip, wherever the file puts base and tip on the arm.
    ends = dh.forward(base_robot.dh, q_rad)
    start = closed_form_start(full_poses(q_rad, before), ends)
    base, carried = start.base, start.tool
    assert_close(compose(base, compose(ends, carried)), before)
    wanted = compose(base, compose(arm.model.pose(JointState(q_rad)), carried))
    if robot_from == "file":
        assert_close(arm.pose(JointState(q_rad), "base", "flange"), wanted)
    end = tip if tail else f"{tip}_calibrated"
    assert_close(
        wanted, seen_by_pinocchio(pin.buildModelFromXML(done), end, q_rad, slides, names, "world")
    )
    assert "<!-- kept as it is -->" in done
    assert 'effort="330"' in done
    assert np.linalg.norm(wanted.position_mm - before.position_mm, axis=1).min() > 0.1


def test_a_file_of_another_arm_is_refused(tmp_path):
    path = tmp_path / "ur10.urdf"
    text = UR10_FILE.replace("TAIL", "")
    path.write_text(text.replace("0.5723", "0.5713"))
    with pytest.raises(InputError, match=r"differs from ur10 by up to .* mm"):
        urdf.text(of(bent(robot.load("ur10")), path, "w3"))

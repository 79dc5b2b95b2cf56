"""A calibrated arm as URDF: written from its DH chain, or an existing file with origins corrected.

URDF has metres and radians; ``rpy`` turns about the fixed x, y and z axes in that order.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from kinacc.calibration.hand_eye import closed_form_start
from kinacc.calibration.observations import full_poses
from kinacc.deployment.export.source import Source
from kinacc.deployment.record import TOOL, Calibration
from kinacc.errors import InputError, Problem
from kinacc.geometry import (
    IDENTITY,
    Pose,
    compose,
    exp_so3,
    invert,
    rotation_x,
    rotation_y,
    rotation_z,
)
from kinacc.kinematics import dh as _dh
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.robot import Robot
from kinacc.kinematics.robot.urdf import MOVING, Joint, joints_between

_M_PER_MM = 1e-3
_SAME_ARM_MM = 1e-3  # how far a file's nominal arm may be from the robot's
_PROBES = 24


ENDING, ANY_MODEL = ".urdf", False


def text(source: Source) -> str:
    """A URDF of the calibrated DH chain, or the file of one's own, corrected."""
    if source.urdf_file is not None:
        return corrected(source, source.urdf_file, *source.links)
    return generated(source, source.dh_joints)


def generated(source: Source, dh_joints: bool = False) -> str:
    """A URDF of the calibrated DH chain: base_link, link_1 .. link_k, flange and tool.

    Joints are those the controller reports, or with ``dh_joints`` those of the DH table. Raises
    InputError where the robot's reported joints are coupled.
    """
    from lxml import etree

    calibration = source.calibration
    robot, dh = calibration.robot, calibration.model
    names = robot.joint_names or tuple(f"joint_{i}" for i in range(1, dh.joints + 1))
    senses = np.ones(dh.joints) if dh_joints else _signs(robot)
    frames, end = _origins(dh)
    frames[0] = compose(robot.base, frames[0])
    root = etree.Element("robot", name=_name(source.name))
    about = re.sub("-(?=-)", "- ", source.about)  # XML ends a comment at two of them
    root.append(etree.Comment(f" {about}; effort and velocity are placeholders "))
    for line in [*source.orientation_lines, *source.left_open_lines]:
        root.append(etree.Comment(f" {line} "))
    etree.SubElement(root, "link", name="base_link")
    low, high = robot.q_min_rad, robot.q_max_rad
    if dh_joints:
        low, high = robot.dh_box(low, high)
    for i, origin in enumerate(frames):
        etree.SubElement(root, "link", name=f"link_{i + 1}")
        kind = "prismatic" if dh.prismatic[i] else "revolute"
        parent = "base_link" if i == 0 else f"link_{i}"
        joint = _joint(root, _name(names[i]), kind, parent, f"link_{i + 1}", origin)
        etree.SubElement(joint, "axis", xyz=f"0 0 {int(senses[i])}")
        scale = _M_PER_MM if dh.prismatic[i] else 1.0
        etree.SubElement(
            joint,
            "limit",
            lower=_digits(low[i] * scale),
            upper=_digits(high[i] * scale),
            effort="1",
            velocity="1",
        )
    last = f"link_{dh.joints}"
    etree.SubElement(root, "link", name="flange")
    flange = compose(end, robot.flange)
    _joint(root, "flange_fixed", "fixed", last, "flange", flange)
    if TOOL in calibration.targets:
        etree.SubElement(root, "link", name="tool")
        tool = compose(invert(robot.flange), calibration.targets[TOOL])
        _joint(root, "tool_fixed", "fixed", "flange", "tool", tool)
    return _written(root)


def corrected(
    source: Source,
    path: str | Path,
    base_link: str | None = None,
    tip_link: str | None = None,
) -> str:
    """The URDF at ``path`` with origins changed so that its tip goes where the calibration says.

    Axes, meshes, limits, comments and everything that hangs on a link stay: origins of the moving
    joints change, and of the first fixed joint behind the last of them (one is added where there is
    none). The file's nominal arm must be the robot of the calibration, up to where its base and tip
    links sit. Raises InputError where it is not, saying how far apart the two are.
    """
    from lxml import etree

    path, calibration = Path(path), source.calibration
    chain = joints_between(path, base_link, tip_link)
    moving = [joint for joint in chain if joint.kind in MOVING]
    base, tip = _ends_in_file(calibration, chain, path)
    fixed, tail = _fixed_parts(chain)
    at_zero = _link_frames(chain)
    plain, _ = _origins(calibration.robot.dh)
    better, end = _origins(calibration.model)
    frame, anchors = base, []
    for origin, there in zip(plain, at_zero, strict=True):
        frame = compose(frame, origin)
        # How the file's link sits on the axis; it sits there still after the correction.
        anchors.append(compose(invert(frame), there))
    tree = etree.parse(str(path), etree.XMLParser(resolve_entities=False, no_network=True))
    elements = {each.get("name"): each for each in tree.getroot().findall("joint")}
    before = invert(base)
    for joint, gap, origin, anchor in zip(moving, fixed, better, anchors, strict=True):
        new = compose(compose(invert(before), origin), anchor)
        _set_origin(elements[joint.name], compose(invert(gap), new))
        before = anchor
    last = compose(compose(invert(before), end), tip)
    if tail:
        rest = IDENTITY
        for joint in tail[1:]:
            rest = compose(rest, joint.origin)
        _set_origin(elements[tail[0].name], compose(last, invert(rest)))
    else:
        _add_tip(tree.getroot(), moving[-1].child, last)
    for place, line in enumerate(source.left_open_lines):
        tree.getroot().insert(place, etree.Comment(f" {line} "))
    return etree.tostring(tree, encoding="unicode") + "\n"


def _ends_in_file(calibration: Calibration, chain: list[Joint], path: Path) -> tuple[Pose, Pose]:
    """First DH frame in the file's base link, and its tip link in the last DH frame."""
    robot = calibration.robot
    count = sum(joint.kind in MOVING for joint in chain)
    if count != robot.dh.joints:
        what = f"its chain has {count} moving joints, {robot.name} has {robot.dh.joints}"
        raise InputError(Problem(str(path), what))
    _signs(robot)  # coupled joints have no URDF
    rng = np.random.default_rng(0)
    low, high = np.maximum(robot.q_min_rad, -3.0e3), np.minimum(robot.q_max_rad, 3.0e3)
    q_rad = low + rng.uniform(0.0, 1.0, (_PROBES, len(low))) * (high - low)
    wanted = _forward(chain, q_rad)
    ends = _dh.forward(robot.dh, robot.dh_joints(q_rad))
    options = [(robot.base, robot.flange)]
    start = closed_form_start(full_poses(q_rad, wanted), ends)
    options.append((start.base, start.tool))
    misfits = []
    for base, tip in options:
        seen = compose(base, compose(ends, tip))
        misfits.append(float(np.abs(seen.position_mm - wanted.position_mm).max()))
    if min(misfits) > _SAME_ARM_MM:
        what = f"its arm differs from {robot.name} by up to {min(misfits):.3g} mm"
        allowed = f"the arm that was calibrated, within {_SAME_ARM_MM:g} mm, joints alike"
        raise InputError(Problem(str(path), what, allowed))
    return options[0] if misfits[0] <= 1e-8 else options[int(np.argmin(misfits))]


def _forward(chain: list[Joint], q: np.ndarray) -> Pose:
    """Tip frames (n, ...) of a file's chain at joints (n, k), rad and mm."""
    count, number = len(q), 0
    here = Pose(np.broadcast_to(np.eye(3), (count, 3, 3)), np.zeros((count, 3)))
    for joint in chain:
        here = compose(here, joint.origin)
        if joint.kind not in MOVING:
            continue
        axis = joint.axis / np.linalg.norm(joint.axis)
        step = q[:, number, None] * axis
        number += 1
        if joint.kind == "prismatic":
            here = compose(here, Pose(np.broadcast_to(np.eye(3), (count, 3, 3)), step))
        else:
            here = compose(here, Pose(exp_so3(step), np.zeros((count, 3))))
    return here


def _fixed_parts(chain: list[Joint]) -> tuple[list[Pose], list[Joint]]:
    """What fixed joints put in front of every moving joint, and the fixed joints after the last."""
    gaps, gap, tail = [], IDENTITY, []
    for joint in chain:
        if joint.kind in MOVING:
            gaps.append(gap)
            gap, tail = IDENTITY, []
        else:
            gap = compose(gap, joint.origin)
            tail.append(joint)
    return gaps, tail


def _link_frames(chain: list[Joint]) -> list[Pose]:
    """Frames of the links behind the moving joints in the base link, at zero joints."""
    here, found = IDENTITY, []
    for joint in chain:
        here = compose(here, joint.origin)
        if joint.kind in MOVING:
            found.append(here)
    return found


def _joint(root, name: str, kind: str, parent: str, child: str, origin: Pose):
    from lxml import etree

    joint = etree.SubElement(root, "joint", name=name, type=kind)
    _set_origin(joint, origin)
    etree.SubElement(joint, "parent", link=parent)
    etree.SubElement(joint, "child", link=child)
    return joint


def _set_origin(joint, origin: Pose) -> None:
    from lxml import etree

    element = joint.find("origin")
    if element is None:
        element = etree.Element("origin")
        joint.insert(0, element)
    element.set("xyz", " ".join(_digits(value * _M_PER_MM) for value in origin.position_mm))
    element.set("rpy", " ".join(_digits(value) for value in rpy(origin.rotation)))


def _add_tip(root, parent: str, origin: Pose) -> None:
    from lxml import etree

    name = f"{parent}_calibrated"
    etree.SubElement(root, "link", name=name)
    _joint(root, f"{name}_fixed", "fixed", parent, name, origin)


def rpy(rotation: np.ndarray) -> np.ndarray:
    """Roll, pitch, yaw (3,) of a rotation (3, 3): ``Rz(yaw) Ry(pitch) Rx(roll)``, also upright."""
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    pitch = np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0]))
    # What yaw and pitch leave is a turn about x, however ill they are defined.
    rest = (rotation_z(yaw) @ rotation_y(pitch)).T @ rotation
    return np.array([np.arctan2(rest[2, 1], rest[1, 1]), pitch, yaw])


def _digits(value: float) -> str:
    return repr(float(value) + 0.0)


def _name(text: str) -> str:
    return text.replace(" ", "_")


def _written(root) -> str:
    from lxml import etree

    etree.indent(root)
    head = '<?xml version="1.0"?>\n'
    return head + etree.tostring(root, encoding="unicode") + "\n"


def _origins(dh: DHModel) -> tuple[list[Pose], Pose]:
    """The chain cut at its axes: k joints in the links before them, the last DH frame in its link.

    Link i is what follows joint i: it turns about (or slides along) the z axis of its origin, so
    the arm is ``origin_1 Rz(q_1) origin_2 Rz(q_2) .. end``.
    """
    found, before = [], IDENTITY
    for joint in range(dh.joints):
        turn = Pose(rotation_z(dh.theta_offset_rad[joint]), np.zeros(3))
        found.append(compose(before, turn))
        tilt = rotation_x(dh.alpha_rad[joint]) @ rotation_y(dh.beta_rad[joint])
        before = Pose(tilt, np.array([dh.a_mm[joint], 0.0, dh.d_mm[joint]]))
    return found, before


def _signs(robot: Robot) -> np.ndarray:
    """Sense (k,) in which reported joints turn the DH axes.

    Raises InputError where reported joints are coupled or scaled, which no chain of single joints
    can express.
    """
    diagonal = np.diag(robot.joint_map)
    if np.array_equal(robot.joint_map, np.diag(diagonal)) and (np.abs(diagonal) == 1.0).all():
        return diagonal
    problem = Problem(
        f"robot {robot.name}",
        "reports joints that are coupled or scaled, which a URDF cannot say",
        "every reported joint turns one axis, by its own angle",
        "export with the joints of the DH table instead (--dh-joints)",
    )
    raise InputError(problem)

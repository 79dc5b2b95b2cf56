"""A calibrated arm as URDF, and as a model of Pinocchio and pybotics where these are installed.

A URDF is written from the DH chain, or is an existing file with origins corrected.

URDF has metres and radians; ``rpy`` turns about the fixed x, y and z axes in that order.
"""

from __future__ import annotations

import re
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Template
from lxml import etree

from kinacc.calibration.frames import closed_form_start
from kinacc.calibration.observations import full_poses
from kinacc.deployment.export.controllers import origins, standard_chain
from kinacc.deployment.export.source import Source
from kinacc.deployment.record import TOOL
from kinacc.errors import input_error
from kinacc.geometry import IDENTITY, Pose, compose, invert, rotation_x, rotation_y, rotation_z
from kinacc.kinematics import dh as _dh
from kinacc.kinematics.robot import Robot, forward
from kinacc.kinematics.robot.urdf import MOVING, Joint, joints_between, load

_M_PER_MM = 1e-3
_SAME_ARM_MM = 1e-3  # how far a file's nominal arm may be from the robot's
_PROBES = 24


def text(source: Source) -> str:
    """A URDF of the calibrated DH chain, or the file of one's own, corrected."""
    return generated(source) if source.urdf_file is None else corrected(source)


def generated(source: Source) -> str:
    """A URDF of the calibrated DH chain: base_link, link_1 .. link_k, flange and tool.

    Joints are those the controller reports, or those of the DH table where reported joints are
    coupled or scaled, which no chain of single joints can express.
    """
    calibration = source.calibration
    robot, dh = calibration.robot, source.dh
    names = robot.joint_names or tuple(f"joint_{i}" for i in range(1, dh.joints + 1))
    about = f"{source.about}; effort and velocity are placeholders"
    senses, low, high = np.diag(robot.joint_map), robot.q_min_rad, robot.q_max_rad
    if source.coupled_lines:
        senses, (low, high) = np.ones(dh.joints), robot.dh_box(low, high)
    scale = np.where(dh.prismatic, _M_PER_MM, 1.0)
    joints = [
        {"name": _name(name), "kind": kind, "sense": int(sense), "low": lower, "high": upper}
        for name, kind, sense, lower, upper in zip(
            names,
            np.where(dh.prismatic, "prismatic", "revolute"),
            senses,
            map(_digits, low * scale),
            map(_digits, high * scale),
            strict=True,
        )
    ]
    frames, end = origins(dh)
    frames[0] = compose(robot.base, frames[0])
    links = ["base_link", *(f"link_{i}" for i in range(1, dh.joints + 1)), "flange"]
    frames.append(compose(end, robot.flange))
    if TOOL in calibration.targets:
        links.append("tool")
        frames.append(compose(invert(robot.flange), calibration.targets[TOOL]))
    joints += [{"name": f"{link}_fixed"} for link in links[dh.joints + 1 :]]
    lines = [about, *source.coupled_lines, *source.orientation_lines, *source.left_open_lines]
    template = Template(
        (files("kinacc.deployment.export") / "arm.urdf").read_text("utf-8"),
        autoescape=True, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    return template.render(
        name=_name(source.name),
        comments=[re.sub("-(?=-)", "- ", line) for line in lines],  # no comment holds two of them
        joints=zip(joints, links, links[1:], map(_attributes, frames), strict=False),
    )


def corrected(source: Source) -> str:
    """The file of one's own with origins changed so that its tip goes where the calibration says.

    Axes, meshes, limits, comments and everything that hangs on a link stay: origins of the moving
    joints change, and of the first fixed joint behind the last of them (one is added where there is
    none). The file's nominal arm must be the robot of the calibration, up to where its base and tip
    links sit. Raises InputError where it is not, saying how far apart the two are.
    """
    calibration, path = source.calibration, Path(source.urdf_file or "")
    base, tip = _ends_in_file(calibration.robot, path, source.links)
    plain, _ = origins(calibration.robot.dh)
    better, end = origins(source.dh)
    tree = etree.parse(str(path), etree.XMLParser(resolve_entities=False, no_network=True))
    elements = {item.get("name"): item for item in tree.getroot().findall("joint")}
    frame, before, here, gap = base, invert(base), IDENTITY, IDENTITY
    tail: list[Joint] = []
    moved = iter(zip(plain, better, strict=True))
    for joint in joints_between(path, *source.links):
        here = compose(here, joint.origin)
        if joint.kind not in MOVING:
            gap = compose(gap, joint.origin)
            tail.append(joint)
            continue
        old, new = next(moved)
        frame = compose(frame, old)
        # How the file's link sits on the axis; it sits there still after the correction.
        anchor = compose(invert(frame), here)
        origin = compose(compose(invert(before), new), anchor)
        _set_origin(elements[joint.name], compose(invert(gap), origin))
        before, gap, tail, last = anchor, IDENTITY, [], joint.child
    rest = compose(compose(invert(before), end), tip)
    if tail:
        for joint in reversed(tail[1:]):
            rest = compose(rest, invert(joint.origin))
        _set_origin(elements[tail[0].name], rest)
    else:
        link = f"{last}_calibrated"
        etree.SubElement(tree.getroot(), "link", name=link)
        joint_behind = etree.SubElement(tree.getroot(), "joint", name=f"{link}_fixed", type="fixed")
        etree.SubElement(joint_behind, "parent", link=last)
        etree.SubElement(joint_behind, "child", link=link)
        _set_origin(joint_behind, rest)
    for place, line in enumerate(source.left_open_lines):
        tree.getroot().insert(place, etree.Comment(f" {line} "))
    return etree.tostring(tree, encoding="unicode") + "\n"


def _ends_in_file(
    robot: Robot, path: Path, links: tuple[str | None, str | None]
) -> tuple[Pose, Pose]:
    """First DH frame in the file's base link, and its tip link in the last DH frame."""
    described = load(path, *links)
    if described.dh.joints != robot.dh.joints:
        message = f"its chain has {described.dh.joints} moving joints, {robot.name}"
        raise input_error(str(path), f"{message} has {robot.dh.joints}")
    low, high = np.maximum(robot.q_min_rad, -3.0e3), np.minimum(robot.q_max_rad, 3.0e3)
    share = np.random.default_rng(0).uniform(0.0, 1.0, (_PROBES, len(low)))
    q_rad = low + share * (high - low)
    wanted = forward(described, q_rad)
    ends = _dh.forward(robot.dh, robot.dh_joints(q_rad))
    start = closed_form_start(full_poses(q_rad, wanted), ends)
    options = (robot.base, robot.flange), (start.base, start.tool)
    misfits = []
    for base, tip in options:
        observed = compose(base, compose(ends, tip))
        misfits.append(float(np.abs(observed.position_mm - wanted.position_mm).max()))
    if min(misfits) > _SAME_ARM_MM:
        message = f"its arm differs from {robot.name} by up to {min(misfits):.3g} mm"
        allowed = f"the arm that was calibrated, within {_SAME_ARM_MM:g} mm, joints alike"
        raise input_error(str(path), message, allowed)
    return options[0] if misfits[0] <= 1e-8 else options[int(np.argmin(misfits))]


def _set_origin(joint: etree._Element, origin: Pose) -> None:
    element = joint.find("origin")
    if element is None:
        element = etree.Element("origin")
        joint.insert(0, element)
    for key, numbers in _attributes(origin).items():
        element.set(key, numbers)


def _attributes(origin: Pose) -> dict[str, str]:
    values = {"xyz": origin.position_mm * _M_PER_MM, "rpy": rpy(origin.rotation)}
    return {key: " ".join(map(_digits, part)) for key, part in values.items()}


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


def to_pinocchio(source: Source) -> Any:
    """A ``pinocchio.Model`` of the calibrated arm (m, rad), with frames ``flange`` and ``tool``.

    Joints are those of ``generated``.
    """
    import pinocchio

    return pinocchio.buildModelFromXML(generated(source))


def to_pybotics(source: Source, point: str | None) -> Any:
    """A ``pybotics.robot.Robot`` of the calibrated arm (mm, rad) with ``point`` as its tool.

    Joints are those of the DH table, ``robot.dh_joints(q_rad)``.
    """
    from pybotics.kinematic_chain import MDHKinematicChain
    from pybotics.link import PrismaticMDHLink, RevoluteMDHLink
    from pybotics.robot import Robot as Arm
    from pybotics.tool import Tool

    base, parameters, end = modified_dh(source, point)
    slides = source.dh.prismatic
    links = [
        (PrismaticMDHLink if slide else RevoluteMDHLink)(*row)
        for slide, row in zip(slides, parameters, strict=True)
    ]
    chain = MDHKinematicChain(links)
    return Arm(chain, tool=Tool(_matrix(end)), world_frame=_matrix(base))


def modified_dh(source: Source, point: str | None) -> tuple[Pose, np.ndarray, Pose]:
    """The arm with modified DH parameters, after Craig: Rx(alpha) Tx(a) Rz(theta) Tz(d) a joint.

    Returns
    -------
    Base of the first axis, rows alpha (rad), a (mm), theta (rad), d (mm) of all k joints, and the
    pose of ``point`` in the last joint's frame.
    """
    calibration = source.calibration
    first, chain = standard_chain(source.dh)
    # Rz Tz Tx Rx a joint, cut in front of Tx: what follows a joint goes with the next one.
    before = np.pad(np.stack([chain.alpha_rad, chain.a_mm], axis=1), ((1, 0), (0, 0)))
    parameters = np.column_stack([before[:-1], chain.theta_offset_rad, chain.d_mm])
    tilt = rotation_x(chain.alpha_rad[-1]) @ rotation_y(chain.beta_rad[-1])
    end = Pose(tilt, np.array([chain.a_mm[-1], 0.0, 0.0]))
    base = compose(calibration.robot.base, first)
    return base, parameters, compose(end, calibration.point(point))


def _matrix(pose: Pose) -> np.ndarray:
    """A pose as (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = pose.rotation, pose.position_mm
    return matrix

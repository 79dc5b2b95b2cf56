"""How each maker's controller takes joint zeros, arms and frames: names, units and conventions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import yaml

from kinacc.deployment.programs.orientation import (
    FIXED,
    INTRINSIC,
    KUKA,
    QUATERNION,
    VECTOR,
    Convention,
)
from kinacc.errors import InputError, Problem
from kinacc.geometry import IDENTITY, Pose, compose, rotation_x, rotation_y, rotation_z
from kinacc.kinematics import dh
from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.kinematics.inverse.limits import reported_joints
from kinacc.kinematics.robot import Robot
from kinacc.kinematics.robot.axes import Axes, chain_of

Numbers = dict[str, tuple[float, str]]  # by name: value and unit

ZEROS = PARAMETERS[:1]
_RAD = 180.0 / np.pi
_PARALLEL = 1e-12  # sine of an angle between axes, below which a common normal has no direction
_UR_LINKS = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
_UR_ALPHA = np.deg2rad([90.0, 0.0, 0.0, 90.0, -90.0, 0.0])


@dataclass(frozen=True)
class Controller:
    """What a controller takes.

    ``takes``: the DH parameters it can be given; ``arm``: their numbers for a fitted model of a
    robot; ``group``: what these are called; ``frame``: the numbers of a frame. ``text``: the file
    of ``ending`` that the controller reads, where it reads one. ``enter`` and ``remark``: where the
    numbers belong, and what cannot be written.
    """

    name: str
    takes: Sequence[str]
    group: str
    arm: Callable[[Robot, DHModel], Numbers]
    frame: Callable[[Pose], Numbers]
    enter: str
    remark: str = ""
    text: Callable[[Numbers], str] = lambda numbers: ""
    ending: str = ""


def _zeros(names: Sequence[str]) -> Callable[[Robot, DHModel], Numbers]:
    """Angles (deg) of reported joints at which the axes stand when the pendant shows 0."""

    def numbers(robot: Robot, model: DHModel) -> Numbers:
        shift = model.theta_offset_rad - robot.dh.theta_offset_rad
        angles = np.rad2deg(reported_joints(robot, shift))
        return {name: (float(x), "deg") for name, x in zip(names, angles, strict=False)}

    return numbers


def _frame(names: str, convention: Convention) -> Callable[[Pose], Numbers]:
    """Names and numbers of a frame; units by those of the convention."""
    length, turn = ("mm", "deg") if convention.length_mm == 1.0 else ("m", "rad")
    units = [length] * 3 + ["" if convention.orientation == QUATERNION else turn] * 4

    def numbers(pose: Pose) -> Numbers:
        values = convention.numbers(pose, np.zeros(len(names.split()))).tolist()
        return dict(zip(names.split(), zip(values, units, strict=False), strict=True))

    return numbers


def _by_joint(columns: Mapping[str, tuple[np.ndarray, str]]) -> Numbers:
    """Numbers named name[joint] of columns with a value (k,) a joint, and their unit."""
    return {
        f"{name}[{joint}]": (float(value), unit)
        for name, (values, unit) in columns.items()
        for joint, value in enumerate(values, 1)
    }


def _staubli(robot: Robot, model: DHModel) -> Numbers:
    """Offsets of theta, d, a, b, alpha, beta."""
    theta, d_mm, a_mm, alpha, beta = (
        getattr(model, name) - getattr(robot.dh, name) for name in PARAMETERS
    )
    lengths = {"d": d_mm, "a": a_mm, "b": 0.0 * a_mm}
    angles = {"theta": theta, "alpha": alpha, "beta": beta}
    columns = {name: (values, "mm") for name, values in lengths.items()}
    return _by_joint(columns | {name: (np.rad2deg(x), "deg") for name, x in angles.items()})


def _ur(robot: Robot, model: DHModel) -> Numbers:
    """Deltas of a, d, alpha and theta: common normals of the fitted axes, however far they lie."""
    nominal = robot.dh
    if model.joints != len(_UR_ALPHA) or np.abs(nominal.alpha_rad - _UR_ALPHA).max() > 1e-3:
        message = "has no DH table of UR arms (alpha 90, 0, 0, 90, -90, 0 deg)"
        fix = "use the table that UR publishes"
        raise InputError(Problem(f"robot {robot.name}", message, fix=fix))
    frames = dh.chain(model, np.zeros((1, model.joints)))
    axes = Axes(frames.position_mm[0, :-1], frames.rotation[0, :-1, :, 2])
    end = Pose(frames.rotation[0, -1], frames.position_mm[0, -1])
    _, standard, _ = chain_of(axes, end, nominal.prismatic, _PARALLEL)
    turns = standard.theta_offset_rad - nominal.theta_offset_rad
    return _by_joint({
        "delta_theta": ((turns + np.pi) % (2.0 * np.pi) - np.pi, "rad"),
        "delta_a": (1e-3 * (standard.a_mm - nominal.a_mm), "m"),
        "delta_d": (1e-3 * (standard.d_mm - nominal.d_mm), "m"),
        "delta_alpha": (standard.alpha_rad - nominal.alpha_rad, "rad"),
    })  # fmt: skip


def _ros(robot: Robot, model: DHModel) -> Numbers:
    """Origins of the joints, each in the link before it, d in front of the joint as UR has it."""
    names = _UR_LINKS if model.joints == len(_UR_LINKS) else robot.joint_names
    numbers, before = {}, IDENTITY
    for joint, name in enumerate(names):
        along = np.array([0.0, 0.0, model.d_mm[joint]])
        origin = compose(before, Pose(rotation_z(model.theta_offset_rad[joint]), along))
        parts = _ros_frame(origin).items()
        numbers |= {f"{name.replace(' ', '_')} {key}": value for key, value in parts}
        tilt = rotation_x(model.alpha_rad[joint]) @ rotation_y(model.beta_rad[joint])
        before = Pose(tilt, np.array([model.a_mm[joint], 0.0, 0.0]))
    return numbers


_ros_frame = _frame("x y z roll pitch yaw", Convention(FIXED, 1e3, _RAD))


def _nested(numbers: Numbers, outer: int) -> dict[str, dict[str, float]]:
    """Numbers by the first or second (``outer`` 0 or 1) part of their name, and by the other."""
    result: dict[str, dict[str, float]] = {}
    for name, (value, _) in numbers.items():
        parts = name.rstrip("]").replace("[", " ").split()
        result.setdefault(parts[outer], {})[parts[1 - outer]] = value
    return result


def _ur_text(numbers: Numbers) -> str:
    rows = [
        f"{name} = [ {', '.join(f'{x:.17g}' for x in row.values())}]"
        for name, row in _nested(numbers, 0).items()
    ]
    return "\n".join(["[mounting]", *rows])


def _staubli_text(numbers: Numbers) -> str:
    rows = [
        f'  <DH index="{int(joint) - 1}" '
        + " ".join(f'{key}="{x:.9f}"' for key, x in row.items())
        + " />"
        for joint, row in _nested(numbers, 1).items()
    ]
    return "\n".join(['<DhArray name="dhOffset">', *rows, "</DhArray>"])


def _ros_text(numbers: Numbers) -> str:
    content = {"kinematics": {**_nested(numbers, 0), "hash": "calib_kinacc"}}
    return yaml.safe_dump(content, sort_keys=False)


CONTROLLERS = {
    "kuka": Controller(
        "KUKA",
        ZEROS,
        "joint zeros",
        _zeros([f"A{i}" for i in range(1, 8)]),
        _frame("X Y Z A B C", Convention(KUKA)),
        "Joint zeros: add to $MAMES of each axis in the machine data, or drive every axis to minus "
        "the value and master it there as 0. TOOL and BASE: Start-up, Calibrate, Numeric input.",
    ),
    "abb": Controller(
        "ABB",
        ZEROS,
        "joint zeros",
        _zeros([f"axis {i}" for i in range(1, 8)]),
        _frame("x y z q1 q2 q3 q4", Convention(QUATERNION)),
        "Joint zeros: jog every axis to minus the value, then Calibration, Fine calibration. "
        "TOOL: tframe of the tooldata; BASE: uframe of the wobjdata (robhold FALSE).",
        "Absolute Accuracy files (absacc, .cfg of CalibWare) cannot be written: their format is "
        "ABB's own. Switch Absolute Accuracy off, or its errors are corrected twice.",
    ),
    "fanuc": Controller(
        "FANUC",
        ZEROS,
        "joint zeros",
        _zeros([f"J{i}" for i in range(1, 8)]),
        _frame("X Y Z W P R", Convention(FIXED)),
        "Joint zeros: jog all joints to 0, then SINGLE AXIS MASTER with the value as MSTR POS. "
        "TOOL: UTOOL, direct entry; BASE: UFRAME, direct entry.",
    ),
    "ur": Controller(
        "Universal Robots",
        PARAMETERS,
        "DH deltas",
        _ur,
        _frame("x y z rx ry rz", Convention(VECTOR, 1e3, _RAD)),
        "DH deltas: they replace those in section [mounting] of the controller's calibration.conf; "
        "keep its other lines. TOOL: set_tcp; BASE: a plane feature.",
        "Large delta_d of joints 2 to 4 are usual: their axes are nearly parallel.",
        _ur_text,
        ".conf",
    ),
    "yaskawa": Controller(
        "Yaskawa",
        ZEROS,
        "joint zeros",
        _zeros("SLURBTE"),
        _frame("X Y Z Rx Ry Rz", Convention(FIXED)),
        "Joint zeros: jog every axis to minus the value, then ROBOT, HOME POSITION, register it. "
        "TOOL: tool file; BASE: user frame, as coordinates in the robot frame.",
    ),
    "staubli": Controller(
        "Staubli",
        PARAMETERS,
        "DH offsets",
        _staubli,
        _frame("x y z rx ry rz", Convention(INTRINSIC)),
        "DH offsets: array dhOffset of /usr/configs/arm.cfx; they are added to the standard DH "
        "table of the robot file. TOOL: trsf of the tool; BASE: trsf of the frame.",
        text=_staubli_text,
        ending=".cfx",
    ),
    "ros": Controller(
        "ROS",
        PARAMETERS,
        "joint origins",
        _ros,
        _ros_frame,
        "Joint origins: kinematics_params_file of ur_robot_driver or ur_description. TOOL: a fixed "
        "joint from the last link; BASE: a fixed joint from the base.",
        "Other arms: kinacc export --format urdf.",
        _ros_text,
        ".yaml",
    ),
}

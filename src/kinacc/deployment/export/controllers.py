"""How each maker's controller takes joint zeros, arms and frames: names, units and conventions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
import yaml

from kinacc.deployment.programs.orientation import (
    FIXED,
    INTRINSIC,
    KUKA,
    QUATERNION,
    VECTOR,
    Convention,
    Orientation,
)
from kinacc.errors import input_error
from kinacc.geometry import IDENTITY, Pose, compose, invert, rotation_x, rotation_y, rotation_z
from kinacc.kinematics import dh
from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.kinematics.inverse.limits import reported_joints
from kinacc.kinematics.robot import Robot
from kinacc.kinematics.robot.axes import Axes, chain_of

Numbers = dict[str, tuple[float, str]]  # by name: value and unit

ZEROS = PARAMETERS[:1]
_UNITS = {"mm": 1.0, "m": 1e3, "deg": 1.0, "rad": 180.0 / np.pi, "": 1.0}
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
    arm: Callable[[Robot, DHModel], Numbers]
    frame: Callable[[Pose], Numbers]
    enter: str
    remark: str = ""
    group: str = "joint zeros"
    takes: Sequence[str] = ZEROS
    text: Callable[[Numbers], str] = lambda numbers: ""
    ending: str = ""


def _zeros(names: str) -> Callable[[Robot, DHModel], Numbers]:
    """Angles (deg) of reported joints at which the axes stand when the pendant shows 0."""

    def numbers(robot: Robot, model: DHModel) -> Numbers:
        shift = model.theta_offset_rad - robot.dh.theta_offset_rad
        angles = np.rad2deg(reported_joints(robot, shift))
        return {name: (float(x), "deg") for name, x in zip(names.split(","), angles, strict=False)}

    return numbers


def _frame(
    names: str, orientation: Orientation, length: str = "mm", angle: str = "deg"
) -> Callable[[Pose], Numbers]:
    """Names, numbers and units of a frame."""
    convention = Convention(orientation, *(_UNITS[unit] for unit in (length, angle)))
    units = [length] * 3 + [angle] * 4

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
    return _by_joint({
        "d": (d_mm, "mm"), "a": (a_mm, "mm"), "b": (0.0 * a_mm, "mm"),
        "theta": (np.rad2deg(theta), "deg"), "alpha": (np.rad2deg(alpha), "deg"),
        "beta": (np.rad2deg(beta), "deg"),
    })  # fmt: skip


def _ur(robot: Robot, model: DHModel) -> Numbers:
    """Deltas of a, d, alpha and theta: common normals of the fitted axes, however far they lie."""
    nominal = robot.dh
    if model.joints != len(_UR_ALPHA) or np.abs(nominal.alpha_rad - _UR_ALPHA).max() > 1e-3:
        message = "has no DH table of UR arms (alpha 90, 0, 0, 90, -90, 0 deg)"
        fix = "use the table that UR publishes"
        raise input_error(f"robot {robot.name}", message, fix=fix)
    _, standard = standard_chain(model)
    turns = standard.theta_offset_rad - nominal.theta_offset_rad
    return _by_joint({
        "delta_theta": ((turns + np.pi) % (2.0 * np.pi) - np.pi, "rad"),
        "delta_a": (1e-3 * (standard.a_mm - nominal.a_mm), "m"),
        "delta_d": (1e-3 * (standard.d_mm - nominal.d_mm), "m"),
        "delta_alpha": (standard.alpha_rad - nominal.alpha_rad, "rad"),
    })  # fmt: skip


def standard_chain(model: DHModel) -> tuple[Pose, DHModel]:
    """The first frame, and the arm by common normals of its axes: a beta in the last row alone."""
    frames = dh.chain(model, np.zeros((1, model.joints)))
    axes = Axes(frames.position_mm[0, :-1], frames.rotation[0, :-1, :, 2])
    *_, last, end = map(Pose, frames.rotation[0], frames.position_mm[0])
    first, chain, _ = chain_of(axes, end, model.prismatic, _PARALLEL)
    # The last row stays, but begins elsewhere on its axis.
    starts = compose(first, dh.chain(chain, np.zeros((1, model.joints))))
    moved = compose(invert(Pose(starts.rotation[0, -2], starts.position_mm[0, -2])), last)
    rows = {name: np.append(getattr(chain, name)[:-1], getattr(model, name)[-1])
            for name in PARAMETERS}  # fmt: skip
    rows["theta_offset_rad"][-1] += np.arctan2(moved.rotation[1, 0], moved.rotation[0, 0])
    rows["d_mm"][-1] += moved.position_mm[2]
    return first, DHModel(**rows, prismatic=model.prismatic)


def origins(model: DHModel, d_ahead: bool = False) -> tuple[list[Pose], Pose]:
    """The chain cut at its axes: k joints in the links before them, the last DH frame in its link.

    A joint turns about (or slides along) the z axis of its origin, so the arm is
    ``origin_1 Rz(q_1) origin_2 Rz(q_2) .. end``; ``d_ahead``: d goes before its joint, not behind.
    """
    result, before = [], IDENTITY
    for joint in range(model.joints):
        along = np.array([0.0, 0.0, model.d_mm[joint]])
        turn = Pose(rotation_z(model.theta_offset_rad[joint]), along * d_ahead)
        result.append(compose(before, turn))
        tilt = rotation_x(model.alpha_rad[joint]) @ rotation_y(model.beta_rad[joint])
        before = Pose(tilt, np.array([model.a_mm[joint], 0.0, 0.0]) + along * (not d_ahead))
    return result, before


def _ros(robot: Robot, model: DHModel) -> Numbers:
    """Origins of the joints, each in the link before it, d in front of the joint as UR has it."""
    names = _UR_LINKS if model.joints == len(_UR_LINKS) else robot.joint_names
    return {
        f"{name.replace(' ', '_')} {key}": value
        for name, origin in zip(names, origins(model, d_ahead=True)[0], strict=False)
        for key, value in _ros_frame(origin).items()
    }


_ros_frame = _frame("x y z roll pitch yaw", FIXED, "m", "rad")


def _nested(numbers: Numbers) -> dict[str, dict[str, float]]:
    """Numbers by the two parts of their names."""
    result: dict[str, dict[str, float]] = {}
    for name, (value, _) in numbers.items():
        outer, inner = name.rstrip("]").replace("[", " ").split()
        result.setdefault(outer, {})[inner] = value
    return result


def _ur_text(numbers: Numbers) -> str:
    rows = [
        f"{name} = [ {', '.join(f'{x:.17g}' for x in row.values())}]"
        for name, row in _nested(numbers).items()
    ]
    return "\n".join(["[mounting]", *rows])


def _staubli_text(numbers: Numbers) -> str:
    rows = [
        " ".join([f'  <DH index="{joint}"', *(f'{key}="{x:.9f}"' for key, x in row.items()), "/>"])
        for joint, row in enumerate(pd.DataFrame(_nested(numbers)).to_dict("records"))
    ]
    return "\n".join(['<DhArray name="dhOffset">', *rows, "</DhArray>"])


def _ros_text(numbers: Numbers) -> str:
    content = {"kinematics": {**_nested(numbers), "hash": "calib_kinacc"}}
    return yaml.safe_dump(content, sort_keys=False)


CONTROLLERS = {
    "kuka": Controller(
        "KUKA",
        _zeros("A1,A2,A3,A4,A5,A6,A7"),
        _frame("X Y Z A B C", KUKA),
        "Joint zeros: add to $MAMES of each axis in the machine data, or drive every axis to minus "
        "the value and master it there as 0. TOOL and BASE: Start-up, Calibrate, Numeric input.",
    ),
    "abb": Controller(
        "ABB",
        _zeros("axis 1,axis 2,axis 3,axis 4,axis 5,axis 6,axis 7"),
        _frame("x y z q1 q2 q3 q4", QUATERNION, angle=""),
        "Joint zeros: jog every axis to minus the value, then Calibration, Fine calibration. "
        "TOOL: tframe of the tooldata; BASE: uframe of the wobjdata (robhold FALSE).",
        "Absolute Accuracy files (absacc, .cfg of CalibWare) cannot be written: their format is "
        "ABB's own. Switch Absolute Accuracy off, or its errors are corrected twice.",
    ),
    "fanuc": Controller(
        "FANUC",
        _zeros("J1,J2,J3,J4,J5,J6,J7"),
        _frame("X Y Z W P R", FIXED),
        "Joint zeros: jog all joints to 0, then SINGLE AXIS MASTER with the value as MSTR POS. "
        "TOOL: UTOOL, direct entry; BASE: UFRAME, direct entry.",
    ),
    "ur": Controller(
        "Universal Robots",
        _ur,
        _frame("x y z rx ry rz", VECTOR, "m", "rad"),
        "DH deltas: they replace those in section [mounting] of the controller's calibration.conf; "
        "keep its other lines. TOOL: set_tcp; BASE: a plane feature.",
        "Large delta_d of joints 2 to 4 are usual: their axes are nearly parallel.",
        "DH deltas",
        PARAMETERS,
        _ur_text,
        ".conf",
    ),
    "yaskawa": Controller(
        "Yaskawa",
        _zeros("S,L,U,R,B,T,E"),
        _frame("X Y Z Rx Ry Rz", FIXED),
        "Joint zeros: jog every axis to minus the value, then ROBOT, HOME POSITION, register it. "
        "TOOL: tool file; BASE: user frame, as coordinates in the robot frame.",
    ),
    "staubli": Controller(
        "Staubli",
        _staubli,
        _frame("x y z rx ry rz", INTRINSIC),
        "DH offsets: array dhOffset of /usr/configs/arm.cfx; they are added to the standard DH "
        "table of the robot file. TOOL: trsf of the tool; BASE: trsf of the frame.",
        group="DH offsets",
        takes=PARAMETERS,
        text=_staubli_text,
        ending=".cfx",
    ),
    "ros": Controller(
        "ROS",
        _ros,
        _ros_frame,
        "Joint origins: kinematics_params_file of ur_robot_driver or ur_description. TOOL: a fixed "
        "joint from the last link; BASE: a fixed joint from the base.",
        "Other arms: kinacc export --format urdf.",
        "joint origins",
        PARAMETERS,
        _ros_text,
        ".yaml",
    ),
}

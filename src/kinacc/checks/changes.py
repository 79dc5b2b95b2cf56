"""What numbers of a file may mean in place of what they say: units, hand, joints, orientations."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations, permutations

import numpy as np
from numpy import ndarray

from kinacc.checks.findings import Finding, finding
from kinacc.checks.readings import Readings
from kinacc.config.measured import ANGLES, CONVENTIONS, Orientation
from kinacc.kinematics.robot import Robot
from kinacc.measurements.layout import LENGTH, in_order_of
from kinacc.measurements.orientation import rotations

# Units of angles: what they are, what the file says, its setting, and the factor.
_ANGLE_UNITS = (
    ("radians", "degrees", "rad", 180.0 / np.pi),
    ("degrees", "radians", "deg", np.pi / 180.0),
)
_LENGTH_UNITS = {"m": "metres", "cm": "centimetres", "inch": "inches"}
_MIRRORS = dict(zip("xyz", 1.0 - 2.0 * np.eye(3), strict=True))


@dataclass(frozen=True)
class Change:
    """A fault of a file, and the readings ``of`` it as they would be without."""

    finding: Finding
    of: Callable[[Readings], Readings]


def joint_units(robot: Robot) -> Iterator[Change]:
    """Turning joints in another unit."""
    slides = robot.dh.prismatic
    for unit, stated, short, factor in () if slides.all() else _ANGLE_UNITS:
        setting = {"joint_unit": short}
        change = finding("joint_units", unit=unit, stated=stated, short=short, setting=setting)
        yield _joints(change, robot, np.diag(np.where(slides, 1.0, factor)))


def length_units() -> Iterator[Change]:
    """Positions in another unit than millimetres, or stated to be in metres."""
    for short, unit in _LENGTH_UNITS.items():
        setting = {"length_unit": short}
        change = finding("length_units", unit=unit, short=short, setting=setting)
        yield _positions(change, LENGTH[short])
    yield _positions(finding("length_units/small", setting={"length_unit": "mm"}), 1e-3)


def left_handed() -> Change:
    """Left-handed coordinates: any mirror will do, the base takes up the rest."""
    return _mirrored(finding("left_handed"), _MIRRORS["y"], _MIRRORS["y"])


def wrong_axes() -> Iterator[Change]:
    """One coordinate of the wrong sign, of the positions alone or of the orientations too."""
    for axis, mirror in _MIRRORS.items():
        change = finding("left_handed/axis", axis=axis)
        yield _positions(change, mirror)
        yield _mirrored(change, mirror, mirror)


def joint_signs(robot: Robot) -> list[Change]:
    """Every joint counting the other way."""
    mirrors = enumerate(1.0 - 2.0 * np.eye(robot.dh.joints), 1)
    return [
        _joints(finding("joint_sign", joint=joint), robot, np.diag(mirror))
        for joint, mirror in mirrors
    ]


def joint_changes(robot: Robot) -> Iterator[Change]:
    """Every single change of the joints, common ones first: signs, couplings, zeros, order."""
    yield from joint_signs(robot)
    joints, slides, unit = range(robot.dh.joints), robot.dh.prismatic, np.eye(robot.dh.joints)
    for joint, second in permutations(np.flatnonzero(~slides).tolist(), 2):
        for word, sign in (("plus", 1.0), ("minus", -1.0)):
            matrix = unit + sign * np.outer(unit[joint], unit[second])
            joint_map = (robot.joint_map @ matrix + 0.0).tolist()
            change = finding(
                "joint_coupling",
                joint=joint + 1,
                other=second + 1,
                sign=word,
                joint_map=joint_map,
            )
            yield _joints(change, robot, matrix)
    for joint in joints[1:-1]:  # of the first and last, base and tool take it up
        for zero_deg in () if slides[joint] else (90.0, -90.0, 180.0):
            change = finding("joint_zero", joint=joint + 1, zero_deg=zero_deg)
            zero = np.linalg.solve(robot.joint_map, np.deg2rad(zero_deg) * unit[joint])
            yield _joints(change, robot, unit, zero)
    for joint, second in combinations(joints, 2):
        if slides[joint] == slides[second]:
            order = np.array(joints)
            order[[joint, second]] = second, joint
            change = finding("joint_order", joint=joint + 1, other=second + 1)
            yield _joints(change, robot, unit[order])


def orientations(stated: Orientation) -> Iterator[Change]:
    """Every single change of the orientations, likely ones first."""
    yield from reversals()
    for unit, before, short, factor in _ANGLE_UNITS if stated.kind != "quaternion" else ():
        setting = {"orientation": {"unit": short}}
        change = finding("angle_units", unit=unit, stated=before, short=short, setting=setting)
        yield _turns(change, stated, [0, 1, 2], factor)
    yield from conventions(stated)


def reversals() -> Iterator[Change]:
    """Orientations the wrong way round, or in left-handed coordinates."""
    change = finding("transposed_rotation")
    yield Change(change, lambda read: replace(read, rotation=np.swapaxes(read.rotation, 1, 2)))
    for axis, mirror in _MIRRORS.items():
        yield _mirrored(finding("left_handed/turns", axis=axis), mirror, of_positions=1.0)


def conventions(stated: Orientation) -> Iterator[Change]:
    """Orientations of another convention or order than is ``stated``."""
    if stated.kind == "quaternion":
        for order, name in (([3, 0, 1, 2], "xyzw"), ([1, 2, 3, 0], "wxyz")):
            setting = {"orientation": {"order": name}}
            change = finding("euler_convention/quaternion", order=name, setting=setting)
            yield _turns(change, stated, order)
        return
    is_euler = stated.kind == "euler"
    names = in_order_of(stated.convention) if is_euler else ANGLES
    before = f"of convention {stated.convention}" if is_euler else "rotation vectors"

    def euler(convention: str, order: list[int], text: str) -> Change:
        """Euler angles of a convention, of which ``order`` are the columns as written."""
        columns = [names[number] for number in order]
        meant = {"kind": "euler", "convention": convention}
        setting: dict[str, object] = {"orientation": meant}
        setting |= {} if columns == list(in_order_of(convention)) else {"e": columns}
        change = finding(
            "euler_convention", convention=convention, order=text, stated=before, setting=setting
        )
        return _turns(change, stated.model_copy(update=meant), order)

    if is_euler and len(set(stated.convention.lower())) == 3:
        # Angles about x, y, z as named, taken in another sequence.
        for convention in CONVENTIONS[:6]:
            if convention not in (stated.convention, stated.convention[::-1].upper()):
                order = [names.index(name) for name in in_order_of(convention)]
                yield euler(convention, order, f" (or {convention[::-1].lower()})")
    for convention in CONVENTIONS:
        if not (is_euler and convention == stated.convention):
            yield euler(convention, [0, 1, 2], " in the columns' order")
    if is_euler:
        setting = {"orientation": {"kind": "rotation_vector"}}
        change = finding("euler_convention/vector", setting=setting)
        vector = stated.model_copy(update={"kind": "rotation_vector"})
        yield _turns(change, vector, [names.index(name) for name in ANGLES])


def _joints(change: Finding, robot: Robot, matrix: ndarray, zero: ndarray | float = 0.0) -> Change:
    """Joints ``matrix @ q + zero`` in place of q."""

    def of(read: Readings) -> Readings:
        q, commanded = (joints @ matrix.T + zero for joints in (read.q, read.commanded))
        return replace(read, q=q, commanded=commanded, q_rad=robot.dh_joints(q))

    return Change(change, of)


def _positions(change: Finding, factor: ndarray | float) -> Change:
    return Change(change, lambda read: replace(read, position_mm=read.position_mm * factor))


def _mirrored(change: Finding, mirror: ndarray, of_positions: ndarray | float) -> Change:
    """Orientations mirrored, and positions times a factor of their own."""

    def of(read: Readings) -> Readings:
        rotation = read.rotation * np.outer(mirror, mirror)
        return replace(read, position_mm=read.position_mm * of_positions, rotation=rotation)

    return Change(change, of)


def _turns(change: Finding, meant: Orientation, order: list[int], factor: float = 1.0) -> Change:
    """Columns ``order`` of the orientations as written, times a factor, read as is ``meant``."""
    return Change(
        change,
        lambda read: replace(read, rotation=rotations(read.turns[:, order] * factor, meant)),
    )

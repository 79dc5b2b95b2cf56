"""Ways a file may mean something else than it says, as changes of joints and positions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

MIRROR = np.array([1.0, -1.0, 1.0])  # any mirror will do: the base frame takes up the rest
SCALES = {
    "metres": 1000.0,
    "centimetres": 10.0,
    "inches": 25.4,
    "micrometres": 1e-3,
}


@dataclass(frozen=True)
class Change:
    """One change: ``kind`` as in suspicions, in words, and what to do about it.

    ``setting`` is what of ``measurements.file`` would undo it, where that alone can.
    """

    kind: str
    words: str
    fix: str
    joints: tuple[int, ...] = ()
    setting: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Meaning:
    """What the numbers of a file mean: DH joints are ``matrix @ (unit * q) + zero``.

    ``matrix`` (k, k), ``unit`` and ``zero`` (k,) act on joints as read; positions are multiplied by
    ``scale`` and, where ``mirrored``, by ``MIRROR``. ``changes`` tell it from what the file says.
    """

    matrix: np.ndarray
    unit: np.ndarray
    zero: np.ndarray
    scale: float = 1.0
    mirrored: bool = False
    changes: tuple[Change, ...] = field(default=())

    def joints(self, q: np.ndarray) -> np.ndarray:
        """DH joint values (n, k) of joints as read (n, k)."""
        return (q * self.unit) @ self.matrix.T + self.zero

    def positions(self, position_mm: np.ndarray) -> np.ndarray:
        """Positions (n, 3) in mm and right-handed coordinates."""
        return position_mm * self.scale * (MIRROR if self.mirrored else 1.0)

    def rotations(self, rotation: np.ndarray) -> np.ndarray:
        """Orientations (n, 3, 3) in right-handed coordinates."""
        return rotation * np.outer(MIRROR, MIRROR) if self.mirrored else rotation

    @property
    def numbers(self) -> tuple[object, ...]:
        """What it does, whatever it is called: the same of two that are one meaning."""
        arrays = (self.matrix, self.unit, self.zero)
        return (*(each.tobytes() for each in arrays), self.scale, self.mirrored)

    def part_of(self, other: Meaning) -> bool:
        """Whether the other one only adds changes to it, which then explain nothing themselves."""
        return {each.words for each in self.changes} <= {each.words for each in other.changes}

    def changed(self, change: Change, **values) -> Meaning:
        """This meaning with one more change."""
        return replace(self, changes=(*self.changes, change), **values)


def as_written(joint_map: np.ndarray) -> Meaning:
    """The file means what it says."""
    joints = len(joint_map)
    return Meaning(np.array(joint_map, dtype=float), np.ones(joints), np.zeros(joints))


def of_units(
    meaning: Meaning, q: np.ndarray, prismatic: np.ndarray, most_rad: float
) -> Iterator[Meaning]:
    """The meaning, and those with joints in another unit that stays within ``most_rad``."""
    yield meaning
    turning = ~prismatic
    largest = float(np.abs(q[:, turning]).max(initial=0.0))
    if turning.any() and np.rad2deg(largest) <= most_rad:
        change = Change(
            "joint_units",
            "the joints are in radians, not in degrees",
            "name the columns q1_rad .., or set measurements.file.joint_unit: rad",
            setting={"joint_unit": "rad"},
        )
        yield meaning.changed(change, unit=np.where(turning, 180.0 / np.pi, 1.0))
    if turning.any() and largest > most_rad:
        change = Change(
            "joint_units",
            "the joints are in degrees, not in radians",
            "name the columns q1_deg .., or set measurements.file.joint_unit: deg",
            setting={"joint_unit": "deg"},
        )
        yield meaning.changed(change, unit=np.where(turning, np.pi / 180.0, 1.0))
    if prismatic.any():
        for name, factor in (("metres", 1e3), ("millimetres", 1e-3)):
            change = Change(
                "joint_units", f"the sliding joints are in {name}", "correct the columns' unit"
            )
            yield meaning.changed(change, unit=np.where(prismatic, factor, 1.0))


def of_scale(meaning: Meaning, ratio: float) -> Iterator[Meaning]:
    """Positions in a unit that brings their spread, now ``ratio`` times the arm's, within reach."""
    if 0.2 < ratio < 5.0:
        yield meaning
    for name, factor in SCALES.items():
        if 0.2 < ratio * factor < 5.0:
            change = Change(
                "length_units",
                f"the positions are in {name}",
                "name the columns x_m .., or set measurements.file.length_unit"
                if name == "metres"
                else "convert them to millimetres or metres",
                setting={"length_unit": "m"} if name == "metres" else {},
            )
            yield meaning.changed(change, scale=factor)
    if 0.2 < ratio / 1000.0 < 5.0:
        change = Change(
            "length_units",
            "the positions are in millimetres, not in metres",
            "name the columns x_mm .., or set measurements.file.length_unit: mm",
            setting={"length_unit": "mm"},
        )
        yield meaning.changed(change, scale=1e-3)


def mirrored(meaning: Meaning) -> Meaning:
    """The meaning in left-handed coordinates."""
    change = Change(
        "left_handed",
        "the positions are in left-handed coordinates",
        "negate one coordinate (of the orientations too), or export in right-handed coordinates",
    )
    return meaning.changed(change, mirrored=True)


def of_signs(meaning: Meaning, joints: tuple[int, ...]) -> Meaning:
    """The meaning with the joints (0-based) counting the other way."""
    signs = np.ones(len(meaning.unit))
    signs[list(joints)] = -1.0
    changes = [
        Change(
            "joint_sign",
            f"joint {joint + 1} counts the other way",
            f"reverse joint {joint + 1} in the robot's description (sign: -1) or in the file",
            (joint,),
        )
        for joint in joints
    ]
    return replace(meaning, matrix=meaning.matrix * signs, changes=(*meaning.changes, *changes))


def single(meaning: Meaning, prismatic: np.ndarray) -> Iterator[Meaning]:
    """Every meaning one change of the joints away: signs, couplings, zeros, order."""
    joints = len(meaning.unit)
    signed = {j for change in meaning.changes if change.kind == "joint_sign" for j in change.joints}
    for joint in range(joints):
        if joint not in signed:
            yield of_signs(meaning, (joint,))
    for joint in range(joints):
        for other in range(joints):
            if other != joint and not prismatic[[joint, other]].any():
                yield from (_coupled(meaning, joint, other, sign) for sign in (1.0, -1.0))
    for joint in range(1, joints - 1):  # of the first and last, base and tool take it up
        if not prismatic[joint]:
            for quarter in (90.0, -90.0, 180.0):
                yield _shifted(meaning, joint, quarter)
    for joint in range(joints):
        for other in range(joint + 1, joints):
            if prismatic[joint] == prismatic[other]:
                yield _swapped(meaning, joint, other)


def _coupled(meaning: Meaning, joint: int, other: int, sign: float) -> Meaning:
    coupling = np.eye(len(meaning.unit))
    coupling[joint, other] = sign
    word = "plus" if sign > 0 else "minus"
    change = Change(
        "joint_coupling",
        f"joint {joint + 1} is joint {joint + 1} {word} joint {other + 1} of the file",
        f"write joint_map: {_listed(meaning.matrix @ coupling)} into the robot file",
        (joint, other),
    )
    return meaning.changed(change, matrix=meaning.matrix @ coupling)


def _listed(matrix: np.ndarray) -> str:
    """A matrix as YAML on one line."""
    rows = (", ".join(f"{value:g}" for value in row) for row in matrix + 0.0)
    return f"[{', '.join(f'[{row}]' for row in rows)}]"


def _shifted(meaning: Meaning, joint: int, quarter_deg: float) -> Meaning:
    zero = meaning.zero.copy()
    zero[joint] += np.deg2rad(quarter_deg)
    change = Change(
        "joint_zero",
        f"joint {joint + 1} counts from another zero, {quarter_deg:+g} deg away",
        f"change theta_offset of joint {joint + 1} in the robot's description",
        (joint,),
    )
    return meaning.changed(change, zero=zero)


def _swapped(meaning: Meaning, joint: int, other: int) -> Meaning:
    order = np.arange(len(meaning.unit))
    order[[joint, other]] = other, joint
    change = Change(
        "joint_order",
        f"joints {joint + 1} and {other + 1} are exchanged",
        "exchange their columns",
        (joint, other),
    )
    return meaning.changed(change, matrix=meaning.matrix[:, order])

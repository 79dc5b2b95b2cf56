"""How the orientations of a file are meant, by trying, once positions tell where the arm is.

A target is rigidly on the flange: seen from the flange every orientation of it is the same. How far
they scatter tells the right reading of the numbers from a wrong one, without any fit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy import ndarray

from kinacc.checks.findings import Finding, finding
from kinacc.checks.readings import Readings, nearest_rotation
from kinacc.config.measured import Orientation
from kinacc.measurements.layout import ANGLES, in_order_of
from kinacc.measurements.orientation import CONVENTIONS, rotations

BETTER = 0.5  # of the scatter as written
# In which unit angles are, in which they are said to be, its setting, and the factor.
ANGLE_UNITS = (
    ("radians", "degrees", "rad", 180.0 / np.pi),
    ("degrees", "radians", "deg", np.pi / 180.0),
)
_LARGEST_RAD = 0.35  # scatter of a right reading, the arm being off by what it may be
_MAJORITY = 0.7
_ROWS = 300


@dataclass(frozen=True)
class Turn:
    """A way to read orientations: ``read`` turns raw numbers (n, 3 or 4) into (n, 3, 3)."""

    change: Finding | None
    read: Callable[[ndarray], ndarray]


def scatter(flange: ndarray, rotation: ndarray, target: ndarray) -> float:
    """Angle within which most orientations agree, seen from the flange, each target by itself.

    ``flange`` and ``rotation`` (n, 3, 3) in the instrument's frame, none of them missing.
    """
    turns = np.swapaxes(flange, 1, 2) @ rotation
    angles = [_angles(turns[target == item]) for item in np.unique(target)]
    return float(np.quantile(np.concatenate(angles), _MAJORITY))


def find(
    raw: ndarray, stated: Orientation, flange: ndarray, target: ndarray
) -> tuple[Turn, float, float]:
    """The best way to read the raw orientations (n, 3 or 4), and its scatter and that as written.

    As written unless another way scatters less than half, and little.
    """
    written = Turn(None, lambda raw: rotations(raw, stated))
    step = max(len(raw) // _ROWS, 1)
    raw, flange, target = raw[::step], flange[::step], target[::step]
    here = scatter(flange, written.read(raw), target)
    for ways in (simple(stated, raw), combined(stated)):
        tried = [(scatter(flange, way.read(raw), target), way) for way in ways]
        least = min(value for value, _ in tried)
        if least < BETTER * here and least < _LARGEST_RAD:
            return next((w, value, here) for value, w in tried if value < 1.5 * least)
    return written, here, here


def change_finding(
    change: Finding, read: Readings, there: ndarray, before: float, least: float
) -> Finding:
    """The finding of a change that brings orientations (mask ``there``) together; scatters, rad."""
    detail = " (seen from the flange they scatter by {as_written_deg:.3g} deg as written, by "
    detail += "{found_deg:.3g} deg so)"
    degrees = {"as_written_deg": float(np.rad2deg(before)), "found_deg": float(np.rad2deg(least))}
    return change.of_lines(read.lines(there), detail, **degrees)


def simple(stated: Orientation, raw: ndarray) -> Iterator[Turn]:
    """Ways one change away from what is stated, likely ones first."""
    yield from _backwards(Turn(None, lambda raw: rotations(raw, stated)))
    largest = np.nanmax(np.abs(raw), initial=0.0)
    for unit, before, short, factor in ANGLE_UNITS:
        may_be = np.rad2deg(largest) <= 4.0 * np.pi if short == "rad" else largest > 2.0 * np.pi
        if may_be and stated.kind != "quaternion":
            setting = {"orientation": {"unit": short}}
            change = finding("angle_units", unit=unit, stated=before, short=short, setting=setting)
            yield Turn(change, lambda raw, by=factor: rotations(raw * by, stated))  # type: ignore[misc]
    yield from _readings(stated)


def combined(stated: Orientation) -> Iterator[Turn]:
    """Other conventions, read the wrong way round or in left-handed coordinates."""
    for turn in _readings(stated):
        yield from _backwards(turn)


def _backwards(turn: Turn) -> Iterator[Turn]:
    def joined(change: Finding) -> Finding:
        before = turn.change
        if before is None:
            return change
        message, fix = f"{before.what}, and {change.what}", f"{before.fix}; {change.fix}"
        return replace(before, what=message, fix=fix, values={})

    change = finding("transposed_rotation")
    yield Turn(joined(change), lambda raw: np.swapaxes(turn.read(raw), 1, 2))
    for axis, name in enumerate("xyz"):
        mirror = np.where(np.arange(3) == axis, -1.0, 1.0)
        change, both = finding("left_handed/turns", axis=name), np.outer(mirror, mirror)
        yield Turn(joined(change), lambda raw, by=both: turn.read(raw) * by)  # type: ignore[misc]


def _readings(stated: Orientation) -> Iterator[Turn]:
    if stated.kind == "quaternion":
        for shift, name in ((1, "xyzw"), (-1, "wxyz")):
            setting = {"orientation": {"order": name}}
            change = finding("euler_convention/quaternion", order=name, setting=setting)
            yield Turn(change, lambda raw, by=shift: rotations(np.roll(raw, by, 1), stated))  # type: ignore[misc]
        return
    euler = stated.kind == "euler"
    names = in_order_of(stated.convention) if euler else ANGLES
    order: list[int]
    if euler and len(set(stated.convention.lower())) == 3:
        # Angles about x, y, z as named, taken in another sequence.
        for convention in CONVENTIONS[:6]:
            if convention not in (stated.convention, stated.convention[::-1].upper()):
                order = [names.index(name) for name in in_order_of(convention)]
                yield _euler(stated, convention, order, f" (or {convention[::-1].lower()})")
    for convention in CONVENTIONS:
        if not (euler and convention == stated.convention):
            yield _euler(stated, convention, [0, 1, 2], " in the columns' order")
    if euler:
        order = [names.index(name) for name in ANGLES]
        vector = stated.model_copy(update={"kind": "rotation_vector"})
        setting = {"orientation": {"kind": "rotation_vector"}}
        change = finding("euler_convention/vector", setting=setting)
        yield Turn(change, lambda raw: rotations(raw[:, order], vector))


def _euler(stated: Orientation, convention: str, order: list[int], text: str) -> Turn:
    """Euler angles of a convention, of which ``order`` are the raw columns."""
    euler = stated.kind == "euler"
    here = in_order_of(stated.convention) if euler else ANGLES
    columns = [here[number] for number in order]
    setting: dict[str, object] = {"orientation": {"kind": "euler", "convention": convention}}
    setting |= {} if columns == list(in_order_of(convention)) else {"e": columns}
    before = f"of convention {stated.convention}" if euler else "rotation vectors"
    change = finding(
        "euler_convention", convention=convention, order=text, stated=before, setting=setting
    )
    second = stated.model_copy(update={"kind": "euler", "convention": convention})
    return Turn(change, lambda raw: rotations(raw[:, order], second))


def _angles(turns: ndarray) -> ndarray:
    """Angles (n,) of rotations (n, 3, 3) to their robust mean."""
    rows = np.arange(len(turns))
    for _ in range(5):
        mean = nearest_rotation(turns[rows].sum(axis=0))
        cosine = 0.5 * (np.einsum("nij,ij->n", turns, mean) - 1.0)
        angle = np.arccos(np.clip(cosine, -1.0, 1.0))
        rows = np.argsort(angle)[: max(int(_MAJORITY * len(angle)), 1)]
    return angle

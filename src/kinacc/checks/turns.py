"""Find how the orientations of a file are meant, by trying, once positions tell where the arm is.

A target is rigidly on the flange: seen from the flange every orientation of it is the same. How far
they scatter tells the right reading of the numbers from a wrong one, without any fit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from kinacc.checks.cells import nearest_rotation
from kinacc.checks.changes import Change
from kinacc.measurements.layout import ANGLES, Layout, in_order_of
from kinacc.measurements.orientation import rotations

CONVENTIONS = tuple(
    order if intrinsic else order.lower()
    for intrinsic in (True, False)
    for order in (
        *("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"),
        *("XYX", "XZX", "YXY", "YZY", "ZXZ", "ZYZ"),
    )
)
BETTER = 0.5  # of the scatter as written
_LARGEST_RAD = 0.35  # scatter of a right reading, the arm being off by what it may be
_MAJORITY = 0.7
_ROWS = 300


@dataclass(frozen=True)
class Turn:
    """A way to read orientations: ``read`` turns raw numbers (n, 3 or 4) into (n, 3, 3)."""

    change: Change | None
    read: Callable[[np.ndarray], np.ndarray]


def as_written(layout: Layout) -> Turn:
    """The orientations as the layout has them."""
    return Turn(None, lambda raw: rotations(raw, layout))


def scatter(flange: np.ndarray, rotation: np.ndarray, target: np.ndarray) -> float:
    """Angle within which most orientations agree, seen from the flange, each target by itself.

    ``flange`` and ``rotation`` (n, 3, 3) in the instrument's frame, none of them missing.
    """
    angles = np.concatenate(
        [
            _angles(np.swapaxes(flange[target == each], 1, 2) @ rotation[target == each])
            for each in np.unique(target)
        ]
    )
    return float(np.quantile(angles, _MAJORITY))


def find(
    raw: np.ndarray, layout: Layout, flange: np.ndarray, target: np.ndarray
) -> tuple[Turn, float, float]:
    """The best way to read the raw orientations (n, 3 or 4), and its scatter and that as written.

    As written unless another way scatters less than half, and little.
    """
    written = as_written(layout)
    step = max(len(raw) // _ROWS, 1)
    raw, flange, target = raw[::step], flange[::step], target[::step]
    here = scatter(flange, written.read(raw), target)
    for ways in (list(simple(layout, raw)), list(combined(layout, raw))):
        tried = [(scatter(flange, way.read(raw), target), way) for way in ways]
        least = min(tried, key=lambda pair: pair[0])[0]
        if least < BETTER * here and least < _LARGEST_RAD:
            return next((w, value, here) for value, w in tried if value < 1.5 * least)
    return written, here, here


def simple(layout: Layout, raw: np.ndarray) -> Iterator[Turn]:
    """Ways one change away from what is stated, likely ones first."""
    written = as_written(layout)
    yield from _backwards(written, None)
    yield from _units(layout, raw)
    yield from _readings(layout, raw)


def combined(layout: Layout, raw: np.ndarray) -> Iterator[Turn]:
    """Other conventions, read the wrong way round or in left-handed coordinates."""
    for turn in _readings(layout, raw):
        yield from _backwards(turn, turn.change)


def _backwards(turn: Turn, before: Change | None) -> Iterator[Turn]:
    words = f"{before.words}, and " if before else ""
    yield Turn(
        Change(
            before.kind if before else "transposed_rotation",
            f"{words}the orientations are transposed: of the instrument seen from the target",
            "invert the orientations (quaternion: negate x, y and z)",
        ),
        lambda raw: np.swapaxes(turn.read(raw), 1, 2),
    )
    for axis, name in enumerate("xyz"):
        mirror = np.where(np.arange(3) == axis, -1.0, 1.0)
        both = np.outer(mirror, mirror)
        yield Turn(
            Change(
                before.kind if before else "left_handed",
                f"{words}the orientations are in left-handed coordinates ({name} reversed)",
                "export them in right-handed coordinates",
            ),
            lambda raw, both=both: turn.read(raw) * both,
        )


def _units(layout: Layout, raw: np.ndarray) -> Iterator[Turn]:
    if layout.orientation == "quaternion":
        return
    largest = np.nanmax(np.abs(raw), initial=0.0)
    if np.rad2deg(largest) <= 4.0 * np.pi:
        words = "the orientation angles are in radians, not in degrees"
        fix = "name the columns rx_rad .., or set measurements.file.orientation.unit: rad"
        yield _scaled(layout, 180.0 / np.pi, words, fix, "rad")
    if largest > 2.0 * np.pi:
        words = "the orientation angles are in degrees, not in radians"
        fix = "name the columns rx_deg .., or set measurements.file.orientation.unit: deg"
        yield _scaled(layout, np.pi / 180.0, words, fix, "deg")


def _scaled(layout: Layout, factor: float, words: str, fix: str, unit: str) -> Turn:
    change = Change("angle_units", words, fix, setting={"orientation": {"unit": unit}})
    return Turn(change, lambda raw: rotations(raw * factor, layout))


def _readings(layout: Layout, raw: np.ndarray) -> Iterator[Turn]:
    if layout.orientation == "quaternion":
        for order, name in (([3, 0, 1, 2], "xyzw"), ([1, 2, 3, 0], "wxyz")):
            change = Change(
                "euler_convention",
                f"the quaternions are written in the order {name}, and read in another",
                "state measurements.file.orientation.order, or exchange the columns",
                setting={"orientation": {"order": name}},
            )
            yield Turn(change, lambda r, order=order: rotations(r[:, order], layout))
        return
    stated = layout.orientation == "euler"
    if stated and len(set(layout.convention.lower())) == 3:
        # Angles about x, y, z as named, taken in another sequence.
        names = in_order_of(layout.convention)
        for convention in CONVENTIONS[:6]:
            order = [names.index(name) for name in in_order_of(convention)]
            if convention not in (layout.convention, layout.convention[::-1].upper()):
                yield _euler(layout, convention, order, f"{convention} (or {_same(convention)})")
    for convention in CONVENTIONS:
        if not (stated and convention == layout.convention):
            yield _euler(layout, convention, [0, 1, 2], f"{convention} in the columns' order")
    if stated:
        by_axis = [0, 1, 2]
        if len(set(layout.convention.lower())) == 3:
            by_axis = [in_order_of(layout.convention).index(f"r{axis}") for axis in "xyz"]
        vector = replace(layout, orientation="rotation_vector")
        yield Turn(
            Change(
                "euler_convention",
                "the orientations are rotation vectors, not Euler angles",
                "set measurements.file.orientation.kind: rotation_vector",
                setting={"orientation": {"kind": "rotation_vector"}},
            ),
            lambda r: rotations(r[:, by_axis], vector),
        )


def _same(convention: str) -> str:
    """The extrinsic sequence that is the same rotation."""
    return convention[::-1].lower()


def _euler(layout: Layout, convention: str, order: list[int], words: str) -> Turn:
    other = replace(layout, orientation="euler", convention=convention)
    stated = f"of convention {layout.convention}" if layout.orientation == "euler" else "vectors"
    change = Change(
        "euler_convention",
        f"the orientations are Euler angles {words}, not {stated}",
        f"set measurements.file.orientation.convention: {convention}",
        setting=_setting(layout, convention, order),
    )
    return Turn(change, lambda raw: rotations(raw[:, order], other))


def _setting(layout: Layout, convention: str, order: list[int]) -> dict[str, object]:
    """What makes the file be read so; ``e`` are the columns of the angles where names mislead."""
    here = in_order_of(layout.convention) if layout.orientation == "euler" else ANGLES
    columns = [here[number] for number in order]
    setting: dict[str, object] = {"orientation": {"kind": "euler", "convention": convention}}
    return setting if columns == list(in_order_of(convention)) else setting | {"e": columns}


def _angles(turns: np.ndarray) -> np.ndarray:
    """Angles (n,) of rotations (n, 3, 3) to their robust mean."""
    rows = np.arange(len(turns))
    for _ in range(5):
        mean = nearest_rotation(turns[rows].sum(axis=0))
        cosine = 0.5 * (np.einsum("nij,ij->n", turns, mean) - 1.0)
        angle = np.arccos(np.clip(cosine, -1.0, 1.0))
        rows = np.argsort(angle)[: max(int(_MAJORITY * len(angle)), 1)]
    return angle

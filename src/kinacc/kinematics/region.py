"""Evaluation spaces: sector of a cylinder, its grid, the flange orientations and point sequences.

Everything is in the robot base frame; the cylinder stands about its z axis.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.stats import qmc

from kinacc.geometry import Pose, rotation_x, rotation_y, rotation_z

SEQUENCES = ("sobol", "halton")
SLICE, BASE = "slice", "base"  # frames a flange orientation may be given in

_ROUND_OFF_MM = 1e-9


@dataclass(frozen=True)
class Cylinder:
    """Sector of a hollow cylinder about the base z axis: radii, heights (mm), angles (rad)."""

    inner_radius_mm: float
    radial_span_mm: float
    bottom_mm: float
    height_mm: float
    angle_min_rad: float
    angle_max_rad: float

    @property
    def outer_radius_mm(self) -> float:
        """Largest distance from the base z axis."""
        return self.inner_radius_mm + self.radial_span_mm

    @property
    def top_mm(self) -> float:
        """Largest height."""
        return self.bottom_mm + self.height_mm


class Cells(NamedTuple):
    """Points in cylinder coordinates, each (n,)."""

    angle_rad: np.ndarray
    radius_mm: np.ndarray
    height_mm: np.ndarray


class Attitude(NamedTuple):
    """Flange orientation (3, 3) before the rotations, in the frame ``SLICE`` or ``BASE``."""

    reference: np.ndarray
    frame: str = SLICE


class Orientations(NamedTuple):
    """Flange rotations (m, 3, 3) relative to the reference orientation, and their names."""

    rotation: np.ndarray
    names: tuple[str, ...]


def contains(cylinder: Cylinder, position_mm: np.ndarray) -> np.ndarray:
    """Whether positions (..., 3) lie in the cylinder, its faces included; (...)."""
    x, y, z = np.moveaxis(np.asarray(position_mm, dtype=float), -1, 0)
    radius = np.hypot(x, y)
    # Angles relative to the start of the sector, so that it may cross +-180 degrees.
    span = cylinder.angle_max_rad - cylinder.angle_min_rad
    angle = np.mod(np.arctan2(y, x) - cylinder.angle_min_rad + 1e-12, 2.0 * np.pi) - 1e-12
    return (
        (radius >= cylinder.inner_radius_mm - _ROUND_OFF_MM)
        & (radius <= cylinder.outer_radius_mm + _ROUND_OFF_MM)
        & (z >= cylinder.bottom_mm - _ROUND_OFF_MM)
        & (z <= cylinder.top_mm + _ROUND_OFF_MM)
        & ((angle <= span + 1e-12) | (radius == 0.0))
    )


def levels_mm(first_mm: float, span_mm: float, spacing_mm: float) -> np.ndarray:
    """Grid values over a span, both edges included, evenly spaced and nowhere wider than asked."""
    steps = max(1, int(np.ceil(span_mm / spacing_mm - 1e-9)))
    return first_mm + span_mm * np.arange(steps + 1) / steps


def grid(cylinder: Cylinder, slices_rad: np.ndarray, spacing_mm: float) -> Cells:
    """Cells of radial slices, edges included: by slice, then radius, then height."""
    radii = levels_mm(cylinder.inner_radius_mm, cylinder.radial_span_mm, spacing_mm)
    heights = levels_mm(cylinder.bottom_mm, cylinder.height_mm, spacing_mm)
    mesh = np.meshgrid(np.asarray(slices_rad, dtype=float), radii, heights, indexing="ij")
    return Cells(*(axis.ravel() for axis in mesh))


def fill(cylinder: Cylinder, unit: np.ndarray) -> Cells:
    """Points (n, 3) of the unit cube (radius, angle, height) spread evenly over the volume."""
    inner_sq, outer_sq = cylinder.inner_radius_mm**2, cylinder.outer_radius_mm**2
    return Cells(
        cylinder.angle_min_rad + unit[:, 1] * (cylinder.angle_max_rad - cylinder.angle_min_rad),
        np.sqrt(inner_sq + unit[:, 0] * (outer_sq - inner_sq)),
        cylinder.bottom_mm + unit[:, 2] * cylinder.height_mm,
    )


def orientations(angle_rad: float, rotations: str) -> Orientations:
    """Rotations by +-angle about the flange's own X, then Y, then Z axis.

    ``signs_and_zero``: the eight sign combinations and no rotation. ``all_27``: every combination
    of minus, none and plus. Names read ``X+ Y- Z0``.
    """
    signs = (-1, 0, 1) if rotations == "all_27" else (-1, 1)
    combinations = list(product(signs, repeat=3))
    if rotations != "all_27":
        combinations.insert(0, (0, 0, 0))
    x, y, z = np.array(combinations, dtype=float).T * angle_rad
    names = (
        " ".join(f"{axis}{'-0+'[sign + 1]}" for axis, sign in zip("XYZ", row, strict=True))
        for row in combinations
    )
    return Orientations(rotation_x(x) @ rotation_y(y) @ rotation_z(z), tuple(names))


def reference_rotation(euler_rad: np.ndarray) -> np.ndarray:
    """Rotation (3, 3) of intrinsic XYZ angles (3,): the reference flange orientation."""
    return rotation_x(euler_rad[0]) @ rotation_y(euler_rad[1]) @ rotation_z(euler_rad[2])


def tool_poses(
    cells: Cells, reference: np.ndarray, relative: np.ndarray, frame: str = SLICE
) -> Pose:
    """Tool poses (n, ...) at cells (n,), turned by ``relative``, (n, 3, 3) or (3, 3).

    ``reference`` (3, 3) is given in ``frame``. ``SLICE``: x outward, z up, orientation =
    Rz(angle) @ reference @ relative, so that a pose keeps its place relative to the arm when the
    slice turns. ``BASE``: reference @ relative, so that the tool keeps its attitude to a workpiece.
    """
    turn = rotation_z(cells.angle_rad if frame == SLICE else np.zeros_like(cells.angle_rad))
    rotation = turn @ reference @ relative
    cosine, sine = np.cos(cells.angle_rad), np.sin(cells.angle_rad)
    position = np.stack(
        [cells.radius_mm * cosine, cells.radius_mm * sine, cells.height_mm], axis=-1
    )
    return Pose(rotation, position)


def points(sequence: str, count: int, dimensions: int, first: int = 1) -> np.ndarray:
    """Points ``first`` to ``first + count - 1`` of an unscrambled sequence, (count, dimensions).

    ``sobol`` (Joe and Kuo's direction numbers) or ``halton`` (first primes). Point 0 is the origin,
    a corner of every space, so sequences start at 1 by default. Unscrambled and unshifted: no seed
    enters.
    """
    if sequence == "halton":
        engine: qmc.QMCEngine = qmc.Halton(dimensions, scramble=False)
    else:
        engine = qmc.Sobol(dimensions, scramble=False, bits=30)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a number of points that is no power of two is meant
        return engine.fast_forward(first).random(count) if first else engine.random(count)

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

SLICE, BASE = "slice", "base"  # frames a flange orientation may be given in

_ROUND_OFF_MM = 1e-9


@dataclass(frozen=True)
class Cylinder:
    """Sector of a hollow cylinder about the z axis of the robot base.

    Attributes
    ----------
    inner_radius_mm, radial_span_mm : float
        Inner radius, and outer minus inner radius.
    bottom_mm, height_mm : float
        Lowest z, and highest minus lowest z.
    angle_min_rad, angle_max_rad : float
        Ends of the sector, counted from the base x axis.
    """

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
    """Points in cylinder coordinates of the robot base.

    Attributes
    ----------
    angle_rad, radius_mm, height_mm : numpy.ndarray
        Coordinates, each (n,).
    """

    angle_rad: np.ndarray
    radius_mm: np.ndarray
    height_mm: np.ndarray


class Attitude(NamedTuple):
    """Flange orientation before the rotations.

    Attributes
    ----------
    reference : numpy.ndarray
        Rotation, shape (3, 3).
    frame : str
        Frame of ``reference``: ``SLICE`` (turns with the point about the base z axis) or ``BASE``.
    """

    reference: np.ndarray
    frame: str = SLICE


class Orientations(NamedTuple):
    """Flange rotations relative to the reference orientation.

    Attributes
    ----------
    rotation : numpy.ndarray
        Rotations, shape (m, 3, 3).
    names : tuple of str
        Their names (m,).
    """

    rotation: np.ndarray
    names: tuple[str, ...]


def contains(cylinder: Cylinder, position_mm: np.ndarray) -> np.ndarray:
    """Test whether positions lie in the cylinder, its faces included.

    Parameters
    ----------
    cylinder : Cylinder
        The sector.
    position_mm : numpy.ndarray
        Positions in the robot base, shape (..., 3).

    Returns
    -------
    numpy.ndarray
        Booleans, shape (...).
    """
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
    """Evenly spaced grid values over a span, both edges included.

    Parameters
    ----------
    first_mm, span_mm : float
        First value, and last minus first value.
    spacing_mm : float
        Largest distance between neighbours.

    Returns
    -------
    numpy.ndarray
        Values, shape (m,), mm.
    """
    steps = max(1, int(np.ceil(span_mm / spacing_mm - 1e-9)))
    return first_mm + span_mm * np.arange(steps + 1) / steps


def grid(cylinder: Cylinder, slices_rad: np.ndarray, spacing_mm: float) -> Cells:
    """Grid points of radial slices, edges included.

    Parameters
    ----------
    cylinder : Cylinder
        The sector.
    slices_rad : numpy.ndarray
        Angles of the slices, shape (m,).
    spacing_mm : float
        Largest distance between neighbours, in radius and height.

    Returns
    -------
    Cells
        Points by slice, then radius, then height.
    """
    radii = levels_mm(cylinder.inner_radius_mm, cylinder.radial_span_mm, spacing_mm)
    heights = levels_mm(cylinder.bottom_mm, cylinder.height_mm, spacing_mm)
    mesh = np.meshgrid(np.asarray(slices_rad, dtype=float), radii, heights, indexing="ij")
    return Cells(*(axis.ravel() for axis in mesh))


def fill(cylinder: Cylinder, unit: np.ndarray) -> Cells:
    """Map points of the unit cube evenly onto the volume of the cylinder.

    Parameters
    ----------
    cylinder : Cylinder
        The sector.
    unit : numpy.ndarray
        Points (radius, angle, height) of the unit cube, shape (n, 3).

    Returns
    -------
    Cells
        The n points.
    """
    inner_sq, outer_sq = cylinder.inner_radius_mm**2, cylinder.outer_radius_mm**2
    return Cells(
        cylinder.angle_min_rad + unit[:, 1] * (cylinder.angle_max_rad - cylinder.angle_min_rad),
        np.sqrt(inner_sq + unit[:, 0] * (outer_sq - inner_sq)),
        cylinder.bottom_mm + unit[:, 2] * cylinder.height_mm,
    )


def orientations(angle_rad: float, rotations: str) -> Orientations:
    """Rotations by +-angle about the flange's own X, then Y, then Z axis.

    Parameters
    ----------
    angle_rad : float
        The angle.
    rotations : str
        ``signs_and_zero``: the eight combinations of signs and no rotation. ``all_27``: every
        combination of minus, none and plus.

    Returns
    -------
    Orientations
        9 or 27 rotations, named like ``X+ Y- Z0``.
    """
    signs = (-1, 0, 1) if rotations == "all_27" else (-1, 1)
    combinations = list(product(signs, repeat=3))
    if rotations != "all_27":
        combinations.insert(0, (0, 0, 0))
    turns = reference_rotation(np.array(combinations, dtype=float) * angle_rad)
    names = (
        " ".join(f"{axis}{'-0+'[sign + 1]}" for axis, sign in zip("XYZ", row, strict=True))
        for row in combinations
    )
    return Orientations(turns, tuple(names))


def reference_rotation(euler_rad: np.ndarray) -> np.ndarray:
    """Rotation of intrinsic XYZ angles: the reference flange orientation.

    Parameters
    ----------
    euler_rad : numpy.ndarray
        Angles about x, y, z, shape (..., 3).

    Returns
    -------
    numpy.ndarray
        Rotation, shape (..., 3, 3).
    """
    x, y, z = np.moveaxis(euler_rad, -1, 0)
    return rotation_x(x) @ rotation_y(y) @ rotation_z(z)


def tool_poses(
    cells: Cells, reference: np.ndarray, relative: np.ndarray, frame: str = SLICE
) -> Pose:
    """Tool poses at cells of the cylinder.

    Parameters
    ----------
    cells : Cells
        n points.
    reference : numpy.ndarray
        Reference orientation in ``frame``, shape (3, 3).
    relative : numpy.ndarray
        Rotations relative to the reference, shape (n, 3, 3) or (3, 3).
    frame : str
        ``SLICE``: x outward, z up; orientation = Rz(angle) @ reference @ relative, so a pose keeps
        its place relative to the arm when the slice turns. ``BASE``: reference @ relative, so the
        tool keeps its attitude to a workpiece.

    Returns
    -------
    Pose
        Poses (n, ...) in the robot base, mm.
    """
    turn = rotation_z(cells.angle_rad if frame == SLICE else np.zeros_like(cells.angle_rad))
    rotation = turn @ reference @ relative
    cosine, sine = np.cos(cells.angle_rad), np.sin(cells.angle_rad)
    position = np.stack(
        [cells.radius_mm * cosine, cells.radius_mm * sine, cells.height_mm], axis=-1
    )
    return Pose(rotation, position)


def points(sequence: str, count: int, dimensions: int, first: int = 1) -> np.ndarray:
    """Consecutive points of an unscrambled low-discrepancy sequence; no seed enters.

    Parameters
    ----------
    sequence : str
        ``sobol`` (direction numbers of Joe and Kuo 2008) or ``halton`` (first primes).
    count, dimensions : int
        Numbers of points and of coordinates.
    first : int
        Index of the first point. Point 0 is the origin, a corner of every space.

    Returns
    -------
    numpy.ndarray
        Points of the unit cube, shape (count, dimensions).
    """
    if sequence == "halton":
        engine: qmc.QMCEngine = qmc.Halton(dimensions, scramble=False)
    else:
        engine = qmc.Sobol(dimensions, scramble=False, bits=30)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a number of points that is no power of two is meant
        return engine.fast_forward(first).random(count) if first else engine.random(count)

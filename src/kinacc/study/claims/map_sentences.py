"""Sentences of section IV-B about the accuracy maps (Fig. 3)."""

from __future__ import annotations

import math
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.spatial.distance import cdist

from kinacc.study.claims.claim import Claim, Tables, sentences

_JUMP_SHARE = 0.05  # the largest steps between neighbouring cells that count as discontinuities
_TOP_SHARE = 0.01  # the largest cells of a map
_OUTER_DEG = (0.0, 60.0)
_INNER_DEG = (15.0, 30.0, 45.0)
_QUANTITIES = {
    "position": ("position_max_mm", "worst_branch"),
    "orientation": ("orientation_max_mrad", "orientation_worst_branch"),
}


class _Slice(NamedTuple):
    """One heat map, (heights, radii); unreachable cells are NaN, their branch None."""

    angle_deg: float
    value: np.ndarray
    branch: np.ndarray
    solutions: np.ndarray

    def worst(self) -> np.ndarray:
        """Place of the largest value as fractions of the slice: (radius, height)."""
        place = np.array(np.unravel_index(np.nanargmax(self.value), self.value.shape))
        return (place / np.maximum(np.array(self.value.shape) - 1, 1))[::-1]


def map_claims() -> list[Claim]:
    """Claims about where the largest errors lie and where the maps break.

    They chose the reading of Fig. 3 (research, rule ``map_choice``).
    """
    return sentences(
        "map",
        {
            "map_nonlinear": _nonlinear,
            "map_largest_changes_location": _changes_location,
            "map_position_outer_reaches": _outer_reaches,
            "map_position_less_predictable_inside": _less_predictable_inside,
            "map_orientation_less_predictable": _orientation_less_predictable,
            "map_orientation_near_discontinuities": _near_discontinuities,
            "map_discontinuities_at_wrist_changes": _at_wrist_changes,
        },
    )


def _slices(tables: Tables, quantity: str, angles_deg: tuple[float, ...] = ()) -> list[_Slice]:
    columns = [*_QUANTITIES[quantity], "solutions"]
    names = ["slice_deg", "radius_mm", "height_mm", *columns]
    rows = pd.DataFrame({name: tables["accuracy_map"][name] for name in names})
    slices = []
    for angle, group in rows.groupby("slice_deg"):
        maps = group.pivot(index="height_mm", columns="radius_mm", values=columns)
        value, branch, solutions = (maps[name].to_numpy() for name in columns)
        value = value.astype(float)
        if np.isfinite(value).any() and (not angles_deg or angle in angles_deg):
            slices.append(_Slice(float(angle), value, branch, solutions))
    return slices


def _nonlinear(tables: Tables) -> float:
    def plane_share(heat_map: _Slice) -> float:
        """Share of the variance that a plane explains."""
        rows, columns = np.nonzero(np.isfinite(heat_map.value))
        values = heat_map.value[rows, columns]
        if values.size < 4 or np.ptp(values) == 0.0:
            return math.nan
        design = np.column_stack([np.ones_like(values), rows, columns])
        fitted = design @ np.linalg.lstsq(design, values, rcond=None)[0]
        return 1.0 - float(np.var(values - fitted) / np.var(values))

    return max(
        float(np.mean([plane_share(heat_map) for heat_map in _slices(tables, quantity)]))
        for quantity in _QUANTITIES
    )


def _distances(slices: list[_Slice]) -> list[float]:
    places = [heat_map.worst() for heat_map in slices]
    return [float(np.linalg.norm(a - b)) for a, b in combinations(places, 2)]


def _changes_location(tables: Tables) -> float:
    both = [value for name in _QUANTITIES for value in _distances(_slices(tables, name))]
    return min(both, default=math.nan)


def _outer_reaches(tables: Tables) -> float:
    slices = _slices(tables, "position", _OUTER_DEG)
    return min((float(heat_map.worst()[0]) for heat_map in slices), default=math.nan)


def _less_predictable_inside(tables: Tables) -> float:
    inside, outside = (
        _distances(_slices(tables, "position", angles)) for angles in (_INNER_DEG, _OUTER_DEG)
    )
    if not inside or not outside:
        return math.nan
    # Equal places at 0 and 60 deg are the most predictable there is: the ratio has no bound.
    return float(np.mean(inside)) / max(float(np.mean(outside)), 1e-9)


def _orientation_less_predictable(tables: Tables) -> float:
    position, orientation = (_distances(_slices(tables, name)) for name in _QUANTITIES)
    return float(np.mean(orientation) / np.mean(position)) if any(position) else math.nan


def _discontinuities(slices: list[_Slice]) -> np.ndarray:
    """Largest steps between neighbouring cells (n, 5): slice number, then row, column of both."""
    steps, sizes = [np.empty((0, 5), dtype=int)], [np.empty(0)]
    for number, heat_map in enumerate(slices):
        for axis in (0, 1):
            size = np.abs(np.diff(heat_map.value, axis=axis))
            cell = np.argwhere(np.isfinite(size))
            slice_number = np.full((len(cell), 1), number)
            steps.append(np.hstack([slice_number, cell, cell + np.eye(2, dtype=int)[axis]]))
            sizes.append(size[np.isfinite(size)])
    every, size = np.concatenate(steps), np.concatenate(sizes)
    order = np.lexsort((*every.T[::-1], -size))
    return every[order[: max(1, round(_JUMP_SHARE * len(size)))]]


def _near_discontinuities(tables: Tables) -> float:
    slices = _slices(tables, "orientation")
    jumps = _discontinuities(slices)
    distances, values = [], []
    for number, heat_map in enumerate(slices):
        broken = jumps[jumps[:, 0] == number, 1:].reshape(-1, 2)
        if len(broken):
            cells = np.argwhere(np.isfinite(heat_map.value))
            distances.append(cdist(cells, broken).min(axis=1))
            values.append(heat_map.value[tuple(cells.T)])
    if not values:
        return math.nan
    distance, value = np.concatenate(distances), np.concatenate(values)
    top = value >= np.quantile(value, 1.0 - _TOP_SHARE)
    typical = float(np.median(distance))
    # With half of all cells touching a discontinuity there is no "near" to speak of.
    return float(np.median(distance[top])) / typical if typical else math.nan


def _at_wrist_changes(tables: Tables) -> float:
    slices = _slices(tables, "orientation")

    def state(number: int, row: int, column: int) -> tuple[str, int]:
        """Wrist, the part of a branch name after its last comma, and combinations reached."""
        heat_map = slices[number]
        return heat_map.branch[row, column].rpartition(",")[2].strip(), heat_map.solutions[
            row, column
        ]

    jumps = _discontinuities(slices).tolist()
    changed = [state(number, *cells[:2]) != state(number, *cells[2:]) for number, *cells in jumps]
    return float(np.mean(changed)) if changed else math.nan

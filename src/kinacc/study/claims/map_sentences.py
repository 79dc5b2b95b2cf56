"""Sentences of section IV-B about the accuracy maps (Fig. 3)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.ndimage import distance_transform_edt
from scipy.spatial.distance import pdist

from kinacc.study.claims.claim import Claim, sentences
from kinacc.tables.columns import Tables

_JUMP_SHARE = 0.05  # the largest steps between neighbouring cells that count as discontinuities
_TOP_SHARE = 0.01  # the largest cells of a map
_OUTER_DEG = (0.0, 60.0)
_INNER_DEG = (15.0, 30.0, 45.0)
_QUANTITIES = {
    "position": ("position_max_mm", "worst_branch"),
    "orientation": ("orientation_max_mrad", "orientation_worst_branch"),
}


class _Maps(NamedTuple):
    """Heat maps (slices, heights, radii); unreachable cells are NaN, their branch None."""

    value: np.ndarray
    branch: np.ndarray
    solutions: np.ndarray

    def worst(self) -> np.ndarray:
        """Places (slices, 2) of the largest values as fractions of a slice: (height, radius)."""
        slices, *shape = self.value.shape
        place = np.zeros(0, int)
        if slices:
            place = np.nanargmax(self.value.reshape(slices, -1), axis=1)
        return np.transpose(np.unravel_index(place, shape)) / np.maximum(np.array(shape) - 1, 1)


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


def _maps(tables: Tables, quantity: str, angles_deg: tuple[float, ...] = ()) -> _Maps:
    """The maps of the slices at these angles, by default all, that have a value."""
    place, columns = ["slice_deg", "height_mm", "radius_mm"], [*_QUANTITIES[quantity], "solutions"]
    rows = pd.DataFrame({name: tables["accuracy_map"][name] for name in (*place, *columns)})
    rows = rows[rows["slice_deg"].isin(angles_deg or rows["slice_deg"])].sort_values(place)
    value, branch, solutions = (
        rows[name].to_numpy().reshape(rows[place].nunique().to_list()) for name in columns
    )
    reached = np.isfinite(value.astype(float)).any(axis=(1, 2))
    return _Maps(value.astype(float)[reached], branch[reached], solutions[reached])


def _nonlinear(tables: Tables) -> float:
    def plane_share(value: np.ndarray) -> float:
        """Share of the variance that a plane explains."""
        rows, columns = np.nonzero(np.isfinite(value))
        values = value[rows, columns]
        if values.size < 4 or np.ptp(values) == 0.0:
            return math.nan
        design = np.column_stack([np.ones_like(values), rows, columns])
        fitted = design @ np.linalg.lstsq(design, values, rcond=None)[0]
        return 1.0 - float(np.var(values - fitted) / np.var(values))

    return max(
        float(np.mean([plane_share(value) for value in _maps(tables, quantity).value]))
        for quantity in _QUANTITIES
    )


def _distances(tables: Tables, quantity: str, angles_deg: tuple[float, ...] = ()) -> np.ndarray:
    """Distances between the places of the largest values of every two slices."""
    places = _maps(tables, quantity, angles_deg).worst()
    return pdist(places) if len(places) > 1 else np.empty(0)


def _changes_location(tables: Tables) -> float:
    both = [_distances(tables, quantity) for quantity in _QUANTITIES]
    return float(min(np.concatenate(both), default=math.nan))


def _outer_reaches(tables: Tables) -> float:
    return float(min(_maps(tables, "position", _OUTER_DEG).worst()[:, 1], default=math.nan))


def _less_predictable_inside(tables: Tables) -> float:
    inside, outside = (_distances(tables, "position", deg) for deg in (_INNER_DEG, _OUTER_DEG))
    if not inside.size or not outside.size:
        return math.nan
    # Equal places at 0 and 60 deg are the most predictable there is: the ratio has no bound.
    return float(inside.mean()) / max(float(outside.mean()), 1e-9)


def _orientation_less_predictable(tables: Tables) -> float:
    position, orientation = (_distances(tables, quantity) for quantity in _QUANTITIES)
    return float(orientation.mean() / position.mean()) if position.any() else math.nan


def _discontinuities(value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cells (n, 3), (n, 3) on both sides of the largest steps: slice, row, column."""
    steps = []
    for axis in (1, 2):
        size = np.abs(np.diff(value, axis=axis))
        cell = np.argwhere(np.isfinite(size))
        steps.append(np.column_stack([size[tuple(cell.T)], cell, cell + np.eye(3)[axis]]))
    rows = np.concatenate(steps)
    rows = rows[np.argsort(-rows[:, 0], kind="stable")]
    cells = rows[: max(1, round(_JUMP_SHARE * len(rows))), 1:].astype(int)
    return cells[:, :3], cells[:, 3:]


def _near_discontinuities(tables: Tables) -> float:
    value = _maps(tables, "orientation").value
    broken = np.zeros(value.shape, bool)
    for cells in _discontinuities(value):
        broken[tuple(cells.T)] = True
    if not broken.any():
        return math.nan
    slices = broken.any(axis=(1, 2))
    finite = np.isfinite(value[slices])
    away = np.array([distance_transform_edt(~part) for part in broken[slices]])
    distance, values = away[finite], value[slices][finite]
    top = values >= np.quantile(values, 1.0 - _TOP_SHARE)
    typical = float(np.median(distance))
    # With half of all cells touching a discontinuity there is no "near" to speak of.
    return float(np.median(distance[top])) / typical if typical else math.nan


def _at_wrist_changes(tables: Tables) -> float:
    maps = _maps(tables, "orientation")
    sides = _discontinuities(maps.value)
    # The wrist is the part of a branch name after its last comma.
    wrists = [[name.rpartition(",")[2].strip() for name in maps.branch[tuple(s.T)]] for s in sides]
    reached = [maps.solutions[tuple(side.T)] for side in sides]
    changed = (np.array(wrists[0]) != np.array(wrists[1])) | (reached[0] != reached[1])
    return float(np.mean(changed)) if changed.size else math.nan

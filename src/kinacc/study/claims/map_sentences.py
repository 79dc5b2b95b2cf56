"""Sentences of section IV-B about the accuracy maps (Fig. 3).

They chose the reading of Fig. 3 (research, rule ``map_choice``).
"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from scipy.ndimage import distance_transform_edt
from scipy.spatial.distance import pdist

from kinacc.tables.columns import Columns

_JUMP_SHARE = 0.05  # the largest steps between neighbouring cells that count as discontinuities
_TOP_SHARE = 0.01  # the largest cells of a map
_OUTER_DEG = (0.0, 60.0)
_INNER_DEG = (15.0, 30.0, 45.0)
_PLACE = ["slice_deg", "height_mm", "radius_mm"]
_SHARES = ["height", "radius"]  # where a cell is in its slice, from 0 to 1
_POSITION, _ORIENTATION = "position_max_mm", "orientation_max_mrad"


def map_values(accuracy_map: Columns) -> dict[str, float]:
    """Values of the sentences about where the largest errors lie and where the maps break."""
    cells = pd.DataFrame(dict(accuracy_map)).sort_values(_PLACE, ignore_index=True)
    number = cells[_PLACE[1:]].rank(method="dense") - 1.0
    cells[_SHARES] = number / number.max().clip(lower=1.0)
    flat, worst = {}, {}
    for quantity in (_POSITION, _ORIENTATION):
        slices = cells.dropna(subset=quantity).groupby("slice_deg")
        flat[quantity] = float(np.mean([_plane_share(own, quantity) for _, own in slices]))
        worst[quantity] = cells.loc[slices[quantity].idxmax()].set_index("slice_deg")
    apart = {quantity: _distances(places) for quantity, places in worst.items()}
    outer = worst[_POSITION][worst[_POSITION].index.isin(_OUTER_DEG)]
    inner = worst[_POSITION][worst[_POSITION].index.isin(_INNER_DEG)]
    inside, outside = _distances(inner), _distances(outer)
    less_predictable = math.nan
    if inside.size and outside.size:
        # Equal places at 0 and 60 deg are the most predictable there is: the ratio has no bound.
        less_predictable = float(inside.mean()) / max(float(outside.mean()), 1e-9)
    of_orientation = math.nan
    if apart[_POSITION].any():
        of_orientation = float(apart[_ORIENTATION].mean() / apart[_POSITION].mean())
    jumps = _discontinuities(cells)
    return {
        "map_nonlinear": max(flat.values()),
        "map_largest_changes_location": min(np.concatenate([*apart.values()]), default=math.nan),
        "map_position_outer_reaches": float(outer["radius"].min()),
        "map_position_less_predictable_inside": less_predictable,
        "map_orientation_less_predictable": of_orientation,
        "map_orientation_near_discontinuities": _near_discontinuities(cells, jumps),
        "map_discontinuities_at_wrist_changes": _at_wrist_changes(cells, jumps),
    }


def _plane_share(cells: pd.DataFrame, quantity: str) -> float:
    """Share of the variance in a slice that a plane explains."""
    values = cells[quantity].to_numpy()
    if values.size < 4 or np.ptp(values) == 0.0:
        return math.nan
    design = np.column_stack([np.ones_like(values), cells[_SHARES]])
    fitted = design @ np.linalg.lstsq(design, values, rcond=None)[0]
    return 1.0 - float(np.var(values - fitted) / np.var(values))


def _distances(places: pd.DataFrame) -> np.ndarray:
    """Distances between every two places, as fractions of a slice."""
    return pdist(places[_SHARES]) if len(places) else np.empty(0)


def _discontinuities(cells: pd.DataFrame) -> np.ndarray:
    """Rows (n, 2) of the cells on both sides of the largest steps in orientation."""
    index = np.arange(len(cells)).reshape(cells[_PLACE].nunique().to_list())
    across = [index[:, :-1], index[:, 1:]], [index[:, :, :-1], index[:, :, 1:]]
    sides = np.concatenate([np.reshape(pair, (2, -1)).T for pair in across])
    step = np.abs(np.diff(cells[_ORIENTATION].to_numpy()[sides], axis=1))[:, 0]
    sides, step = sides[np.isfinite(step)], step[np.isfinite(step)]
    count = max(1, round(_JUMP_SHARE * len(step)))
    return sides[np.argsort(-step, kind="stable")[:count]]


def _near_discontinuities(cells: pd.DataFrame, jumps: np.ndarray) -> float:
    """Median distance of the largest cells to a discontinuity, over that of all cells."""
    if not len(jumps):
        return math.nan
    shape = cells[_PLACE].nunique().to_list()
    broken = np.zeros(len(cells), bool)
    broken[jumps] = True
    # A slice without a discontinuity is infinitely far from one, and is left out.
    parts = broken.reshape(shape)
    away = [np.where(part.any(), distance_transform_edt(~part), np.nan) for part in parts]
    known = cells.assign(away=np.ravel(away)).dropna(subset=["away", _ORIENTATION])
    top = known[known[_ORIENTATION] >= known[_ORIENTATION].quantile(1.0 - _TOP_SHARE)]
    typical = known["away"].median()
    # With half of all cells touching a discontinuity there is no "near" to speak of.
    return float(top["away"].median() / typical) if typical else math.nan


def _at_wrist_changes(cells: pd.DataFrame, jumps: np.ndarray) -> float:
    """Share of the discontinuities where the wrist or the number of solutions changes."""
    # The wrist is the part of a branch name after its last comma.
    wrist = cells["orientation_worst_branch"].str.rpartition(",")[2].str.strip().to_numpy()[jumps]
    solutions = cells["solutions"].to_numpy()[jumps]
    changed = (wrist[:, 0] != wrist[:, 1]) | (solutions[:, 0] != solutions[:, 1])
    return float(changed.mean()) if changed.size else math.nan

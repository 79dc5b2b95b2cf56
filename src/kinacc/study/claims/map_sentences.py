"""Sentences of section IV-B about the accuracy maps (Fig. 3)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from kinacc.study.claims.claim import Claim, Finding, Tables, above, below

_JUMP_SHARE = 0.05  # the largest steps between neighbouring cells that count as discontinuities
_TOP_SHARE = 0.01  # the largest cells of a map
_OUTER_DEG = (0.0, 60.0)
_INNER_DEG = (15.0, 30.0, 45.0)


@dataclass(frozen=True)
class _Slice:
    """One heat map, (heights, radii); unreachable cells are NaN, their branch None."""

    angle_deg: float
    value: np.ndarray
    branch: np.ndarray
    solutions: np.ndarray

    def worst(self) -> np.ndarray:
        """Place of the largest value as fractions of the slice: (radius, height)."""
        row, column = np.unravel_index(np.nanargmax(self.value), self.value.shape)
        heights, radii = self.value.shape
        return np.array([column / max(radii - 1, 1), row / max(heights - 1, 1)])


def map_claims() -> list[Claim]:
    """Claims about where the largest errors lie and where the maps break.

    They chose the reading of Fig. 3 (research, rule ``map_choice``).
    """
    evidence = ("accuracy_map",)
    return [
        Claim(
            "map_nonlinear",
            "The maximum position and orientation errors are highly nonlinear over the space",
            "largest share of a slice's variance that a plane in radius and height explains, mean "
            "over slices, position or orientation; holds below 0.5",
            evidence,
            _nonlinear,
            used_to_choose=True,
        ),
        Claim(
            "map_largest_changes_location",
            "The largest errors change their place from slice to slice",
            "smallest distance between the places of the maximum in two slices, as a fraction of "
            "the slice, position or orientation; holds above 0",
            evidence,
            _changes_location,
            used_to_choose=True,
        ),
        Claim(
            "map_position_outer_reaches",
            "The largest position errors at 0 and 60 deg occur toward the outer reaches",
            "smaller radius fraction of the largest position error in the two slices; "
            "holds above 2/3",
            evidence,
            _outer_reaches,
            used_to_choose=True,
        ),
        Claim(
            "map_position_less_predictable_inside",
            "Between 15 and 45 deg the largest position error is much less predictable",
            "mean distance between the places of the maximum at 15, 30 and 45 deg, over the "
            "distance between those at 0 and 60 deg; holds above 1",
            evidence,
            _less_predictable_inside,
            used_to_choose=True,
        ),
        Claim(
            "map_orientation_less_predictable",
            "The largest orientation errors are even more unpredictable than the position errors",
            "mean distance between the places of the maximum in two slices, orientation over "
            "position; holds above 1",
            evidence,
            _orientation_less_predictable,
            used_to_choose=True,
        ),
        Claim(
            "map_orientation_near_discontinuities",
            "The largest orientation errors tend to lie near discontinuities of the maps",
            "median distance of the largest 1 % of orientation cells to a discontinuity (one of "
            "the largest 5 % of steps between neighbours), over the median of all cells; "
            "holds below 1",
            evidence,
            _near_discontinuities,
            used_to_choose=True,
        ),
        Claim(
            "map_discontinuities_at_wrist_changes",
            "The discontinuities are primarily caused by changes of the wrist configuration",
            "share of the discontinuities of the orientation map (largest 5 % of steps between "
            "neighbours) across which the wrist configuration of the largest error, or the number "
            "of combinations reached, changes; holds above 0.5",
            evidence,
            _at_wrist_changes,
            used_to_choose=True,
        ),
    ]


def _slices(tables: Tables, quantity: str) -> list[_Slice]:
    rows = tables["accuracy_map"]
    position = quantity == "position"
    value_name = "position_max_mm" if position else "orientation_max_mrad"
    branch_name = "worst_branch" if position else "orientation_worst_branch"
    slices = []
    for angle in np.unique(rows["slice_deg"]):
        chosen = np.flatnonzero(rows["slice_deg"] == angle)
        radii, column = np.unique(rows["radius_mm"][chosen], return_inverse=True)
        heights, row = np.unique(rows["height_mm"][chosen], return_inverse=True)
        shape = heights.size, radii.size
        value, solutions = np.full(shape, math.nan), np.zeros(shape)
        branch = np.full(shape, None, dtype=object)
        value[row, column] = rows[value_name][chosen]
        branch[row, column] = rows[branch_name][chosen]
        solutions[row, column] = rows["solutions"][chosen]
        slices.append(_Slice(float(angle), value, branch, solutions))
    return [one for one in slices if np.isfinite(one.value).any()]


def _both(tables: Tables) -> list[list[_Slice]]:
    return [_slices(tables, quantity) for quantity in ("position", "orientation")]


def _plane_share(one: _Slice) -> float:
    rows, columns = np.nonzero(np.isfinite(one.value))
    values = one.value[rows, columns]
    if values.size < 4 or np.ptp(values) == 0.0:
        return math.nan
    design = np.column_stack([np.ones_like(values), rows, columns])
    fitted = design @ np.linalg.lstsq(design, values, rcond=None)[0]
    return 1.0 - float(np.var(values - fitted) / np.var(values))


def _nonlinear(tables: Tables) -> Finding:
    shares = [float(np.mean([_plane_share(one) for one in slices])) for slices in _both(tables)]
    return below(max(shares), 0.5)


def _distances(slices: list[_Slice]) -> list[float]:
    places = [one.worst() for one in slices]
    return [float(np.linalg.norm(a - b)) for a, b in combinations(places, 2)]


def _changes_location(tables: Tables) -> Finding:
    distances = [value for slices in _both(tables) for value in _distances(slices)]
    return above(min(distances, default=math.nan), 0.0)


def _at(slices: list[_Slice], angles_deg: tuple[float, ...]) -> list[_Slice]:
    return [one for one in slices if one.angle_deg in angles_deg]


def _outer_reaches(tables: Tables) -> Finding:
    slices = _at(_slices(tables, "position"), _OUTER_DEG)
    return above(min((float(one.worst()[0]) for one in slices), default=math.nan), 2.0 / 3.0)


def _less_predictable_inside(tables: Tables) -> Finding:
    slices = _slices(tables, "position")
    inside, outside = _distances(_at(slices, _INNER_DEG)), _distances(_at(slices, _OUTER_DEG))
    if not inside or not outside:
        return Finding(math.nan)
    # Equal places at 0 and 60 deg are the most predictable there is: the ratio has no bound.
    return above(float(np.mean(inside)) / max(float(np.mean(outside)), 1e-9), 1.0)


def _orientation_less_predictable(tables: Tables) -> Finding:
    position, orientation = (_distances(slices) for slices in _both(tables))
    if not position or not any(position):
        return Finding(math.nan)
    return above(float(np.mean(orientation) / np.mean(position)), 1.0)


def _steps(slices: list[_Slice]) -> list[tuple[float, int, tuple[int, int], tuple[int, int]]]:
    """Steps between neighbouring cells: size, slice number, and the two cells."""
    steps = []
    for number, one in enumerate(slices):
        heights, radii = one.value.shape
        for row in range(heights):
            for column in range(radii):
                for other in ((row + 1, column), (row, column + 1)):
                    if other[0] < heights and other[1] < radii:
                        size = abs(one.value[other] - one.value[row, column])
                        if not math.isnan(size):
                            steps.append((size, number, (row, column), other))
    return steps


def _discontinuities(slices: list[_Slice]):
    steps = sorted(_steps(slices), key=lambda step: (-step[0], step[1:]))
    return steps[: max(1, round(_JUMP_SHARE * len(steps)))] if steps else []


def _near_discontinuities(tables: Tables) -> Finding:
    slices = _slices(tables, "orientation")
    jumps = _discontinuities(slices)
    distances, values = [], []
    for number, one in enumerate(slices):
        broken = np.array([cell for jump in jumps if jump[1] == number for cell in jump[2:]])
        if not broken.size:
            continue
        cells = np.argwhere(np.isfinite(one.value))
        gaps = np.linalg.norm(cells[:, None, :] - broken[None, :, :], axis=2)
        distances.append(gaps.min(axis=1))
        values.append(one.value[cells[:, 0], cells[:, 1]])
    if not values:
        return Finding(math.nan)
    distance, value = np.concatenate(distances), np.concatenate(values)
    top = value >= np.quantile(value, 1.0 - _TOP_SHARE)
    typical = float(np.median(distance))
    # With half of all cells touching a discontinuity there is no "near" to speak of.
    return below(float(np.median(distance[top])) / typical, 1.0) if typical else Finding(math.nan)


def _at_wrist_changes(tables: Tables) -> Finding:
    slices = _slices(tables, "orientation")
    jumps = _discontinuities(slices)
    if not jumps:
        return Finding(math.nan)
    changed = [
        _wrist(slices[number].branch[a]) != _wrist(slices[number].branch[b])
        or slices[number].solutions[a] != slices[number].solutions[b]
        for _, number, a, b in jumps
    ]
    return above(float(np.mean(changed)), 0.5)


def _wrist(branch: str) -> str:
    """Wrist part of a branch name: everything after its last comma."""
    return branch.rsplit(",", 1)[-1].strip()

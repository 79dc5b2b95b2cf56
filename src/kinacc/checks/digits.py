"""What digits tell: readings not taken anew, joints on round numbers, the step of a column."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from decimal import Decimal

import numpy as np
import pandas as pd
import scipy
from numpy import ndarray

from kinacc.checks import robust_fit, tails
from kinacc.checks.findings import Finding, finding
from kinacc.checks.readings import Readings, grouped
from kinacc.checks.robust_fit import Fitted
from kinacc.errors import first_few
from kinacc.kinematics.robot import Robot

_CHANCE = 0.01  # expected number of coincidences above which equal readings tell nothing
_GRIDS_DEG = (1.0, 0.5, 0.1, 0.05, 0.01)
_FINER = 10.0  # a read-back value has digits well below the grid of a commanded one
_FEWEST = 3
_WORSE = 1.5  # times the median error of the other rows
_RANKED = 1e-3  # significance of that
_EXACT = 1e-6  # of the grid
_FITTED_AWAY = 0.3  # of the errors that rounding makes: what a fit of few poses leaves of them


def copies(every: Readings, noise_mm: float) -> Iterator[Finding]:
    """Rows equal to an earlier one in every joint and reading, or in every reading alone.

    Readings have a limited number of digits: where repeats scatter by ``noise_mm`` per axis (NaN
    if unknown) so little that equal digits are no surprise, there is no finding.
    """
    if not _unlikely(every, noise_mm):
        return
    names = every.row_names
    numbers = np.column_stack([every.position_mm, every.rotation.reshape(-1, 9)])
    by_target = pd.DataFrame(numbers).groupby([every.line, every.target]).first().unstack()
    line, reading = by_target.index.to_numpy(), by_target.to_numpy()
    q = every.q[np.unique(every.line, return_index=True)[1]]
    first = _first_alike(np.column_stack([q, reading]))
    again = np.flatnonzero(first != np.arange(len(line)))
    if again.size:
        of = int(line[first[again[0]]])
        yield finding(
            "duplicate_rows",
            line[again],
            count=again.size,
            row=names.one(of),
            first_copied_line=of,
        )
    first = _first_alike(reading)
    others = (np.abs(q - q[first]) > 1e-6).any(axis=1)
    if others.any():
        pairs = zip(line[others], line[first[others]], strict=True)
        texts = [f"{names.one(row)} repeats {names.number(of)}" for row, of in pairs]
        yield finding("repeated_reading", line[others], pairs=first_few(texts, 4))


def _first_alike(values: ndarray) -> ndarray:
    """Index (n,) of the first row of ``values`` (n, k) that is equal to each."""
    number = grouped(values)
    return np.unique(number, return_index=True)[1][number]


def _unlikely(every: Readings, noise_mm: float) -> bool:
    """Whether equal digits by chance are to be expected less than ``_CHANCE`` times."""
    if not noise_mm > 0.0:
        return True
    digit = np.diff(np.unique(np.round(every.position_mm, 9))).min(initial=np.inf)
    per_axis = min(digit / (2.0 * np.sqrt(np.pi) * noise_mm), 1.0)
    numbers = 3 * len(every.target_names) + 3 * bool(every.has_rotation.any())
    counts = np.unique(every.pose, return_counts=True)[1]
    pairs = float(np.sum(counts * (counts - 1) / 2)) / max(len(every.target_names), 1) ** 2
    return max(pairs, 1.0) * per_axis**numbers < _CHANCE


def commanded(fitted: Fitted, robot: Robot) -> Iterator[Finding]:
    """Joints as commanded where those read back are wanted.

    By the commanded joints, where the file has them too, else by round numbers.
    """
    observed = fitted.readings
    both = np.isfinite(observed.commanded).all(axis=1)
    if not both.any():
        yield from _round(fitted, np.rad2deg(observed.q[:, ~robot.dh.prismatic]))
        return
    joints = np.where(both[:, None], observed.commanded, observed.q)
    at_commanded = replace(observed, q_rad=robot.dh_joints(joints))
    sent = robust_fit.residuals(fitted.trial.arm, at_commanded).position_mm
    read = fitted.residuals.position_mm
    apart = np.linalg.norm(sent - read, axis=1)
    # What is apart everywhere (a following error of a few um) is how the arm is.
    usual = tails.limit(apart[both], 3)
    limit_mm = max(usual, fitted.limit_mm) if np.isfinite(usual) else fitted.limit_mm
    rows = np.flatnonzero(both & (apart > limit_mm))
    if rows.size:
        lines = observed.lines(rows)
        nearer = np.mean(np.linalg.norm(sent[rows], axis=1) < fitted.left_mm[rows]) > 0.5
        yield finding(
            "commanded_joints/apart",
            lines,
            count=len(lines),
            better="the commanded" if nearer else "those read back",
            largest_mm=float(apart[rows].max()),
        )


def _round(fitted: Fitted, q_deg: ndarray) -> Iterator[Finding]:
    """Rows on round numbers where the others are not, which fit worse; or all on a coarse grid."""
    q_deg = q_deg[:, np.ptp(q_deg, axis=0) > 0.0]
    remaining, observed = fitted.left_mm, fitted.readings
    if q_deg.shape[1] < 2:
        return
    for grid in _GRIDS_DEG:
        on, fine = _on(q_deg, grid), ~_on(q_deg, grid / _FINER)
        if len(np.unique(q_deg[on], axis=0)) < _FEWEST or fine.sum() < len(on) / 2:
            continue
        worse = float(np.median(remaining[on]) / np.median(remaining[fine]))
        test = scipy.stats.mannwhitneyu(remaining[on], remaining[fine], alternative="greater")
        if worse > _WORSE and test.pvalue < _RANKED:
            rows, times = observed.lines(on), f"{worse:.3g}"
            yield finding("commanded_joints", rows, grid_deg=grid, count=len(rows), times=times)
            return
    grid = next((item for item in _GRIDS_DEG[:4] if _on(q_deg, item).all()), 0.0)
    if grid:
        off = np.random.default_rng(0).uniform(-0.5, 0.5, observed.q_rad.shape) * np.deg2rad(grid)
        moved = replace(observed, q_rad=observed.q_rad + off * ~fitted.trial.arm.model.prismatic)
        there = robust_fit.residuals(fitted.trial.arm, moved).predicted.position_mm
        apart = there - fitted.residuals.predicted.position_mm
        rounding = float(np.median(np.linalg.norm(apart, axis=1)))
        error = float(np.median(remaining))
        if _FITTED_AWAY < error / rounding < 1.5:
            sizes = {"error": f"{error:.3g}", "rounding": f"{rounding:.3g}"}
            yield finding("commanded_joints/all", observed.lines(), grid_deg=grid, **sizes)


def _on(q_deg: ndarray, grid: float) -> ndarray:
    """True (n,) where all joints are whole multiples of ``grid``."""
    steps = q_deg / grid
    whole = np.abs(steps - np.round(steps)) < _EXACT * np.maximum(np.abs(steps), 1.0)
    return np.all(whole, axis=1)


def step(cells: Iterable[object], unit: float, decimal: str) -> float:
    """The largest step of which all numbers of a column are whole multiples away from each other.

    Parameters
    ----------
    cells
        Cells of the column.
    unit
        The unit of the file in the unit of the result.
    decimal
        The decimal mark.

    Returns
    -------
    float
        The last digit where all are equal; zero where a cell is no number.
    """
    texts = [str(cell).strip().replace("\u2212", "-").replace(decimal, ".") for cell in cells]
    try:
        last = min(int(Decimal(text).as_tuple().exponent) for text in texts)
        whole = [int(Decimal(text).scaleb(-last)) for text in texts]
    except (ArithmeticError, ValueError):
        return 0.0
    return unit * (math.gcd(*(number - whole[0] for number in whole)) or 1) * 10.0**last

"""Joints as commanded where joints as read back are wanted."""

from __future__ import annotations

import numpy as np

from kinacc.checks import robust_fit, tails
from kinacc.checks.findings import Finding, finding
from kinacc.checks.fitting import Fitted
from kinacc.checks.meanings import Meaning

_GRIDS_DEG = (1.0, 0.5, 0.1, 0.05, 0.01)
_FINER = 10.0  # a read-back value has digits well below the grid of a commanded one
_FEWEST = 3
_WORSE = 1.5  # times the median error of the other rows
_EXACT = 1e-6  # of the grid
_FITTED_AWAY = 0.3  # of the errors that rounding makes: what a fit of few poses leaves of them


def compared(
    fitted: Fitted, q: np.ndarray, commanded: np.ndarray, meaning: Meaning
) -> list[Finding]:
    """Rows in which commanded and read-back joints (n, k) part further than elsewhere.

    Judged by how far apart they put the target, against the errors of the fit.
    """
    both = np.isfinite(commanded).all(axis=1)
    if not both.any():
        return []
    seen, arm = fitted.seen, fitted.trial.arm
    places = []
    for joints in (q, np.where(both[:, None], commanded, q)):
        other = robust_fit.Seen(seen.cells, meaning.joints(joints), seen.base, seen.target)
        places.append(robust_fit.residuals(arm, other))
    apart = np.linalg.norm(places[1].position_mm - places[0].position_mm, axis=1)
    # What is apart everywhere (a following error of a few um) is how the arm is.
    usual = tails.limit(apart[both], 3) if (apart[both] > 0).any() else 0.0
    limit = max(usual if np.isfinite(usual) else 0.0, fitted.limit_mm)
    rows = np.flatnonzero(both & (apart > limit))
    suspicions = []
    if rows.size:
        error = np.linalg.norm(places[1].position_mm, axis=1)
        nearer = float(np.mean(error[rows] < fitted.left_mm[rows])) > 0.5
        lines = seen.cells.lines(rows)
        suspicions.append(
            finding(
                "commanded_joints/apart",
                lines,
                count=len(lines),
                better="the commanded" if nearer else "those read back",
                largest_mm=float(apart[rows].max()),
            )
        )
    every = robust_fit.sigma_of(places[1].position_mm[both])
    if every < 0.7 * robust_fit.sigma_of(places[0].position_mm[both]):
        lines = seen.cells.lines(both)
        suspicions.append(finding("commanded_joints/exchanged", lines, sigma=f"{every:.3g}"))
    return suspicions


def coarse(fitted: Fitted, q: np.ndarray, prismatic: np.ndarray) -> list[Finding]:
    """Rows whose joints are round numbers while the others' are not, and which fit worse."""
    q_deg = np.rad2deg(q[:, ~prismatic])
    moving = np.ptp(q_deg, axis=0) > 0.0
    if moving.sum() < 2:
        return []
    q_deg = q_deg[:, moving]
    for grid in _GRIDS_DEG:
        on = _on(q_deg, grid)
        fine = ~_on(q_deg, grid / _FINER)
        rows = np.flatnonzero(on)
        if len(np.unique(q_deg[rows], axis=0)) < _FEWEST or fine.sum() < len(on) / 2:
            continue
        worse = float(np.median(fitted.left_mm[on]) / np.median(fitted.left_mm[fine]))
        if worse > _WORSE and _ranked_worse(fitted.left_mm[on], fitted.left_mm[fine]):
            lines = fitted.seen.cells.lines(rows)
            times = f"{worse:.2g}"
            return [
                finding("commanded_joints", lines, grid_deg=grid, count=len(lines), times=times)
            ]
    return _all_coarse(fitted, q_deg)


def _all_coarse(fitted: Fitted, q_deg: np.ndarray) -> list[Finding]:
    """The whole file on a coarse grid, and errors as large as its rounding makes them."""
    for grid in _GRIDS_DEG[:4]:
        if not _on(q_deg, grid).all():
            continue
        rounding = _rounding_mm(fitted, np.deg2rad(grid))
        seen = float(np.sqrt(np.median(fitted.left_mm**2)))
        if _FITTED_AWAY < seen / rounding < 1.5:
            return [
                finding(
                    "commanded_joints/all",
                    fitted.seen.cells.lines(np.arange(len(q_deg))),
                    grid_deg=grid,
                    error=f"{seen:.3g}",
                    rounding=f"{rounding:.3g}",
                )
            ]
        break
    return []


def _rounding_mm(fitted: Fitted, grid_rad: float) -> float:
    """Median displacement of the target by joints rounded to ``grid_rad``."""
    rng = np.random.default_rng(0)
    seen, arm = fitted.seen, fitted.trial.arm
    off = rng.uniform(-0.5, 0.5, seen.q.shape) * grid_rad * ~arm.model.prismatic
    moved = robust_fit.Seen(seen.cells, seen.q + off, seen.base, seen.target)
    apart = (
        robust_fit.residuals(arm, moved).predicted.position_mm - fitted.left.predicted.position_mm
    )
    return float(np.median(np.linalg.norm(apart, axis=1)))


def _on(q_deg: np.ndarray, grid: float) -> np.ndarray:
    """True (n,) where all joints are whole multiples of ``grid``."""
    steps = q_deg / grid
    return (np.abs(steps - np.round(steps)) < _EXACT * np.maximum(np.abs(steps), 1.0)).all(axis=1)


def _ranked_worse(some: np.ndarray, others: np.ndarray) -> bool:
    """Whether ``some`` lie higher than ``others`` by Wilcoxon's rank sum, one in a thousand."""
    values = np.concatenate([some, others])
    ranks = np.argsort(np.argsort(values)) + 1.0
    expected = len(some) * (len(values) + 1) / 2.0
    spread = np.sqrt(len(some) * len(others) * (len(values) + 1) / 12.0)
    return bool(ranks[: len(some)].sum() - expected > 3.1 * spread)

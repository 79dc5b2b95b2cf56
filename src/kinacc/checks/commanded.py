"""Joints as commanded where joints as read back are wanted."""

from __future__ import annotations

import numpy as np

from kinacc.checks import robust_fit, tails
from kinacc.checks.changes import Meaning
from kinacc.checks.fitting import Fitted
from kinacc.checks.suspicion import Suspicion, suspicion

_GRIDS_DEG = (1.0, 0.5, 0.1, 0.05, 0.01)
_FINER = 10.0  # a read-back value has digits well below the grid of a commanded one
_FEWEST = 3
_WORSE = 1.5  # times the median error of the other rows
_EXACT = 1e-6  # of the grid
_FITTED_AWAY = 0.3  # of the errors that rounding makes: what a fit of few poses leaves of them


def compared(
    fitted: Fitted, q: np.ndarray, commanded: np.ndarray, meaning: Meaning
) -> list[Suspicion]:
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
        nearer = float(np.mean(error[rows] < fitted.left_mm[rows]))
        which = "the commanded" if nearer > 0.5 else "those read back"
        suspicions.append(
            suspicion(
                "commanded_joints",
                f"in {len(seen.cells.lines(rows))} rows the joints read back are not "
                f"those commanded, by up to {apart[rows].max():.3g} mm at the target; {which} fit "
                "better",
                seen.cells.lines(rows),
                "the arm was not where it was sent, or the two belong to different rows",
                largest_mm=float(apart[rows].max()),
            )
        )
    every = robust_fit.sigma_of(places[1].position_mm[both])
    if every < 0.7 * robust_fit.sigma_of(places[0].position_mm[both]):
        suspicions.append(
            suspicion(
                "commanded_joints",
                f"the commanded joints fit better than those read back ({every:.3g} mm per axis): "
                "the two may be exchanged",
                seen.cells.lines(both),
                "exchange the columns",
            )
        )
    return suspicions


def coarse(fitted: Fitted, q: np.ndarray, prismatic: np.ndarray) -> list[Suspicion]:
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
            return [
                suspicion(
                    "commanded_joints",
                    f"{len(fitted.seen.cells.lines(rows))} rows have joints on whole "
                    f"{grid:g} deg, which the others have not, and fit {worse:.2g} times worse: "
                    "commanded joints, not those read back",
                    fitted.seen.cells.lines(rows),
                    "take the joints read back",
                    grid_deg=grid,
                )
            ]
    return _all_coarse(fitted, q_deg)


def _all_coarse(fitted: Fitted, q_deg: np.ndarray) -> list[Suspicion]:
    """The whole file on a coarse grid, and errors as large as its rounding makes them."""
    for grid in _GRIDS_DEG[:4]:
        if not _on(q_deg, grid).all():
            continue
        rounding = _rounding_mm(fitted, np.deg2rad(grid))
        seen = float(np.sqrt(np.median(fitted.left_mm**2)))
        if _FITTED_AWAY < seen / rounding < 1.5:
            return [
                suspicion(
                    "commanded_joints",
                    f"all joints are on whole {grid:g} deg, and the errors of {seen:.3g} mm are "
                    f"what such rounding makes ({rounding:.3g} mm): commanded or rounded joints",
                    fitted.seen.cells.lines(np.arange(len(q_deg))),
                    "take the joints read back, with all their digits",
                    grid_deg=grid,
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

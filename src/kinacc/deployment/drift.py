"""A robot's history: has the arm changed since the calibration in force was made?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinacc.artifacts.columns import Columns
from kinacc.calibration.observations import Observations
from kinacc.calibration.summary import LARGE_SHARE
from kinacc.deployment.record import Calibration
from kinacc.measurements.folds import configurations

LEVEL = 0.05 / 12  # of a decision: monthly calibrations raise a false alarm in 1 year of 20
SAME, MOVED = "same", "moved"
FIRST, HOLDS, RECALIBRATE, OPEN = "first", "holds", "recalibrate", "cannot be told"
_TEXT = ("series", "date", "digest", "base", "tool", "model", "in_force", "verdict", "reason")


@dataclass(frozen=True)
class Session:
    """One line of a series: what was measured, and the calibration it gave.

    ``calibration``: the selected model of this line's data set, of its last session where it has
    several. ``observations``: all its rows in the order they were measured. ``held_out_mm`` (m,):
    position errors of that model at held-out rows, empty without folds. ``base``, ``tool``: SAME or
    MOVED since the line before (of the first: what is written there; it is not used).
    ``temperature_c``, ``bound_mm``, ``tolerance_mm``: NaN where not known.
    """

    name: str
    date: str
    digest: str
    base: str
    tool: str
    calibration: Calibration
    observations: Observations
    held_out_mm: np.ndarray
    temperature_c: float
    bound_mm: float
    tolerance_mm: float


def history(sessions: Sequence[Session], rotation_weight_mm_per_rad: float, seed: int) -> Columns:
    """The table ``history``: one row a session, in the order of their dates.

    The same whatever order they are given in; all chance follows from ``seed`` and the names.
    """
    rows, in_force = [], None
    for session in sorted(sessions, key=lambda each: each.date):
        row = _stated(session)
        if in_force is None:
            row |= {"verdict": FIRST}
        else:
            row |= {"in_force": in_force.name, "verdict": OPEN, "reason": "not computed yet"}
        if row["verdict"] in (FIRST, RECALIBRATE):
            in_force = session
        rows.append(row)
    return {
        name: np.array([row[name] for row in rows], dtype=object if name in _TEXT else None)
        for name in rows[0]
    }


def _stated(session: Session) -> dict:
    """What a row says of its session alone."""
    seen, held_out = session.observations, session.held_out_mm
    known = len(held_out) > 0
    return {
        "series": session.name,
        "date": session.date,
        "digest": session.digest,
        "base": session.base,
        "tool": session.tool,
        "rows": len(seen),
        "configurations": len(np.unique(configurations(seen.pose, seen.q_rad))),
        "temperature_c": session.temperature_c,
        "model": session.calibration.choice,
        "held_out_mean_mm": float(np.mean(held_out)) if known else np.nan,
        "held_out_quantile_99_mm": float(np.quantile(held_out, LARGE_SHARE)) if known else np.nan,
        "held_out_largest_mm": float(np.max(held_out)) if known else np.nan,
        "in_force": None,
        "in_force_mean_mm": np.nan,
        "in_force_quantile_99_mm": np.nan,
        "in_force_largest_mm": np.nan,
        "moved_mm": np.nan,
        "chance_mm": np.nan,
        "beyond_mm": np.nan,
        "probability": np.nan,
        "joint": np.nan,
        "bound_mm": session.bound_mm,
        "tolerance_mm": session.tolerance_mm,
        "verdict": OPEN,
        "reason": None,
    }


def factor(first: float, second: float) -> float:
    """On the deviations of misfit that is not shared, by what halves of both series showed."""
    return float(np.sqrt(max(1.0, 0.5 * (first + second))))

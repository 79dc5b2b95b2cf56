"""A robot's history by hand: monthly lines, some of which say that the arm has changed."""

from __future__ import annotations

import numpy as np

from kinacc.tables.allowed import FIRST, HOLDS, OPEN, RECALIBRATE
from kinacc.tables.contract import ARTEFACTS


def history(
    lines: int, changed: int | None = None, open_: int | None = None, **more: float
) -> dict[str, np.ndarray]:
    """The table of ``lines`` lines; those of the numbers given say recalibrate and cannot be told.

    ``more`` are columns that have the same number in every line.
    """
    months = np.datetime64("2026-01-15") + np.arange(lines) * np.timedelta64(30, "D")
    rng = np.random.default_rng(3)
    rows, in_force = [], ""
    for number, day in enumerate(map(str, months)):
        row = dict.fromkeys((each.name for each in ARTEFACTS["history"].columns), np.nan)
        held_out, moves = 0.3 + 0.01 * rng.normal(), number == changed
        row |= {"series": f"tracker-{day}", "date": day, "digest": "0" * 64, "model": "vec"}
        row |= {"base": "same", "tool": "same", "rows": 120, "configurations": 100}
        row |= {f"held_out_{k}_mm": v * held_out for k, v in _SHAPE.items()}
        row |= {"temperature_c": 21.0 + np.sin(number), "in_force": in_force or None}
        row |= {"verdict": HOLDS if number else FIRST, "reason": None}
        if not number:
            row |= {"base": None, "tool": None}
        elif number == open_:
            row |= {"verdict": OPEN, "reason": "too few poses"}
        else:
            row |= {f"in_force_{k}_mm": (1.05 + moves) * row[f"held_out_{k}_mm"] for k in _SHAPE}
            row |= {"chance_mm": 0.15, "moved_mm": 0.45 if moves else 0.08, "probability": 0.3}
            row |= {"beyond_mm": 0.3 if moves else 0.0}
        if moves:
            row |= {"verdict": RECALIBRATE, "joint": 4, "probability": 0.0004}
        in_force = row["series"] if row["verdict"] in (FIRST, RECALIBRATE) else in_force
        rows.append(row | more)
    return {
        each.name: np.array(
            [row[each.name] for row in rows], dtype=object if each.kind == "text" else float
        )
        for each in ARTEFACTS["history"].columns
    }


_SHAPE = {"mean": 1.0, "quantile_99": 2.2, "largest": 2.7}

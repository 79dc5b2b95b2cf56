"""What the history of an arm says, in one sentence: pages, commands and gates share it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinacc.tables.allowed import FIRST, HOLDS, RECALIBRATE


def sentence(history: Mapping, row: int = -1) -> str:
    """What a row of ``history.parquet`` says of the calibration in force, the last by default."""
    verdict = history["verdict"][row]
    if verdict == FIRST:
        return "the first line of its series: the next one will say whether its calibration holds"
    day = _day(history, history["in_force"][row])
    if verdict == RECALIBRATE:
        joint = float(history["joint"][row])
        most = "" if np.isnan(joint) else f", joint {joint:.0f}"
        what = f"{float(history['beyond_mm'][row]):.2f} mm beyond chance"
        return f"recalibrate: {what}{most}, since the calibration of {day}"
    if verdict == HOLDS:
        moved, chance = (float(history[name][row]) for name in ("moved_mm", "chance_mm"))
        seen = f": {moved:.2f} mm moved, where chance shows up to {chance:.2f} mm"
        return f"the last calibration still holds, that of {day}{'' if np.isnan(moved) else seen}"
    reason = f": {why}" if (why := history["reason"][row]) else ""
    return f"whether the calibration of {day} still holds cannot be told{reason}"


def _day(history: Mapping, series: object) -> str:
    """The date of a line by the name of its data set."""
    found = np.flatnonzero(np.asarray(history["series"]) == series)
    return str(history["date"][found[0]]) if len(found) else str(series)

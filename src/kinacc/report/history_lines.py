"""What the history of an arm says, in one sentence: pages, commands and gates share it."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from kinacc.report.rendering import lines


def sentence(history: Mapping, row: int = -1) -> str:
    """What a row of ``history.parquet`` says of the calibration in force.

    Parameters
    ----------
    history
        The table, by column.
    row
        Number of the row, the last by default.

    Returns
    -------
    str
        The verdict with its evidence (mm), without a full stop.
    """
    table = pd.DataFrame(dict(history))
    line = table.iloc[row]
    dates = dict(zip(table["series"], table["date"], strict=True))
    day = dates.get(line["in_force"], line["in_force"])
    return lines("history.txt", row=line, day=day)[0]

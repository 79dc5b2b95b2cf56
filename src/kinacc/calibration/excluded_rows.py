"""How far off the rows are that the configuration excludes: no fit has seen them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinacc.calibration.delivered import delivered_fits
from kinacc.calibration.observations import from_columns
from kinacc.calibration.residuals import Errors, errors
from kinacc.config.error_models import comparisons
from kinacc.kinematics import robot
from kinacc.measurements.reader import UNCERTAINTY, excluded_lines, read_excluded
from kinacc.measurements.row_names import RowNames
from kinacc.tables.columns import Columns
from kinacc.tables.contract import ARTEFACTS, columns_of

_STATED = tuple(
    column.name for column in ARTEFACTS["excluded_rows"].columns if not column.may_be_absent
)


def run(inputs: Mapping, settings: Mapping) -> dict[str, Columns]:
    """Errors of the delivered models at the rows left out, with the reasons.

    Parameters
    ----------
    inputs : mapping
        Tables ``measurements``, of models and of frames.
    settings : mapping
        Sections ``robot`` and ``measurements`` of the configuration.

    Returns
    -------
    dict
        ``excluded_rows``: errors in mm and mrad in the robot base, null where a row cannot be read
        or
        where its target or session stands nowhere else.
    """
    arm, section = robot.load(settings["robot"]), settings["measurements"]["file"]
    reasons = excluded_lines(section)
    used = inputs["measurements"]
    every = from_columns(used, arm)
    fits = delivered_fits(inputs, arm, every)
    reading, _ = read_excluded(section, arm)
    rows: list[tuple] = []
    if reading is not None:
        left_out = _known(reading.columns, used)
        count = len(left_out["pose"])
        joined = {
            name: np.concatenate([np.asarray(used[name]), left_out[name]])
            for name in left_out
            if name in used
        }
        joined["fold"] = np.full(len(joined["pose"]), np.nan)
        of_models = errors(fits, from_columns(joined, arm).select(slice(len(every), None)))
        lines = left_out["row"].astype(int).tolist()
        for name, errors_of in of_models.items():
            rows += _rows(name, left_out, lines, reasons, errors_of, count)
    told = {row[1] for row in rows}
    for comparison in comparisons(fits):
        rows += [
            (comparison.name, line, None, None, reasons[line], *[np.nan] * 6)
            for line in sorted(set(reasons) - told)
        ]
    columns = columns_of("excluded_rows", [dict(zip(_STATED, row, strict=True)) for row in rows])
    names = RowNames() if reading is None else reading.row_names
    return {"excluded_rows": columns | names.columns(columns["line"])}


def _known(columns: Mapping, used: Mapping) -> Columns:
    """The rows whose target and session other rows show as well: only these have frames."""
    there = np.isin(columns["target"].astype(str), np.asarray(used["target"]).astype(str))
    there &= np.isin(columns["session"].astype(str), np.asarray(used["session"]).astype(str))
    return {
        name: np.asarray(values)[there]
        for name, values in columns.items()
        if name not in UNCERTAINTY
    }


def _rows(
    name: str, columns: Mapping, lines: list, reasons: Mapping, errors_of: Errors, count: int
):
    return [
        (
            name,
            lines[i],
            columns["target"][i],
            columns["session"][i],
            reasons[lines[i]],
            *errors_of.position_mm[i],
            *(1e3 * errors_of.rotation_rad[i]),
        )
        for i in range(count)
    ]

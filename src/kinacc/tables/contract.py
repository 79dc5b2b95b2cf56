"""Every table kinacc leaves behind, as data: columns, units, meaning, limits and row keys.

Import costs nothing but the standard library: the configuration, the stages, the documentation and
the check of a finished results folder all read this one description.

A column named with an asterisk (``q*``) stands for one column per joint: ``q1`` .. ``qk``.
A value that does not apply is null, never zero. After a change run
``python tools/document_artifacts.py``, which rewrites docs/artifacts.md.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from kinacc.tables import (
    assessment_tables,
    calibration_tables,
    campaign_tables,
    data_check_tables,
    history_tables,
    model_comparison_tables,
    robot_table,
    summary_table,
)
from kinacc.tables.columns import Artefact, Columns, joint_count, texts

# What all tables of a stage are marked with.
PROVENANCE_KEYS = ("kinacc_version", "config_hash", "seed")

ARTEFACTS: dict[str, Artefact] = {
    artefact.name: artefact
    for artefact in (
        *calibration_tables.ALL,
        robot_table.ROBOT,
        data_check_tables.DATA_CHECK,
        data_check_tables.EXCLUDED_ROWS,
        model_comparison_tables.MODEL_SELECTION,
        model_comparison_tables.JOINT_BIAS,
        model_comparison_tables.WORST_ROWS,
        summary_table.SUMMARY,
        history_tables.HISTORY,
        *assessment_tables.ALL,
        *campaign_tables.ALL,
    )
}


def columns_of(artefact: str, rows: Iterable[Mapping[str, Any] | Sequence[Any]]) -> Columns:
    """Rows as columns of an artefact; None in a column of numbers is NaN.

    A row holds its values by column name, or one after the other as the contract has its columns.
    Whole numbers that may be null are held as floats. Without rows the columns are empty.
    """
    import numpy as np

    given: list[Any] = list(rows)
    contract = ARTEFACTS[artefact]
    if given and isinstance(given[0], Mapping):
        names = list(given[0])
        given = [[row[name] for name in names] for row in given]
    else:
        names = [column.name for column in contract.columns]
    known = {column.name: column for column in contract.for_joints(joint_count(contract, names))}
    kinds = {"float": np.float64, "int": np.int64, "int8": np.int8, "bool": np.bool_}
    columns: Columns = {}
    for place, name in enumerate(names):
        kind, cells = known[name].kind, [row[place] for row in given]
        if kind == "text":
            columns[name] = texts(cells)
        else:
            columns[name] = np.array(cells, kinds["float" if known[name].nullable else kind])
    return columns

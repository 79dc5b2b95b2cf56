"""Every table kinacc leaves behind: columns, units, meaning, limits and row keys.

They stand in ``schemas/<topic>.yaml``; the stages, the documentation and the check of a finished
results folder all read this one description. A column named with an asterisk (``q*``) stands for
one column per joint: ``q1`` .. ``qk``. A value that does not apply is null, never zero. Names of
lists as ``choices`` are those of ``allowed.py``; a column that may be ``absent`` is in a file only
where a table states it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from kinacc.tables import allowed
from kinacc.tables.columns import Artefact, Column, Columns, texts

# What all tables of a stage are marked with.
PROVENANCE_KEYS = ("kinacc_version", "config_hash", "seed")
TOPICS = ("calibration", "history", "assessment", "campaign")
_UNITS = {"text": "", "int": "1", "int8": "1", "bool": "1"}
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def _column(name: str, details: dict[str, Any]) -> Column:
    kind, choices = details.pop("kind", "float"), details.pop("choices", ())
    choices = getattr(allowed, choices) if isinstance(choices, str) else tuple(choices)
    absent = details.pop("absent", False)
    details["optional"] = details.get("optional", absent)
    details["nullable"] = details.get("nullable", details["optional"])
    unit = details.pop("unit", None) or _UNITS[kind]
    return Column(name, kind, unit, may_be_absent=absent, choices=choices, **details)


def _artefacts(topic: str) -> Iterable[Artefact]:
    path = Path(__file__).parent / "schemas" / f"{topic}.yaml"
    for name, details in yaml.load(path.read_text(encoding="utf-8"), Loader=_LOADER).items():  # noqa: S506
        columns = tuple(_column(*item) for item in details.pop("columns").items())
        yield Artefact(name, topic, columns=columns, key=tuple(details.pop("key")), **details)


ARTEFACTS = {item.name: item for topic in TOPICS for item in _artefacts(topic)}


def columns_of(artefact: str, rows: Iterable[Mapping[str, Any] | Sequence[Any]]) -> Columns:
    """Rows as columns of an artefact; None in a column of numbers is NaN.

    Parameters
    ----------
    artefact
        Name of the table.
    rows
        Values by column name, or one after the other as the contract has its columns.

    Returns
    -------
    dict
        Arrays (n,) by column; whole numbers that may be null are floats. Empty without rows.
    """
    contract, kinds = ARTEFACTS[artefact], {"int": np.int64, "int8": np.int8, "bool": np.bool_}
    names = [column.name for column in contract.columns]
    records = [row if isinstance(row, Mapping) else dict(zip(names, row, strict=True))
               for row in rows]  # fmt: skip
    names = [*records[0]] if records else names
    known = {column.name: column for column in contract.in_file(names)}
    columns: Columns = {}
    for name in names:
        cells, column = [record[name] for record in records], known[name]
        kind = np.float64 if column.nullable else kinds.get(column.kind, np.float64)
        columns[name] = texts(cells) if column.kind == "text" else np.array(cells, kind)
    return columns


def columns_from(artefact: str, table: pd.DataFrame) -> Columns:
    """Columns of an artefact, of a table that may have more."""
    names = [column.name for column in ARTEFACTS[artefact].columns if column.name in table]
    return {name: table[name].to_numpy() for name in names}

"""A table as the run of its stage leaves it: with a record beside it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from kinacc.artifacts import records, store
from kinacc.workflow.catalogue import maker_of

# Marks of a table that was made from nothing.
MARKS = {
    "kinacc_version": "0",
    "config_hash": "c",
    "code_hash": "d",
    "inputs_hash": "i",
    "seed": 1,
}


def write(path: Path, artefact: str, columns: Mapping, marks: Mapping) -> None:
    """Write the one table of a stage, made from nothing, and the stage's record."""
    table = store.to_table(artefact, columns, marks)
    digest = table.schema.metadata[store.COLUMNS_DIGEST.encode()].decode()
    stage = maker_of(artefact).name
    told = {key: str(marks[key]) for key in store.PROVENANCE_KEYS}
    records.leave(
        records.place(path.parent, stage),
        records.Record(stage, None, told, {}, {}),
        {str(path): (store.content_of(table), digest)},
    )

"""What was measured, as tables ``benchmarks/results/<topic>.parquet``: a row a contender."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from harness import Result

RESULTS = Path(__file__).resolve().parent / "results"
KINDS = {"int": pa.int64(), "float": pa.float64(), "str": pa.string(), "bool": pa.bool_()}


def table(
    rows: Sequence[Result] | Sequence[Mapping], facts: Mapping[str, str | int | float]
) -> pa.Table:
    """Rows with the machine's facts beside each, so that tables of machines can be joined.

    Columns of contenders have the kind their record states, however few of them hold a number.
    """
    if isinstance(rows[0], Result):
        kinds = {each.name: KINDS[each.type.partition(" ")[0]] for each in fields(Result)}
        plain = pa.Table.from_pylist([asdict(row) for row in rows], pa.schema(kinds.items()))
    else:
        plain = pa.Table.from_pylist(list(rows))
    for name, value in facts.items():
        plain = plain.append_column(name, pa.array([value] * len(rows)))
    return plain


def write(found: pa.Table, topic: str, folder: Path = RESULTS) -> Path:
    """The table of one topic, replaced."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{topic}.parquet"
    pq.write_table(found, path, compression="zstd")
    return path

"""Tables put in the place of others, with or without every digest renewed."""

from __future__ import annotations

from pathlib import Path

import corruptions
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from worlds import World

from kinacc.artifacts import store


def put(world: World, dataset: str, artefact: str, other: Path, renewed: bool) -> None:
    """A table of another run; with its own marks, or with ours and every digest renewed."""
    if not renewed:
        _path(world, dataset, artefact).write_bytes(other.read_bytes())
        return
    before = pq.read_table(_path(world, dataset, artefact))
    table = pq.read_table(other).replace_schema_metadata(before.schema.metadata)
    write(world, dataset, artefact, table, renewed)


def put_edited(world: World, dataset: str, artefact: str, renewed: bool, draw: int) -> None:
    """The table with one number of a millimetre, milliradian or radian column changed by 1 %."""
    table = pq.read_table(_path(world, dataset, artefact))
    generator = np.random.default_rng(draw)
    fields = [
        place
        for place, each in enumerate(table.schema)
        if str(each.type) == "double" and not each.name.startswith("std_")
    ]
    for place in generator.permutation(fields).tolist():
        values = table.column(place).to_pylist()
        rows = [row for row, value in enumerate(values) if value and np.isfinite(value)]
        if rows:
            row = rows[int(generator.integers(len(rows)))]
            values[row] = values[row] * 1.01 + 0.001
            column = pa.array(values, table.schema.field(place).type)
            table = table.set_column(place, table.schema.field(place), column)
            write(world, dataset, artefact, table, renewed)
            return
    raise ValueError(f"{artefact} has no number to be changed")


def _path(world: World, dataset: str, artefact: str) -> Path:
    return world.results / dataset / f"{artefact}.parquet"


def write(world: World, dataset: str, artefact: str, table: pa.Table, renewed: bool) -> None:
    """Put a table in its place; ``renewed``: every digest of it and of what is made from it."""
    name = f"{dataset}/{artefact}.parquet"
    if not renewed:
        (world.results / name).write_bytes(store.content_of(table))
        return
    files = {
        path.relative_to(world.results).as_posix(): path.read_bytes()
        for path in sorted(world.results.rglob("*"))
        if path.is_file() and "logs" not in path.parts
    }
    content = store.content_of(corruptions.signed(table))
    for each, new in corruptions.renewed(world.results, files, dataset, name, content).items():
        (world.results / each).write_bytes(new)

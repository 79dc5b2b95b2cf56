"""What a stage reads: held to the digests and records its makers left, before anything uses it."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from kinacc.artifacts import provenance, records
from kinacc.errors import InputError, Problem, gathered, refuse
from kinacc.workflow.catalogue import STAGES, maker_of

if TYPE_CHECKING:
    import pyarrow as pa

Paths = Mapping[str, str | Sequence[str]]


class Inputs(NamedTuple):
    """Inputs by role: their tables (other files as paths), and the digest of what each says."""

    tables: dict[str, object]
    digests: dict[str, str]


def read_inputs(paths: Paths, remake: str = "") -> Inputs:
    """Columns of every table, scattered ones joined in order, other files as paths, and digests.

    Every table is held to the checksums of its pages, to the digest of its columns and, byte by
    byte, to the record of the stage that made it; tables from before there were digests have none
    of these. Raises InputError naming every file that does not fit, and the command that makes it
    again: ``remake``, with places for {stage}, {dataset}, {file} and {target}, as far as known.
    """
    from kinacc.artifacts.store import columns_in

    found, problems = Inputs({}, {}), list[Problem]()
    known: dict[str, records.Record | None] = {}
    for role, given in paths.items():
        if _is_file(role):
            found.tables[role] = Path(str(given))
            found.digests[role] = provenance.file_hash(str(given))
            continue
        with gathered(problems):
            parts = [_verified(role, path, known, remake) for path in _listed(given)]
            table = parts[0] if isinstance(given, str) else _joined(role, given, parts)
            found.digests[role] = _digest(role, table, given)
            found.tables[role] = columns_in(table)
    refuse(problems)
    return found


def digests(paths: Paths) -> dict[str, str]:
    """Digests of inputs by role, as tables that are there state them; see :func:`read_inputs`.

    Raises InputError where parts of one artefact come from different states.
    """
    from kinacc.artifacts.store import read_table

    found = {}
    for role, given in paths.items():
        if _is_file(role):
            found[role] = provenance.file_hash(str(given))
        elif isinstance(given, str):
            found[role] = _stated(given, os.stat(given).st_mtime_ns)
        else:
            table = _joined(role, given, [read_table(path) for path in given])
            found[role] = _digest(role, table, given)
    return found


def _again(remake: str, stage: str, dataset: str, file: str) -> str:
    """What to do about a file that is not as its stage left it."""
    if not remake:
        from kinacc.artifacts import store

        return store.remake(file)
    # What is made on request alone is no target of the workflow unless it is named.
    target = f" -- {shlex.quote(file)}" if STAGES[stage].on_request else ""
    words = {"{stage}": stage, "{dataset}": dataset, "{file}": file}
    words = {place: shlex.quote(word) for place, word in words.items()} | {"{target}": target}
    return "make it again: " + re.sub("|".join(words), lambda found: words[found[0]], remake)


def _is_file(role: str) -> bool:
    return role.endswith("_file")


def _listed(given: str | Sequence[str]) -> Sequence[str]:
    return [given] if isinstance(given, str) else given


@cache
def _stated(path: str, changed_ns: int) -> str:
    """Digest of a table's columns, as it says itself where it is of this version."""
    from kinacc.artifacts import store

    return store.stated_digest(path) or store.columns_digest(store.read_table(path))


def _verified(
    role: str, path: str, known: dict[str, records.Record | None], remake: str
) -> pa.Table:
    """The table in a file that is as its maker left it."""
    from kinacc.artifacts import store

    artefact, file = role.rpartition("/")[2], Path(path)
    is_part = file.parent.name == artefact
    folder, stage = file.parent.parent if is_part else file.parent, maker_of(artefact).name
    place = records.place(folder, stage, file.stem if is_part else None)
    try:
        content = file.read_bytes()
        table = store.read_table(path, content)
        if place not in known:
            known[place] = records.read(place) if os.path.exists(place) else None
        record, stated = known[place], store.COLUMNS_DIGEST.encode()
        if record is not None:
            refuse(records.misfit(place, record, path, content))
        elif stated in (table.schema.metadata or {}):
            what = f"has no record: {place} is lost, or its run did not come to its end"
            raise InputError(Problem(path, what))
        store.verified_digest(table, path)
    except FileNotFoundError:
        raise InputError(Problem(path, "no such file")) from None
    except InputError as error:
        fix = _again(remake, stage, folder.name, path)
        raise InputError([replace(each, fix=fix) for each in error.problems]) from None
    return table


def _joined(role: str, paths: Sequence[str], parts: Sequence[pa.Table]) -> pa.Table:
    """Parts of one artefact as one table; InputError where they come from different states."""
    import pyarrow as pa

    from kinacc.artifacts import store

    own = store.COLUMNS_DIGEST.encode()
    marks = [dict(part.schema.metadata or {}) for part in parts]
    origins = {tuple(sorted((k, v) for k, v in each.items() if k != own)) for each in marks}
    if len(origins) != 1:
        raise InputError(
            Problem(
                ", ".join(paths),
                f"parts of {role} made from {len(origins)} different states",
                "parts of one run",
                store.remake(paths[0]),
            )
        )
    key = store.artefact_named(role.rpartition("/")[2]).key
    lacking = [name for name in key for part in parts if name not in part.schema.names]
    if lacking or any(not part.schema.equals(parts[0].schema) for part in parts):
        what = f"parts of {role} with different columns"
        raise InputError(
            Problem(", ".join(paths), what, "parts of one run", store.remake(paths[0]))
        )
    return pa.concat_tables(parts)


def _digest(role: str, table: pa.Table, given: str | Sequence[str]) -> str:
    """Digest of a table; of parts that of the whole in the order of its key.

    In how many parts the rows were computed, and so in which order they come, does not count.
    """
    from kinacc.artifacts.store import artefact_named, columns_digest

    if not isinstance(given, str):
        key = artefact_named(role.rpartition("/")[2]).key
        table = table.sort_by([(name, "ascending") for name in key])
    return columns_digest(table)

"""One table for ``kinacc show``: its columns with units and meanings, rows and columns chosen."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kinacc.calibration.misfit import in_words
from kinacc.cli.output import plain
from kinacc.cli.screen import decimals_of, number
from kinacc.cli.sheet import Field, Sheet
from kinacc.config.error_models import ERROR_MODELS
from kinacc.config.values import nearest
from kinacc.deployment.folder import misfit_of
from kinacc.errors import InputError, Problem, first_few, refuse
from kinacc.tables import store
from kinacc.tables.columns import SLIDES, Artefact, joint_count, texts
from kinacc.tables.contract import ARTEFACTS

if TYPE_CHECKING:
    import pyarrow as pa

_NO_VALUE = "-"
_FEW = 4


@dataclass(frozen=True)
class Shown:
    """A table as read, or a choice of its rows and columns.

    ``artefact`` is the contract it keeps, None where it keeps none, ``remarks`` what is to be said
    of that; ``provenance`` what the file says of how it was made.
    """

    path: Path
    artefact: Artefact | None
    sheet: Sheet
    provenance: Mapping[str, str]
    remarks: tuple[str, ...] = ()


def contract_of(path: Path) -> Artefact | None:
    """The artefact that a file is by its name, a part of one included."""
    is_part = re.fullmatch(r"\d+-of-\d+", path.stem) and path.stem not in ARTEFACTS
    return ARTEFACTS.get(path.parent.name if is_part else path.stem)


def read(path: Path) -> Shown:
    """A Parquet file, of kinacc or not. Raises InputError where it is none, or damaged."""
    artefact = contract_of(path)
    try:
        columns, schema = store.read(path, artefact is None), store.read_schema(path)
    except InputError as error:
        if artefact is not None and path.suffix == ".parquet":
            raise
        raise InputError(_no_table(path, error)) from None
    if twice := sorted({name for name in schema.names if schema.names.count(name) > 1}):
        raise InputError(Problem(str(path), f"has several columns called {first_few(twice)}"))
    remarks: tuple[str, ...] = ()
    if artefact is not None and (differs := _differing(artefact, schema.names)):
        remarks = (f"this is no table {artefact.name} as kinacc makes it: {differs}",)
        artefact = None
    elif artefact is None:
        told = any(b"meaning" in (each.metadata or {}) for each in schema)
        own = "units and meanings are what the file says" if told else "nothing says its units"
        remarks = (f"no table of a results folder has this name; {own}",)
    fields = _fields(schema, columns, artefact, path.parent)
    metadata = {key.decode(errors="replace"): value.decode(errors="replace")
                for key, value in (schema.metadata or {}).items()}  # fmt: skip
    facts = {"table": str(path), "meaning": artefact.meaning if artefact else None}
    model = artefact.name.partition("_")[0] if artefact else ""
    if model in ERROR_MODELS and any(each.startswith("std") for each in schema.names):
        known = misfit_of(path.parent, model)
        facts["standard_deviations"] = known.as_facts()
        remarks = (f"Standard deviations are {in_words([known])}.",)
    count = len(next(iter(columns.values()), ()))
    title = f"{path}: {_counted(count, 'row')}, {_counted(len(fields), 'column')}"
    return Shown(path, artefact, Sheet(title, facts, fields, with_units=True), metadata, remarks)


def where(shown: Shown, conditions: Iterable[str]) -> Shown:
    """The rows that meet every COLUMN=VALUE. InputError for one that no row can meet, or none."""
    fields = {each.name: each for each in shown.sheet.fields}
    count = len(shown.sheet)
    kept, problems = np.ones(count, dtype=bool), []
    given = list(conditions)
    for condition in given:
        name, mark, value = (each.strip() for each in condition.partition("="))
        place = f"--where {condition}"
        if not mark:
            problems.append(Problem(place, "has no =", "COLUMN=VALUE"))
        elif name not in fields:
            problems.append(_unknown(place, name, tuple(fields)))
        elif not (meets := _meeting(fields[name].values, value)).any():
            there = dict.fromkeys(_said(each) for each in fields[name].values)
            problems.append(Problem(place, "is true of no row", first_few([*there], 10)))
        else:
            kept &= meets
    if not problems and count and not kept.any():
        problems.append(Problem(f"--where {', '.join(given)}", "is together true of no row"))
    refuse(problems)
    if not given:
        return shown
    title = f"{shown.path}: {kept.sum():,} of {_counted(count, 'row')}"
    taken = [replace(each, values=each.values[kept]) for each in shown.sheet.fields]
    return replace(shown, sheet=replace(shown.sheet, title=title, fields=taken))


def choose(shown: Shown, columns: str | None) -> Shown:
    """The columns named, one after the other with commas; ``q*`` stands for all that begin so."""
    if columns is None:
        return shown
    fields = {each.name: each for each in shown.sheet.fields}
    chosen: dict[str, Field] = {}
    problems = []
    for wanted in filter(None, (each.strip() for each in columns.split(","))):
        names = _named(wanted, fields)
        if not names:
            problems.append(_unknown("--columns", wanted, tuple(fields)))
        chosen |= {name: replace(fields[name], on_screen=True) for name in names}
    if not (problems or chosen):
        problems.append(Problem("--columns", "names no column", ", ".join(fields)))
    refuse(problems)
    return replace(shown, sheet=replace(shown.sheet, fields=list(chosen.values())))


def _named(wanted: str, names: Iterable[str]) -> list[str]:
    """The names that one of --columns stands for: q* for q1 .. of the joints, not for qw."""
    numbered = re.compile(re.escape(wanted.removesuffix("*")) + r"\d+")
    if wanted.endswith("*") and (joints := [name for name in names if numbered.fullmatch(name)]):
        return joints
    return [name for name in names if name == wanted or fnmatchcase(name, wanted)]


def described(shown: Shown) -> Sheet:
    """A row per column: unit, what it holds and what it means."""
    fields = shown.sheet.fields
    return Sheet(
        shown.sheet.title,
        shown.sheet.facts,
        [
            Field("column", texts(each.name for each in fields), "", "name of the column"),
            Field("unit", texts(each.unit or None for each in fields), "", "its unit"),
            Field("holds", texts(_holds(each.values) for each in fields), "", "what is in it"),
            Field("meaning", texts(each.meaning or None for each in fields), "", "its meaning"),
        ],
    )


def words(shown: Shown, describe: bool) -> tuple[list[str], list[str]]:
    """What is said above and below the table."""
    above, below = list(shown.remarks), []
    if shown.artefact is not None:
        above.append(shown.artefact.meaning)
    if describe:
        below += [f"{key}: {shown.provenance[key]}" for key in store.PROVENANCE_KEYS
                  if key in shown.provenance]  # fmt: skip
        return above, below
    for each in shown.sheet.fields:
        if " " in each.unit and not each.unit.startswith("see "):
            below.append(f"unit of {each.name}: {each.unit}")
    return above, below


def _no_table(path: Path, error: InputError) -> list[Problem]:
    """What to say of a file that is no table."""
    if path.suffix == ".parquet":
        return [replace(each, fix="") for each in error.problems]
    what = "is not a Parquet file, and `kinacc show` shows no others"
    fix = "measured files are described by `kinacc init`" if path.suffix in _MEASURED else ""
    return [Problem(str(path), what, "a .parquet file, or a folder with some", fix)]


_MEASURED = (".csv", ".txt", ".dat", ".tsv", ".xlsx", ".xls")


def _differing(artefact: Artefact, names: Sequence[str]) -> str:
    """In which columns a file differs from the contract, in words; empty where it keeps it."""
    every = artefact.for_joints(joint_count(artefact, names))
    lacking = [each.name for each in every if not each.optional and each.name not in names]
    beside = [name for name in names if name not in {each.name for each in every}]
    said = [f"it lacks {first_few(lacking)}"] if lacking else []
    return "; ".join([*said, *([f"it has {first_few(beside)}"] if beside else [])])


def _fields(
    schema: pa.Schema, columns: Mapping[str, np.ndarray], artefact: Artefact | None, folder: Path
) -> list[Field]:
    joints = joint_count(artefact, schema.names) if artefact else 0
    known = {each.name: each for each in artefact.for_joints(joints)} if artefact else {}
    found = []
    for each in schema:
        about = {key.decode(errors="replace"): value.decode(errors="replace")
                 for key, value in (each.metadata or {}).items()}  # fmt: skip
        contract = known.get(each.name)
        unit = about.get("unit", contract.unit if contract else "")
        meaning = about.get("meaning", contract.meaning if contract else "")
        values = _values(columns[each.name], str(each.type).startswith(("int", "uint")))
        found.append(Field(each.name, values, "" if unit == "1" else unit, meaning))
    if any(_may_slide(each) for each in found):
        sliding = _sliding(folder)
        found = [
            replace(each, unit="mm") if _may_slide(each) and each.name in sliding else each
            for each in found
        ]
    return found


def _may_slide(column: Field) -> bool:
    return SLIDES in column.meaning and bool(re.fullmatch(r"q\d+", column.name))


def _sliding(folder: Path) -> set[str]:
    """Names of the joints that slide, by the robot beside the table."""
    from kinacc.deployment.folder import recorded_robot

    try:
        robot = recorded_robot(folder)
    except InputError:
        return set()
    prismatic = robot.dh.prismatic if robot is not None else ()
    return {f"q{joint + 1}" for joint, slides in enumerate(prismatic) if slides}


def _values(values: np.ndarray, whole: bool) -> np.ndarray:
    """Values as sheets take them: whole numbers whole beside null, what is no number as text."""
    if values.dtype.kind == "f" and whole:
        return texts(int(each) if np.isfinite(each) else None for each in values)
    if values.dtype.kind != "O":
        return values
    taken = (str, int, float, bool, type(None))
    return texts(each if isinstance(each, taken) else str(each) for each in values)


def _meeting(values: np.ndarray, value: str) -> np.ndarray:
    """Which values (n,) are the one given in words; - is none."""
    plains = [plain(each) for each in values]
    if value in ("", _NO_VALUE):
        return np.array([each is None for each in plains], dtype=bool)
    try:
        wanted = float(value)
    except ValueError:
        wanted = np.nan
    return np.array(
        [
            abs(each - wanted) <= 1e-9 * abs(wanted)
            if isinstance(each, (int, float)) and not isinstance(each, bool)
            else str(each) == value
            for each in plains
        ],
        dtype=bool,
    )


def _said(value: object) -> str:
    value = plain(value)
    return (
        _NO_VALUE if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
    )


def _unknown(place: str, name: str, known: tuple[str, ...]) -> Problem:
    close = nearest(name, known)
    fix = f"did you mean {close}?" if close else ""
    return Problem(place, f"there is no column {name!r}", ", ".join(known), fix)


def _holds(values: np.ndarray) -> str:
    """What a column holds, in few words."""
    there = [each for each in map(plain, values) if each is not None]
    if not there:
        return "nothing"
    absent = f", {len(values) - len(there)} without" if len(there) < len(values) else ""
    if all(isinstance(each, (int, float)) and not isinstance(each, bool) for each in there):
        decimals = decimals_of(np.array(there, dtype=np.float64))
        size = max(map(abs, there))
        least, largest = (number(each, decimals, size) for each in (min(there), max(there)))
        return (least if least == largest else f"{least} to {largest}") + absent
    kinds = list(dict.fromkeys(str(each) for each in there))
    few = len(kinds) <= _FEW and sum(map(len, kinds)) <= 60
    return (", ".join(kinds) if few else f"{len(kinds)} different texts") + absent


def _counted(count: int, what: str) -> str:
    return f"{count:,} {what}{'' if count == 1 else 's'}"

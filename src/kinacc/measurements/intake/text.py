"""How a file of rows is written: its characters, what parts its columns, where its names are."""

from __future__ import annotations

import codecs
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.errors import first_few, input_error
from kinacc.measurements import robot_programs
from kinacc.measurements.column_names import name_of
from kinacc.measurements.features import report_of
from kinacc.measurements.files import (
    BLANKS,
    EXCEL,
    GROUPS,
    POINT,
    Workbook,
    as_it_is,
    load,
    opened,
    refuse_large,
    refuse_other_files,
    reshaped,
    rows_of_lines,
)
from kinacc.measurements.grid import Cells, Row, filled
from kinacc.measurements.intake import decimals, heads
from kinacc.measurements.intake.choices import Answers, Choice, Undecided
from kinacc.measurements.intake.columns import NamedColumns, names_in
from kinacc.measurements.intake.heads import Head
from kinacc.measurements.layout import FEATURES, SPHERICAL, Layout
from kinacc.measurements.spherical import directions_of, readings_of
from kinacc.measurements.table import RawTable, frame

DELIMITERS = (";", "\t", ",", BLANKS)
_LINES, _CHARACTERS = 400, 1_000_000  # looked at
_NEAR = 0.6  # of the most numbers: so many there are if names are parted by the right mark
_SEP = re.compile(r'"?sep=(.|\\t)"?\s*', re.IGNORECASE)
_FEWEST_ROWS, _FEWEST_COLUMNS = 3, 4  # of a sheet that may be meant
_Written = tuple[Layout, Head, list[Row], list[str]]  # with the first rows, and notes


@dataclass(frozen=True)
class Looked:
    """How a file is written, and the ``table`` that this makes of it.

    ``assumed``: texts on settings that were assumed; ``stated`` the units of lengths and angles
    that stand outside of the names. ``columns``: their meaning; ``joints``: the section of the
    joints' file, where that is another.
    """

    path: str
    written: Layout
    table: RawTable
    notes: tuple[str, ...] = ()
    assumed: Mapping[str, str] = field(default_factory=dict)
    stated: Mapping[str, str] = field(default_factory=dict)
    columns: NamedColumns = field(default_factory=NamedColumns)
    joints: dict[str, Any] | None = None


def look(path: str | Path, answers: Answers) -> Looked:
    """How the file at ``path`` is written, and its table.

    ``answers`` to the choices of an :class:`Undecided`, by key. Raises that where the file can be
    read in more than one way, InputError where it is no table of numbers.
    """
    path = Path(path)
    refuse_other_files(path)
    if (table := as_it_is(path)) is not None:
        return Looked(str(path), Layout(), table)
    is_workbook = path.suffix.lower() in EXCEL
    written, head, rows, notes = (_workbook if is_workbook else _text)(path, answers)
    first_line = head.line or rows[head.first][0]
    above = [
        " ".join(map(str, cells))
        for line, cells in rows
        if line < first_line or str(next(iter(cells), "")).lstrip().startswith((*"#/;%",))
    ]
    stated = heads.stated_above(above)
    written = written.but(**_names_of(path, head, rows, stated, answers))
    table = load(path, written)
    decimal, thousands = decimals.marks_of(table, answers, written.delimiter)
    written = written.but(decimal=decimal, thousands=thousands)
    table = replace(table, decimal=decimal, thousands=thousands)
    if head.line > 1 and head.names is None:
        notes.append(f"{written.skip_lines} rows above the names, not read")
    notes += [f"columns are called {', '.join(written.names)}"] if written.names else []
    notes += ["decimal commas"] if decimal == "," else []
    notes += [f"{thousands!r} between thousands"] if thousands else []
    assumed: dict[str, str] = {}
    if report_of(table):
        written = written.but(layout=FEATURES)
        notes.append(f"a row per feature and axis: {len(table)} rows")
    elif readings := readings_of(names_in(table)):
        ways = directions_of(table, readings, stated.get("angle", ""), answers)
        written = written.but(layout=SPHERICAL, directions=ways)
        notes.append(f"{readings[0].vertical.column} is counted from the {ways.vertical}")
        if "horizontal" not in answers:
            name = readings[0].horizontal.column
            assumed["horizontal"] = f"{name} counts {ways.horizontal}, seen from above"
    return Looked(str(path), written, reshaped(table, written), tuple(notes), assumed, stated)


def _text(path: Path, answers: Answers) -> _Written:
    refuse_large(path)
    encoding = answers.get("encoding") or encoding_of(path)
    with opened(path, encoding) as stream:
        text = stream.read(_CHARACTERS)
    lines = list(StringIO(text, newline=""))
    is_cut = len(text) == _CHARACTERS and len(lines) > 1
    lines = lines[: len(lines) - is_cut][:_LINES]
    separator = _SEP.fullmatch(lines[0]) if lines else None
    stated = separator[1].replace("\\t", "\t") if separator else ""
    marks = (stated,) if stated in DELIMITERS else DELIMITERS
    split = {delimiter: list(rows_of_lines(lines, delimiter, str(path))) for delimiter in marks}
    # Words that end in a delimiter are parted by it: "P1, 2.5, 3".
    rows = [cells for _, cells in split.get(BLANKS, ()) if cells]
    if len(split) > 1 and 2 * sum(any(c[-1] in ",;" for c in row[:-1]) for row in rows) > len(rows):
        del split[BLANKS]
    # Most cells are numbers where the right delimiter parts them, and the names fit to them.
    scores = {delimiter: heads.most_numbers(rows) for delimiter, rows in split.items()}
    near = _NEAR * max(scores.values())[0]
    tops = {d: head for d, (count, _) in scores.items() if count > near
            and (head := heads.head_of(split[d])) is not None and head.width > 1}  # fmt: skip
    if not tops:
        message = "no line of column names above rows of numbers was found"
        raise input_error(str(path), message, "columns parted by ; , tab or blanks")
    best = max(tops, key=lambda d: (tops[d].line > 0, scores[d], -DELIMITERS.index(d)))
    notes = [f"read as {encoding}"] if encoding != "utf-8" else []
    return Layout().but(delimiter=best, encoding=encoding), tops[best], split[best], notes


def encoding_of(path: Path) -> str:
    """The characters of a text file: by what decodes, then by what makes sense."""
    content = path.read_bytes()
    for bom, name in ((codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be")):
        if content.startswith(bom):
            return name
    decodes = []
    for name in ("utf-8", "cp932"):
        with suppress(UnicodeDecodeError):
            content.decode(name)
            decodes.append(name)
    # Japanese where the bytes are pairs that begin as its usual characters do, else Western.
    leads = re.findall(rb"([\x81-\x9f\xe0-\xfc]).", content)
    if "utf-8" not in decodes and 2 * sum(lead < b"\xa0" for lead in leads) < max(len(leads), 1):
        return "latin-1"
    return next(iter(decodes), "latin-1")


def _workbook(path: Path, answers: Answers) -> _Written:
    sheets, tables = _tables_of(path, answers.get("sheet"))
    if not tables:
        message = "no sheet has rows of numbers under names"
        raise input_error(str(path), message, "a sheet with columns of joints and points")
    # Those that may be meant have several columns and rows, those of points x, y, z.
    large = [
        name
        for name, (head, rows) in tables.items()
        if head.width >= _FEWEST_COLUMNS and len(rows) - head.first >= _FEWEST_ROWS
    ]
    names = {sheet: [*map(name_of, _names(*table))] for sheet, table in tables.items()}
    points = [sheet for sheet in large if readings_of(names[sheet])
              or {*"xyz"} <= {t for name in names[sheet] for t in name.terms}]  # fmt: skip
    likely = points or large or [*tables]
    if len(likely) > 1:
        meant = {sheet: first_few(_names(*tables[sheet]), 12) for sheet in likely}
        raise Undecided(str(path), Choice("--sheet", "several sheets hold tables", meant))
    sheet = likely[0]
    others = [name for name in sheets if name != sheet and "sheet" not in answers]
    notes = [f"sheet {sheet!r}" + (f"; not read: {first_few(others)}" if others else "")]
    return Layout().but(sheet=sheet if len(sheets) > 1 else None), *tables[sheet], notes


def _names(head: Head, rows: Sequence[Row]) -> list[str]:
    cells = next((cells for line, cells in rows if line == head.line), [])
    return [*(head.names or map(str, filled(cells)))]


def sheets_of(path: Path) -> dict[str, RawTable]:
    """The sheets of a workbook that hold rows of numbers, each by its names and without rows."""
    tables = _tables_of(path)[1]
    return {sheet: RawTable(sheet, frame(dict.fromkeys(_names(*table), ())), np.zeros(0))
            for sheet, table in tables.items()}  # fmt: skip


def _tables_of(
    path: Path, wanted: str | None = None
) -> tuple[list[str], dict[str, tuple[Head, list[Row]]]]:
    """The sheets of a workbook; where the names are, and the first rows, of those with numbers."""
    tables: dict[str, tuple[Head, list[Row]]] = {}
    with Workbook(path) as book:
        for sheet in [wanted] if wanted else book.sheets:
            rows = book.rows(sheet, _LINES)
            head = heads.head_of(rows, sheet=True)
            if head is not None and head.width > 1:
                tables[sheet] = head, rows
        return book.sheets, tables


def _names_of(
    path: Path,
    head: Head,
    rows: Sequence[Row],
    stated: Mapping[str, str],
    answers: Answers,
) -> dict[str, Any]:
    """The lines around the names; or the names, where the file has no line of them."""
    cells = [cells for _, cells in rows[head.first :] if len(cells) == head.width]
    names: Sequence[str]
    if answer := answers.get("names"):
        names = [name.strip() for name in answer.split(",")]
        if len(names) != head.width:
            message = f"{len(names)} names for {head.width} columns"
            raise input_error(f"--names {answer}", message, f"{head.width} names")
    elif head.line:
        return {
            "names": head.names and [*head.names],
            "skip_lines": head.line - (not head.names),
            "skip_under_names": head.under,
        }
    else:
        names = head.names or _point_names(cells, stated) or robot_programs.names_of_rows(cells)
    if names:
        return {"names": [*names], "skip_lines": rows[head.first][0] - 1}
    fix = f"write a line of names above the numbers, or give --names with {head.width} names; "
    fix += "export decimal commas with ; or tab between the columns"
    message = f"the columns have no names, or not one for each of {head.width}"
    raise input_error(str(path), message, "one line of names", fix)


def _point_names(rows: Sequence[Cells], stated: Mapping[str, str]) -> list[str]:
    """Names of a list of points without any: collection, group, point, x, y, z."""
    columns = list(zip(*rows, strict=True))
    texts = [not any(map(heads.is_number, column)) for column in columns]
    before = texts.index(False) if False in texts else 0
    if before and len(texts) == before + 4 and len({*columns[before]}) == len(rows):
        # Points that are called 1, 2, 3.
        before += all(str(cell).strip().isdigit() for cell in columns[before])
    if not 1 <= before <= 3 or len(texts) != before + 3 or any(texts[before:]):
        return []
    unit = f"_{stated['length']}" if "length" in stated else ""
    return [*(*GROUPS, POINT)[3 - before :], *(f"{axis}{unit}" for axis in "XYZ")]

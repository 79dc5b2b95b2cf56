"""How a file of rows is written: its characters, what parts its columns, where its names are."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.errors import input_error
from kinacc.measurements import robot_programs
from kinacc.measurements.features import report_of
from kinacc.measurements.files import (
    BLANKS,
    EXCEL,
    GROUPS,
    POINT,
    as_it_is,
    load,
    opened,
    refuse_large,
    reshaped,
    rows_of_lines,
    rows_of_sheets,
)
from kinacc.measurements.grid import Cells, Row, filled, is_comment
from kinacc.measurements.intake import decimals, heads
from kinacc.measurements.intake.choices import Answers
from kinacc.measurements.intake.columns import NamedColumns, names_in
from kinacc.measurements.intake.heads import Head
from kinacc.measurements.layout import FEATURES, SPHERICAL, Layout
from kinacc.measurements.spherical import directions_of, readings_of
from kinacc.measurements.table import RawTable, frame

DELIMITERS = (";", "\t", ",", BLANKS)
_LINES, _CHARACTERS = 400, 1_000_000  # looked at
_NEAR = 0.6  # of the most numbers: so many there are if names are parted by the right mark
_SEP = re.compile(r'"?sep=(.|\\t)"?\s*', re.IGNORECASE)
_Written = tuple[Layout, Head, list[Row]]  # with the first rows


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
    if (table := as_it_is(path)) is not None:
        return Looked(str(path), Layout(), table)
    is_workbook = path.suffix.lower() in EXCEL
    written, head, rows = (_workbook if is_workbook else _text)(path, answers)
    first_line = head.line or rows[head.first][0]
    around = [cells for line, cells in rows if line < first_line or is_comment(cells)]
    stated = heads.stated_above(" ".join(map(str, cells)) for cells in around)
    written = written.but(**_names_of(path, head, rows, stated, answers))
    table = load(path, written)
    decimal, thousands = decimals.marks_of(table, answers, written.delimiter)
    written = written.but(decimal=decimal, thousands=thousands)
    table = replace(table, decimal=decimal, thousands=thousands)
    notes, assumed = list[str](), dict[str, str]()
    if report_of(table):
        written = written.but(layout=FEATURES)
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
        lines = stream.readlines(_CHARACTERS)[:_LINES]
    separator = _SEP.fullmatch(lines[0]) if lines else None
    stated = separator[1].replace("\\t", "\t") if separator else ""
    marks = (stated,) if stated in DELIMITERS else DELIMITERS
    split = {delimiter: list(rows_of_lines(lines, delimiter, str(path))) for delimiter in marks}
    # Words that end in a delimiter are parted by it: "P1, 2.5, 3".
    rows = [cells for _, cells in split.get(BLANKS, ()) if cells]
    if len(split) > 1 and 2 * sum(any(c[-1] in ",;" for c in row[:-1]) for row in rows) > len(rows):
        del split[BLANKS]
    # Most cells are numbers where the right delimiter parts them, and the names fit to them.
    tops = {d: head for d, rows in split.items()
            if (head := heads.head_of(rows)) is not None and head.width > 1}  # fmt: skip
    if not tops:
        message = "no line of column names above rows of numbers was found"
        raise input_error(str(path), message, "columns parted by ; , tab or blanks")
    most = max(head.count for head in tops.values())
    near = [delimiter for delimiter, head in tops.items() if head.count > _NEAR * most]
    best = max(near, key=lambda d: (tops[d].line > 0, tops[d].count, -DELIMITERS.index(d)))
    return Layout().but(delimiter=best, encoding=encoding), tops[best], split[best]


def encoding_of(path: Path) -> str:
    """The characters of a text file: by what decodes, then by what makes sense."""
    content = path.read_bytes()
    with_mark = {b"\xff\xfe": "utf-16-le", b"\xfe\xff": "utf-16-be"}.get(content[:2])
    if with_mark is not None:
        return with_mark
    with suppress(UnicodeDecodeError):
        content.decode("utf-8")
        return "utf-8"
    with suppress(UnicodeDecodeError):
        content.decode("cp932")
        # Japanese where the bytes are pairs that begin as its usual characters do, else Western.
        leads = re.findall(rb"([\x81-\x9f\xe0-\xfc]).", content)
        if 2 * sum(lead < b"\xa0" for lead in leads) >= max(len(leads), 1):
            return "cp932"
    return "latin-1"


def _workbook(path: Path, answers: Answers) -> _Written:
    sheet = answers.get("sheet")
    rows = next(iter(rows_of_sheets(path, sheet, _LINES).values()))
    head = heads.head_of(rows)
    if head is None or head.width < 2:
        message = "no sheet has rows of numbers under names"
        raise input_error(str(path), message, "a sheet with columns of joints and points")
    return Layout().but(sheet=sheet), head, rows


def sheets_of(path: Path) -> dict[str, RawTable]:
    """The sheets of a workbook by the names above their rows of numbers, without these rows."""
    sheets = {}
    for sheet, rows in rows_of_sheets(path, most=_LINES).items():
        head, names = heads.head_of(rows), list[Any]()
        if head is not None and head.width > 1:
            cells = next((cells for line, cells in rows if line == head.line), [])
            names = [*(head.names or map(str, filled(cells)))]
        sheets[sheet] = RawTable(sheet, frame(dict.fromkeys(names, ())), np.zeros(0))
    return sheets


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

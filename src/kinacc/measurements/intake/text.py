"""How a file of rows is written: its characters, what parts its columns, where its names are."""

from __future__ import annotations

import codecs
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from io import StringIO
from pathlib import Path

import numpy as np

from kinacc.errors import InputError, Problem, first_few
from kinacc.measurements import robot_programs
from kinacc.measurements.column_names import name_of
from kinacc.measurements.features import report_of
from kinacc.measurements.files import (
    BLANKS,
    EXCEL,
    GROUPS,
    PARQUET,
    POINT,
    Workbook,
    load,
    opened,
    refuse_large,
    refuse_other_files,
    rows_of_lines,
)
from kinacc.measurements.grid import Row, filled
from kinacc.measurements.intake import decimals, heads
from kinacc.measurements.intake.choices import Choice, Undecided
from kinacc.measurements.intake.columns import names_in
from kinacc.measurements.intake.heads import Head
from kinacc.measurements.layout import FEATURES, LENGTH, SPHERICAL, Directions, Layout
from kinacc.measurements.spherical import PER_UNIT, Reading, readings_of
from kinacc.measurements.table import RawTable

DELIMITERS = (";", "\t", ",", BLANKS)
_LINES, _CHARACTERS = 400, 1_000_000  # looked at
_NEAR = 0.6  # of the most numbers: so many there are if names are parted by the right mark
_SEP = re.compile(r'"?sep=(.|\\t)"?\s*', re.IGNORECASE)
_FEWEST_ROWS, _FEWEST_COLUMNS = 3, 4  # of a sheet that may be meant
_TURN = {unit: 2.0 * np.pi / size for unit, size in PER_UNIT.items()}
_SLACK = 1.002


@dataclass(frozen=True)
class Looked:
    """How a file is written, and the ``table`` that this makes of it.

    ``told`` are words on what was found; ``assumed`` on what was taken, by setting; ``stated`` the
    units of lengths and angles that stand outside of the names, and the frame.
    """

    written: Layout
    table: RawTable
    told: tuple[str, ...] = ()
    assumed: Mapping[str, str] = field(default_factory=dict)
    stated: Mapping[str, str] = field(default_factory=dict)


def look(path: str | Path, answers: Mapping[str, str] | None = None) -> Looked:
    """How the file at ``path`` is written, and its table.

    ``answers`` to the choices of an :class:`Undecided`, by key. Raises that where the file can be
    read in more than one way, InputError where it is no table of numbers.
    """
    path, answers = Path(path), answers or {}
    refuse_other_files(path)
    kind = path.suffix.lower()
    if kind in PARQUET:
        return Looked(Layout(), load(path))
    if kind not in EXCEL and (program := robot_programs.read(path)) is not None:
        return Looked(Layout(), program)
    written, head, rows, told = (_workbook if kind in EXCEL else _text)(path, answers)
    around = [
        " ".join(str(cell) for cell in cells if cell is not None)
        for number, (line, cells) in enumerate(rows)
        if (line < head.line if head.line else number < head.first)
        or str(next(iter(cells), "")).lstrip()[:1] in ("#", "/", ";", "%")
    ]
    stated = heads.stated_above([each for each in around if each])
    written = _named(path, written, head, rows, stated, answers)
    table = load(path, written)
    decimal, thousands, choice = decimals.marks_of(
        table.columns, answers, written.delimiter == BLANKS
    )
    if choice:
        raise Undecided(str(path), [choice])
    written = replace(written, decimal=decimal, thousands=thousands)
    table = replace(table, decimal=decimal, thousands=thousands)
    told += _in_words(written, rows, head, stated)
    assumed: dict[str, str] = {}
    count = len(table)
    if report_of(table):
        written = replace(written, layout=FEATURES)
        table = load(path, written)
        told.append(f"a row per feature and axis: {count} rows are {len(table)} features")
    elif readings := readings_of(names_in(table)):
        way = _directions(table, readings, stated.get("angle", ""), answers, told, assumed)
        written = replace(written, layout=SPHERICAL, directions=way)
        table = load(path, written)
    return Looked(written, table, tuple(told), assumed, stated)


def _text(path: Path, answers: Mapping[str, str]) -> tuple[Layout, Head, list[Row], list[str]]:
    refuse_large(path)
    encoding = answers.get("encoding") or encoding_of(path)
    with opened(path, encoding) as stream:
        text = stream.read(_CHARACTERS).removeprefix("\ufeff")
    lines = list(StringIO(text, newline=""))
    if len(text) == _CHARACTERS:
        lines = lines[:-1] or lines  # the last one may have been cut
    lines = lines[:_LINES]
    said = _SEP.fullmatch(lines[0]) if lines else None
    mark = said[1].replace("\\t", "\t") if said else ""
    marks = (mark,) if mark in DELIMITERS else DELIMITERS
    split = {mark: list(rows_of_lines(lines, mark, str(path))) for mark in marks}
    # Words that end in a mark are parted by it: "P1, 2.5, 3".
    words = [cells for _, cells in split.get(BLANKS, ()) if cells]
    if len(split) > 1 and 2 * sum(any(c[-1] in ",;" for c in w[:-1]) for w in words) > len(words):
        del split[BLANKS]
    best = _best(split)
    rows = split[best]
    head = heads.head_of(rows, best)
    if head is None or head.width < 2:
        what = "no line of column names above rows of numbers was found"
        raise InputError(Problem(str(path), what, "columns parted by ; , tab or blanks"))
    told = [f"read as {encoding}"] if encoding != "utf-8" else []
    return Layout(best, encoding=encoding), head, rows, told


def _best(split: Mapping[str, Sequence[Row]]) -> str:
    """What parts the columns: most cells are numbers then, and the names fit to them."""
    scores = {}
    for mark, rows in split.items():
        counted: dict[int, int] = {}  # cells that are numbers, by the width of the row
        for _, cells in rows:
            count = heads.numbers_in(cells)
            counted[len(cells)] = counted.get(len(cells), 0) + (count if count > 1 else 0)
        width = max(counted, key=lambda each: (counted[each], each), default=0)
        scores[mark] = counted.get(width, 0), width
    most = max(numbers for numbers, _ in scores.values())

    def rank(mark: str) -> tuple:
        head = heads.head_of(split[mark], mark) if scores[mark][0] > _NEAR * most else None
        return head is not None and head.line > 0, *scores[mark], -DELIMITERS.index(mark)

    return max(split, key=rank)


def encoding_of(path: Path) -> str:
    """In which characters a text file is written: by what decodes, then by what makes sense."""
    with open(path, "rb") as file:
        head = file.read(4096)
        for mark, name in ((codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be")):
            if head.startswith(mark):
                return name
        even, odd = head[0::2].count(0), head[1::2].count(0)
        if max(even, odd) > 0.35 * len(head) and min(even, odd) < 0.05 * len(head):
            return "utf-16-le" if odd > even else "utf-16-be"  # without saying so
        file.seek(0)
        try:
            for _ in codecs.iterdecode(file, "utf-8"):
                pass
            return "utf-8"
        except UnicodeDecodeError:
            file.seek(0)
            sample = b"".join(line[:1000] for line, _ in zip(file, range(200_000), strict=False)
                              if not line.isascii())[:200_000]  # fmt: skip
    try:
        sample.decode("cp932")
    except UnicodeDecodeError as error:
        if error.start < len(sample) - 2:
            return "latin-1"
    # Japanese where the bytes are pairs that begin as its usual characters do, else Western.
    leads = [pair[0] for pair in re.findall(rb"[\x81-\x9f\xe0-\xfc].", sample)]
    return "cp932" if leads and 2 * sum(lead < 0xA0 for lead in leads) >= len(leads) else "latin-1"


def _workbook(path: Path, answers: Mapping[str, str]) -> tuple[Layout, Head, list[Row], list[str]]:
    sheets, found = _tables_of(path, answers.get("sheet"))
    if not found:
        what = "no sheet has rows of numbers under names"
        raise InputError(Problem(str(path), what, "a sheet with columns of joints and points"))
    # Those that may be meant have several columns and rows, those of points x, y, z.
    likely = [
        sheet
        for sheet, (head, rows) in found.items()
        if head.width >= _FEWEST_COLUMNS and len(rows) - head.first >= _FEWEST_ROWS
    ]
    likely = [s for s in likely if _name_points(_names(*found[s]))] or likely or list(found)
    if len(likely) > 1:
        meant = {sheet: first_few(_names(*found[sheet]), 12) for sheet in likely}
        raise Undecided(str(path), [Choice("--sheet", "several sheets hold tables", meant)])
    sheet = likely[0]
    others = [each for each in sheets if each != sheet and "sheet" not in answers]
    told = [f"sheet {sheet!r}" + (f"; not read: {first_few(others)}" if others else "")]
    return Layout(sheet=sheet if len(sheets) > 1 else None), *found[sheet], told


def _names(head: Head, rows: Sequence[Row]) -> list[str]:
    cells = next((cells for line, cells in rows if line == head.line), [])
    return list(head.names or [str(each) for each in cells if each is not None])


def _name_points(names: Sequence[str]) -> bool:
    named = list(map(name_of, names))
    return {*"xyz"} <= {word for name in named for word in name.words} or bool(readings_of(named))


def names_of_sheets(path: Path) -> dict[str, list[str]]:
    """Names of the columns of every sheet of a workbook that holds rows of numbers."""
    return {sheet: _names(head, rows) for sheet, (head, rows) in _tables_of(path)[1].items()}


def _tables_of(
    path: Path, wanted: str | None = None
) -> tuple[list[str], dict[str, tuple[Head, list[Row]]]]:
    """The sheets of a workbook; where the names are, and the first rows, of those with numbers."""
    found: dict[str, tuple[Head, list[Row]]] = {}
    with Workbook(path) as book:
        if wanted is not None and wanted not in book.sheets:
            raise InputError(Problem(f"--sheet {wanted}", "is not there", ", ".join(book.sheets)))
        for sheet in [wanted] if wanted else book.sheets:
            rows = book.rows(sheet, _LINES)
            head = heads.head_of(rows, "", sheet=True)
            if head is not None and head.width > 1:
                found[sheet] = head, rows
        return book.sheets, found


def _named(
    path: Path,
    written: Layout,
    head: Head,
    rows: Sequence[Row],
    stated: Mapping[str, str],
    answers: Mapping[str, str],
) -> Layout:
    """With the lines around the names; or with the names, where the file has no line of them."""
    above = rows[head.first][0] - 1
    if given := answers.get("names"):
        names = tuple(name.strip() for name in given.split(","))
        if len(names) != head.width:
            what = f"{len(names)} names for {head.width} columns"
            raise InputError(Problem(f"--names {given}", what, f"{head.width} names"))
        return replace(written, names=names, skip_lines=above)
    if head.line:
        skipped = head.line if head.names else head.line - 1
        written = replace(written, names=head.names, skip_lines=skipped)
        return replace(written, skip_under_names=head.under)
    cells = [cells for _, cells in rows[head.first :] if len(cells) == head.width]
    names = head.names or _point_names(cells, stated) or _names_within(cells)
    if names:
        return replace(written, names=names, skip_lines=above)
    for line, cells in rows[: head.first]:
        if len(cells) > 3 and len(filled(cells)) == len(cells) and not heads.numbers_in(cells):
            what = f"{len(cells)} names above rows of {head.width} cells"
            fix = "decimal commas between commas cannot be told apart: export it with ; or tab "
            raise InputError(Problem(f"{path}: line {line}", what, "a name for every cell", fix))
    fix = "write a line of names above the numbers, such as q1_deg,..,x_mm,y_mm,z_mm, or give "
    fix += f"--names with {head.width} names parted by commas"
    raise InputError(Problem(str(path), "the columns have no names", "one line of names", fix))


def _point_names(rows: Sequence[Sequence], stated: Mapping[str, str]) -> tuple[str, ...]:
    """Names of a list of points without any: collection, group, point, x, y, z."""
    columns = list(zip(*rows, strict=True))
    texts = [not any(map(heads.is_number, column)) for column in columns]
    before = texts.index(False) if False in texts else 0
    if before and len(texts) == before + 4 and len({*columns[before]}) == len(rows):
        # Points that are called 1, 2, 3.
        before += all(str(cell).strip().isdigit() for cell in columns[before])
    if not 1 <= before <= 3 or len(texts) != before + 3 or any(texts[before:]):
        return ()
    unit = f"_{stated['length']}" if "length" in stated else ""
    return (*(*GROUPS, POINT)[3 - before :], *(f"{axis}{unit}" for axis in "XYZ"))


def _names_within(rows: Sequence[Sequence]) -> tuple[str, ...]:
    """Names of columns whose cells name their parts, as {E6AXIS: A1 10, ..}: by the word before.

    A first column of other texts names the poses. Nothing where a column of numbers has no name.
    """
    names: list[str] = []
    word = ""
    for place, column in enumerate(zip(*rows, strict=True)):
        own = robot_programs.names_of_cells(column, word)
        if not own and heads.numbers_in(column):
            return ()
        names.append(own or (POINT if place == 0 else f"word {place + 1}"))
        word = "" if own or len({*column}) > 1 else str(column[0])
    return tuple(names) if len({*names}) == len(names) else ()


def _in_words(
    written: Layout, rows: Sequence[Row], head: Head, stated: Mapping[str, str]
) -> list[str]:
    """What was found of how the file is written, as far as it is not as usual."""
    above = [" ".join(map(str, filled(c))) for line, c in rows if line <= written.skip_lines]
    above = [text.strip() for text in above if text and not _SEP.fullmatch(text)]
    words = {
        f"{written.skip_lines} rows above the names, not read ({''.join(above[:1])[:50]})": above
        and head.names is None,
        f"columns are called {', '.join(written.names or ())}": written.names,
        "decimal commas": written.decimal == ",",
        f"{written.thousands!r} between thousands": written.thousands,
        f"frame of the points: {stated.get('frame')}": "frame" in stated,
    }
    return [told for told, there in words.items() if there]


def _directions(
    table: RawTable, readings: Sequence[Reading], stated: str, answers: Mapping, told, assumed
) -> Directions:
    """How the angles of spherical readings are counted; ``stated``: their unit, above the rows.

    Raises Undecided where it is open, InputError where they state units that are not read.
    """
    for each in readings:
        if (wrong := each.angle_units - {*PER_UNIT}) or each.distance.unit not in ("", *LENGTH):
            what = f"are in {' and '.join(sorted(wrong | {each.distance.unit}))}"
            where = f"{table.path}: columns {', '.join(each.names)}"
            raise InputError(Problem(where, what, ", ".join((*PER_UNIT, *LENGTH))))
    one = readings[0]
    horizontal, vertical = (
        np.concatenate([table.values(getattr(each, part).column) for each in readings])
        for part in ("horizontal", "vertical")
    )
    size, gon = np.nanmax(np.abs(horizontal), initial=0.0), _TURN["gon"] * _SLACK
    units = {unit for each in readings for unit in each.angle_units}
    if any(re.search(r"\bgra(d|de|ds|des)\b", n.lower()) for each in readings for n in each.names):
        units = set()  # grad is gon in one language and degrees in another
    unit = answers.get("direction_unit") or (units.pop() if len(units) == 1 else stated)
    choices = []
    if unit not in PER_UNIT:
        unit = "gon" if _TURN["deg"] * _SLACK < size <= gon else ""
    if not unit:
        large = max(size, np.nanmax(np.abs(vertical), initial=0.0)) > _TURN["rad"] * _SLACK
        first = horizontal[0]
        meant = {u: f"{first:g} is {np.rad2deg(first * PER_UNIT[u]):.4g} degrees"
                 for u in ("rad", "deg", "gon")[int(large) :]}  # fmt: skip
        about = f"{one.horizontal.column} and {one.vertical.column} state no unit of their angles"
        choices.append(Choice("--direction-unit", about, meant))
    there = vertical[np.isfinite(vertical)]
    quarter = _TURN[unit or "deg"] / 4.0
    counted = answers.get("vertical") or one.vertical_from
    if not counted and (there > quarter * _SLACK).any() and (there > 0.0).all():
        counted = "zenith"
    elif not counted and (there < 0.0).any() and (np.abs(there) <= quarter).all():
        counted = "horizon"
    if not counted and unit:
        meant = {"zenith": "counted from straight up", "horizon": "up from level"}
        about = f"{one.vertical.column} does not tell what it is counted from"
        choices.append(Choice("--vertical", about, meant))
    if choices:
        raise Undecided(table.path, choices)
    told.append(f"{one.vertical.column} is counted from the {counted}")
    turning = answers.get("horizontal") or ("clockwise" if one.is_geodetic else "counterclockwise")
    words = f"{one.horizontal.column} counts {turning}, seen from above"
    if "horizontal" in answers:
        told.append(words)
    else:
        assumed["horizontal"] = words
    return Directions(unit, counted, turning)

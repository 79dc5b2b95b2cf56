"""How a file of rows is written: its characters, what parts its columns, where its names are."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from io import StringIO
from itertools import islice
from pathlib import Path

from kinacc.errors import InputError, Problem, first_few
from kinacc.measurements import robot_programs
from kinacc.measurements.column_names import name_of
from kinacc.measurements.features import report_of
from kinacc.measurements.files import EXCEL, GROUPS, PARQUET, POINT, load, refuse_other_files
from kinacc.measurements.grid import BLANKS, Row, decoder, refuse_large, rows_of_lines
from kinacc.measurements.intake import decimals, heads, spherical_files
from kinacc.measurements.intake.choices import Choice, Undecided
from kinacc.measurements.intake.encoding import encoding_of
from kinacc.measurements.intake.heads import Head
from kinacc.measurements.spherical import readings_of
from kinacc.measurements.table import RawTable
from kinacc.measurements.written import FEATURES, SPHERICAL, Written

DELIMITERS = (";", "\t", ",", BLANKS)
_LINES, _CHARACTERS = 400, 1_000_000  # looked at
_NEAR = 0.6  # of the most numbers: so many there are if names are parted by the right mark
_SEP = re.compile(r'"?sep=(.|\\t)"?\s*', re.IGNORECASE)
_POINT_NAMES = (*GROUPS, POINT)
_FEWEST_ROWS, _FEWEST_COLUMNS = 3, 4  # of a sheet that may be meant


@dataclass(frozen=True)
class Looked:
    """How a file is written, and the ``table`` that this makes of it.

    ``told`` are words on what was found; ``assumed`` on what was taken, by setting; ``stated`` the
    units of lengths and angles that stand outside of the names, and the frame.
    """

    written: Written
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
        return Looked(Written(), load(path))
    if kind not in EXCEL and (program := robot_programs.read(path)) is not None:
        return Looked(Written(), program)
    if kind in EXCEL:
        written, head, rows, told = _workbook(path, answers)
    else:
        written, head, rows, told = _text(path, answers)
    stated = _stated(rows, head)
    written = _named(path, written, head, rows, stated, answers)
    table = load(path, replace(written, decimal=".", thousands=None))
    marks = decimals.marks_of(table.columns, answers, written.delimiter == BLANKS)
    if marks.choices:
        raise Undecided(str(path), marks.choices)
    written = replace(written, decimal=marks.decimal, thousands=marks.thousands)
    table = replace(table, decimal=marks.decimal, thousands=marks.thousands)
    told += _in_words(written, rows, head, stated, bool(table.letters))
    return _laid_out(path, Looked(written, table, tuple(told), {}, stated), answers)


def _laid_out(path: Path, found: Looked, answers: Mapping[str, str]) -> Looked:
    """With the layout, where a row of the file is not a row of readings."""
    table, written = found.table, found.written
    if report_of(table):
        written = replace(written, layout=FEATURES)
        table = load(path, written)
        rows = len(found.table)
        told = f"a row per feature and axis: {rows} rows are {len(table)} features"
        return replace(found, written=written, table=table, told=(*found.told, told))
    units = table.under if len(table.under) == len(table.columns) else ("",) * len(table.columns)
    names = [name_of(column, unit) for column, unit in zip(table.columns, units, strict=True)]
    if readings := readings_of(names):
        stated = found.stated.get("angle", "")
        way = spherical_files.directions_of(table, readings, stated, answers)
        written = replace(written, layout=SPHERICAL, directions=way.directions)
        return replace(
            found,
            written=written,
            table=load(path, written),
            told=(*found.told, *way.told),
            assumed={**found.assumed, **way.assumed},
        )
    return found


def _text(path: Path, answers: Mapping[str, str]) -> tuple[Written, Head, list[Row], list[str]]:
    refuse_large(path)
    encoding = answers.get("encoding") or encoding_of(path)
    codec, otherwise = decoder(encoding)
    with open(path, newline="", encoding=codec, errors=otherwise) as stream:
        text = stream.read(_CHARACTERS).removeprefix("\ufeff")
    lines = list(StringIO(text, newline=""))
    if lines and len(text) == _CHARACTERS:
        lines = lines[:-1] or lines  # the last one may have been cut
    lines = lines[:_LINES]
    told = [f"read as {encoding}"] if encoding != "utf-8" else []
    marks: Sequence[str] = DELIMITERS
    if lines and (said := _SEP.fullmatch(lines[0])):
        mark = "\t" if said[1] in ("\t", "\\t") else said[1]
        marks = (mark,) if mark in DELIMITERS else DELIMITERS
    split = {mark: _rows(lines, mark, path) for mark in marks}
    if len(split) > 1 and _ends_in_marks(split[BLANKS]):
        del split[BLANKS]
    best = _best(split)
    rows = split[best]
    head = heads.head_of(rows, best)
    if head is None or head.width < 2:
        what = "no line of column names above rows of numbers was found"
        raise InputError(Problem(str(path), what, "columns parted by ; , tab or blanks"))
    if best == BLANKS and _single(lines, rows, head):
        best = " "
        rows = _rows(lines, best, path)
    written = Written(best, encoding=encoding)
    return written, head, rows, told


def _rows(lines: Sequence[str], mark: str, path: Path) -> list[Row]:
    return list(rows_of_lines(lines, Written(mark), str(path)))


def _best(split: Mapping[str, Sequence[Row]]) -> str:
    """What parts the columns: most cells are numbers then, and the names fit to them."""
    scores = {mark: _score(rows) for mark, rows in split.items()}
    most = max(numbers for numbers, _ in scores.values())

    def rank(mark: str) -> tuple:
        near = scores[mark][0] > _NEAR * most
        head = heads.head_of(split[mark], mark) if near else None
        return head is not None and head.line > 0, *scores[mark], -DELIMITERS.index(mark)

    return max(split, key=rank)


def _ends_in_marks(rows: Sequence[Row]) -> bool:
    """Whether most rows of words hold one that ends in a mark, which parts them: "P1, 2.5, 3"."""
    filled = [cells for _, cells in rows if cells]
    parted = [any(cell[-1] in ",;" for cell in cells[:-1]) for cells in filled]
    return 2 * sum(parted) > len(filled)


def _score(rows: Sequence[Row]) -> tuple[int, int]:
    """Cells that are numbers in rows of the commonest width, and that width."""
    counted: dict[int, int] = {}
    for _, cells in rows:
        if (count := heads.numbers_in(cells)) > 1:
            counted[len(cells)] = counted.get(len(cells), 0) + count
    width = max(counted, key=lambda each: (counted[each], each), default=0)
    return counted.get(width, 0), width


def _single(lines: Sequence[str], rows: Sequence[Row], head: Head) -> bool:
    """Whether single blanks part the columns, in the names too."""
    named = [line for line, _ in rows[: head.first + 1] if line >= head.line > 0]
    every = [
        lines[line - 1].rstrip("\r\n") for line in (*named, *[r[0] for r in rows[head.first :]])
    ]
    return bool(named) and all(line.split(" ") == line.split() for line in every if line)


def _workbook(path: Path, answers: Mapping[str, str]) -> tuple[Written, Head, list[Row], list[str]]:
    sheets, found = _tables_of(path, answers.get("sheet"))
    if not found:
        what = "no sheet has rows of numbers under names"
        raise InputError(Problem(str(path), what, "a sheet with columns of joints and points"))
    likely = _likely(found)
    if len(likely) > 1:
        meant = {sheet: _shown(*found[sheet]) for sheet in likely}
        raise Undecided(str(path), [Choice("--sheet", "several sheets hold tables", meant)])
    sheet = likely[0]
    others = [each for each in sheets if each != sheet and "sheet" not in answers]
    told = [f"sheet {sheet!r}" + (f"; not read: {first_few(others)}" if others else "")]
    return Written(sheet=sheet if len(sheets) > 1 else None), *found[sheet], told


def names_of_sheets(path: Path) -> dict[str, list[str]]:
    """Names of the columns of every sheet of a workbook that holds rows of numbers."""
    named = {}
    for sheet, (head, rows) in _tables_of(path)[1].items():
        cells = next((cells for line, cells in rows if line == head.line), [])
        named[sheet] = list(head.names or [str(each) for each in cells if each is not None])
    return named


def _tables_of(
    path: Path, wanted: str | None = None
) -> tuple[list[str], dict[str, tuple[Head, list[Row]]]]:
    """The sheets of a workbook; where the names are, and the first rows, of those with numbers."""
    from kinacc.measurements.workbook import Workbook

    found: dict[str, tuple[Head, list[Row]]] = {}
    with Workbook(path) as book:
        sheets = book.sheets
        if wanted is not None and wanted not in sheets:
            raise InputError(Problem(f"--sheet {wanted}", "is not there", ", ".join(sheets)))
        for sheet in [wanted] if wanted else sheets:
            rows = list(islice(book.rows(sheet, _LINES), _LINES))
            width = max((len(cells) for _, cells in rows), default=0)
            rows = [(line, cells + [None] * (width - len(cells))) for line, cells in rows]
            head = heads.head_of(rows, "", sheet=True)
            if head is not None and head.width > 1:
                found[sheet] = head, rows
    return sheets, found


def _likely(found: Mapping[str, tuple[Head, list[Row]]]) -> list[str]:
    """The sheets that may be meant: those of several columns and rows, those with x, y, z."""
    large = [
        sheet
        for sheet, (head, rows) in found.items()
        if head.width >= _FEWEST_COLUMNS and len(rows) - head.first >= _FEWEST_ROWS
    ]
    points = [sheet for sheet in large if _names_points(*found[sheet])]
    return points or large or list(found)


def _names_points(head: Head, rows: list[Row]) -> bool:
    names = next((cells for line, cells in rows if line == head.line), [])
    words = {word for name in names if isinstance(name, str) for word in name_of(name).words}
    return set("xyz") <= words or bool(readings_of([name_of(str(n)) for n in names if n]))


def _shown(head: Head, rows: list[Row]) -> str:
    names = next((cells for line, cells in rows if line == head.line), [])
    return first_few([str(name) for name in names if name is not None], 12)


def _stated(rows: Sequence[Row], head: Head) -> dict[str, str]:
    texts = [
        " ".join(str(cell) for cell in cells if cell is not None)
        for line, cells in rows
        if (line < head.line if head.line else line < rows[head.first][0]) or _remark(cells)
    ]
    return heads.stated_above(texts)


def _remark(cells: Sequence) -> bool:
    return (
        bool(cells) and isinstance(cells[0], str) and cells[0].lstrip()[:1] in ("#", "/", ";", "%")
    )


def _named(
    path: Path,
    written: Written,
    head: Head,
    rows: Sequence[Row],
    stated: Mapping[str, str],
    answers: Mapping[str, str],
) -> Written:
    """With the lines around the names; or with the names, where the file has no line of them."""
    given = answers.get("names")
    if given:
        names = tuple(name.strip() for name in given.split(","))
        if len(names) != head.width:
            what = f"{len(names)} names for {head.width} columns"
            raise InputError(Problem(f"--names {given}", what, f"{head.width} names"))
        return replace(written, names=names, skip_lines=rows[head.first][0] - 1)
    if head.names is not None and not head.line:
        return replace(written, names=head.names, skip_lines=rows[head.first][0] - 1)
    if head.names is not None:
        above = head.line
        return replace(written, names=head.names, skip_lines=above, skip_under_names=head.under)
    if head.line:
        return replace(written, skip_lines=head.line - 1, skip_under_names=head.under)
    names = _point_names(rows, head, stated) or _names_within(rows, head)
    if not names:
        _refuse_other_width(path, written, head, rows)
        what = "the columns have no names"
        fix = "write a line of names above the numbers, such as q1_deg,..,x_mm,y_mm,z_mm, or give "
        fix += f"--names with {head.width} names parted by commas"
        raise InputError(Problem(str(path), what, "one line of names", fix))
    return replace(written, names=names, skip_lines=rows[head.first][0] - 1)


def _refuse_other_width(path: Path, written: Written, head: Head, rows: Sequence[Row]) -> None:
    """Raise where a line looks like names, and the rows have another number of cells."""
    for line, cells in rows[: head.first]:
        few = len(cells) > 3 and len(cells) != head.width and not heads.numbers_in(cells)
        if few and all(str(cell).strip() for cell in cells):
            what = f"{len(cells)} names above rows of {head.width} cells"
            fix = "export it with ; or tab between the columns"
            if written.delimiter == "," and head.width > len(cells):
                fix = f"decimal commas between commas cannot be told apart: {fix}"
            raise InputError(Problem(f"{path}: line {line}", what, "a name for every cell", fix))


def _point_names(rows: Sequence[Row], head: Head, stated: Mapping[str, str]) -> tuple[str, ...]:
    """Names of a list of points without any: collection, group, point, x, y, z."""
    cells = [cells for _, cells in rows[head.first :] if len(cells) == head.width]
    columns = list(zip(*cells, strict=True)) if cells else []
    texts = [not any(map(heads.is_number, column)) for column in columns]
    before = texts.index(False) if False in texts else 0
    if before and len(texts) == before + 4 and _counted(columns[before]):
        before += 1  # points that are called 1, 2, 3
    if not 1 <= before <= 3 or len(texts) != before + 3 or any(texts[before:]):
        return ()
    unit = f"_{stated['length']}" if "length" in stated else ""
    return (*_POINT_NAMES[3 - before :], *(f"{axis}{unit}" for axis in "XYZ"))


def _names_within(rows: Sequence[Row], head: Head) -> tuple[str, ...]:
    """Names of columns whose cells name their parts, as {E6AXIS: A1 10, ..}: by the word before.

    A first column of other texts names the poses. Nothing where a column of numbers has no name.
    """
    cells = [cells for _, cells in rows[head.first :] if len(cells) == head.width]
    names: list[str] = []
    word = ""
    for place, column in enumerate(zip(*cells, strict=True)):
        own = robot_programs.names_of_cells(column, word)
        if not own and any(map(heads.numbers_in, [[each] for each in column])):
            return ()
        names.append(own or (POINT if place == 0 else f"word {place + 1}"))
        word = "" if own or len(set(column)) > 1 else str(column[0])
    within = any(map(robot_programs.numbers_within, cells[0])) if cells else False
    return tuple(names) if within and len(set(names)) == len(names) else ()


def _counted(column: Sequence) -> bool:
    return all(str(cell).strip().isdigit() for cell in column) and len(set(column)) == len(column)


def _in_words(
    written: Written, rows: Sequence[Row], head: Head, stated: Mapping[str, str], sheet: bool
) -> list[str]:
    """What was found of how the file is written, as far as it is not as usual."""
    told = []
    last = written.skip_lines
    above = [
        " ".join(str(cell) for cell in cells if cell is not None).strip()
        for line, cells in rows
        if line <= last
    ]
    above = [text for text in above if text and not text.lower().startswith(("sep=", '"sep='))]
    if above and head.names is None:
        what = "the names" if head.line else "the rows"
        kind = "row" if sheet else "line"
        count = f"{last} {kind}{'s' if last > 1 else ''}"  # blank ones too, as skip_lines has it
        told.append(f"{count} above {what}, not read ({_shortened(above[0])})")
    if written.names is not None:
        told.append(f"columns are called {', '.join(written.names)}")
    if written.decimal == ",":
        told.append("decimal commas")
    if written.thousands is not None:
        told.append(f"{written.thousands!r} between thousands")
    if "frame" in stated:
        told.append(f"frame of the points: {stated['frame']}")
    return told


def _shortened(text: str) -> str:
    return text if len(text) <= 50 else text[:47] + "..."

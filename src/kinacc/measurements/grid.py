"""Rows of cells as a table: the line of names, what stands around the rows and is none of them."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from kinacc.errors import InputError, Problem, refuse
from kinacc.measurements.table import (
    ALLOWED,
    MOST_BYTES,
    MOST_CELLS,
    MOST_COLUMNS,
    MOST_ROWS,
    SMALLER,
    RawTable,
    doubled_in,
)
from kinacc.measurements.written import Written

Row = tuple[int, list]  # the line it ends on, its cells

BLANKS = "blanks"
_DIGITS = tuple("0123456789")
_COMMENTS = ("#", "//", "%", "!", ";")
_STATISTICS_TEXT = """
mean|average|avg|std|std.|stdev|std dev|std. dev.|std.dev.|stddev|standard deviation|sigma|min|max
minimum|maximum|range|rms|median|sum|total|count|variance|mittelwert|mittel|durchschnitt|stabw
standardabweichung|std.-abw.|std-abw|stdabw|spannweite|anzahl|summe|moyenne|ecart type|écart type
écart-type|ecart-type|somme|promedio|media|desviación estándar|desviacion estandar|desv. est.
desviación típica|máximo|mínimo|maximo|minimo|massimo|deviazione standard|dev. std.|scarto tipo
平均|平均値|標準偏差|最大|最小|最大値|最小値|合計|範囲
3 sigma|2 sigma|6 sigma|mean value|max dev|rms error|mean error|max error
"""
STATISTICS = frozenset(
    word for line in _STATISTICS_TEXT.strip().split("\n") for word in line.split("|")
)
_LABELS = re.compile(r"[\s:=]+$")
_UNIT_BEHIND = re.compile(
    r"([+\-−]?[\d.,].*[\d.,]|[+\-−]?\d)\s*(°|deg|rad|gon|mm|m|cm|in|inch|µm|um)"
)
_BLOCK = 4  # lines: a name, and X, Y, Z
_MOST_LINES = MOST_ROWS + 10_000  # titles and the like beside
_LONGEST_NUMBER = 60  # with its unit
_HAS_DIGIT = re.compile(r"\d")
_FIRST_WORD = re.compile(r"[\s(\[:=/,]")
_RULE = re.compile(r"[\s\-=_+|*.;,\t]*")
_WITH_BRACKETS = re.compile(r"(?:\{[^{}]*\}|\[(?:[^\[\]]|\[[^\[\]]*\])*\]|\S)+")
_TWO_BLANKS = re.compile(r"\s{2,}|\t")


def decoder(encoding: str) -> tuple[str, str]:
    """Name of Python's codec for one of ours, and what it does with bytes that are none."""
    codec = {"utf-8": "utf-8-sig", "latin-1": "cp1252"}.get(encoding, encoding)
    return codec, "replace"


def refuse_large(path: Path) -> None:
    """Raise InputError where a text has too many bytes or lines."""
    if path.stat().st_size > MOST_BYTES:
        what = f"{path.stat().st_size / 1e6:.0f} MB"
        raise InputError(Problem(str(path), what, ALLOWED, SMALLER))
    with open(path, "rb") as file:
        lines = sum(chunk.count(b"\n") for chunk in iter(lambda: file.read(1 << 20), b""))
    if lines > _MOST_LINES:
        raise InputError(Problem(str(path), f"{lines} lines", ALLOWED, SMALLER))


def rows_of_text(path: Path, written: Written) -> Iterator[Row]:
    """Rows of a text file that are not blank. Raises InputError where there is too much of it."""
    refuse_large(path)
    codec, otherwise = decoder(written.encoding)
    with open(path, newline="", encoding=codec, errors=otherwise) as stream:
        yield from _limited(rows_of_lines(stream, written, str(path)), str(path))


class Words(list):
    """Cells of a line that are parted by blanks; ``line`` is what they were."""

    def __init__(self, line: str) -> None:
        within = "{" in line or "[" in line
        super().__init__(_WITH_BRACKETS.findall(line) if within else line.split())
        self.line = line.strip()


def rows_of_lines(lines: Iterable[str], written: Written, path: str) -> Iterator[Row]:
    """Rows of the lines of a text, blank ones too."""
    if written.delimiter == BLANKS:
        for number, line in enumerate(lines, 1):
            yield number, Words(line.removeprefix("\ufeff"))
        return
    reader = csv.reader(lines, delimiter=written.delimiter)
    try:
        for cells in reader:
            if reader.line_num == 1 and cells:
                cells[0] = cells[0].removeprefix("\ufeff")
            yield reader.line_num, cells
    except csv.Error as error:
        where = f"{path}: line {reader.line_num}"
        allowed = "cells of at most 131072 characters, each quotation mark with its second"
        raise InputError(Problem(where, f"cannot be read: {error}", allowed)) from None


def _limited(rows: Iterator[Row], path: str) -> Iterator[Row]:
    count = 0
    for number, (line, cells) in enumerate(rows):
        count += len(cells)
        if number > MOST_ROWS or count > MOST_CELLS or len(cells) > MOST_COLUMNS:
            what = f"more than {max(number - 1, 0)} rows of {len(cells)} columns"
            raise InputError(Problem(path, what, ALLOWED, SMALLER))
        yield line, cells


def number_of(cell: str) -> tuple[str, str]:
    """A cell such as 12.5° or 1204.3 mm as number and unit; the unit is empty where none is."""
    found = _UNIT_BEHIND.fullmatch(cell) if len(cell) < _LONGEST_NUMBER else None
    return (found[1], found[2]) if found else (cell, "")


def is_blank(cells: Sequence) -> bool:
    """Whether a row holds nothing."""
    return not any(cell.strip() if isinstance(cell, str) else cell is not None for cell in cells)


def _filled(cells: Sequence) -> list:
    """The cells that hold something."""
    return [cell for cell in cells if cell is not None and str(cell).strip()]


def _is_name_alone(filled: Sequence) -> bool:
    """Whether a row holds one text and nothing else."""
    return len(filled) == 1 and isinstance(filled[0], str)


def is_comment(cells: Sequence, delimiter: str = "") -> bool:
    """Whether a row is a remark, or a rule of dashes, by what it begins with."""
    first = cells[0].lstrip() if isinstance(cells[0], str) else ""
    if first.startswith(_COMMENTS) and not (delimiter == ";" and first.startswith(";")):
        return True
    if delimiter == ";" and not first and len(cells) > 1 and is_blank(cells[2:]):
        return isinstance(cells[1], str) and not cells[1].strip().isdigit()  # "; Units: mm"
    return all(isinstance(cell, str) and _RULE.fullmatch(cell) for cell in cells) and any(
        len(cell.strip()) > 1 for cell in cells
    )


def is_statistic(cells: Sequence) -> bool:
    """Whether a row is labelled as a mean, a spread or a largest value of others."""
    for cell in cells:
        if cell is None or (isinstance(cell, str) and not cell.strip()):
            continue
        if not isinstance(cell, str) or len(cell) > 60:
            return False
        label = _LABELS.sub("", cell).strip().lower()
        return label in STATISTICS or _FIRST_WORD.split(label, 1)[0] in STATISTICS
    return False


def header_cells(cells: list, width: int) -> list[str]:
    """The names of a line of names above rows of ``width`` cells.

    Where blanks part the cells, a name may hold one, or a unit in brackets behind one.
    """
    names = ["" if cell is None else str(cell).strip() for cell in cells]
    if not isinstance(cells, Words) or len(names) == width:
        return names
    joined: list[str] = []
    for word in names:
        if joined and word[:1] in "[(" and word[-1:] in "])":
            joined[-1] += f" {word}"
        else:
            joined.append(word)
    apart = [part.strip() for part in _TWO_BLANKS.split(cells.line) if part.strip()]
    return next((each for each in (joined, apart) if len(each) == width), names)


class Sorted:
    """What the rows of a file are: names, lines under them, readings, and what is none."""

    def __init__(self, rows: Iterable[Row], written: Written) -> None:
        self.names = list(written.names) if written.names is not None else []
        self.head: list = self.names
        self.names_line = 0
        self.under: list = []
        self.rows: list[list] = []
        self.lines: list[int] = []
        self.set_aside: list[tuple[int, list, str]] = []
        above, under = written.skip_lines, written.skip_under_names
        for line, cells in rows:
            if line <= above or is_blank(cells):
                continue
            if not self.names:
                self.head, self.names_line = cells, line
                self.names = ["" if cell is None else str(cell).strip() for cell in cells]
                continue
            first = cells[0]
            if first is None or (type(first) is str and first[:1] not in _DIGITS):
                if is_comment(cells, written.delimiter):
                    self.set_aside.append((line, cells, "a remark"))
                    continue
                if under <= 0 and is_statistic(cells):
                    self.set_aside.append((line, cells, "statistics"))
                    continue
            if under > 0:
                under -= 1
                self.under = cells
                continue
            self.rows.append(cells)
            self.lines.append(line)
        for why in ("a remark", "statistics"):
            self._take_back(why)

    def _take_back(self, why: str) -> None:
        """Make rows of what was set aside where most begin so: it is how they are called."""
        width = len(self.names)
        named = [each[2] == why and len(each[1]) == width for each in self.set_aside]
        if sum(named) <= len(self.rows):
            return
        back = [each[:2] for each, taken in zip(self.set_aside, named, strict=True) if taken]
        self.set_aside = [
            each for each, taken in zip(self.set_aside, named, strict=True) if not taken
        ]
        both = sorted([*zip(self.lines, self.rows, strict=True), *back], key=lambda each: each[0])
        self.lines = [line for line, _ in both]
        self.rows = [cells for _, cells in both]

    def name_blocks(self) -> None:
        """Give rows of X, Y, Z the name that stands in a line of its own above them."""
        if len(self.rows) < _BLOCK or not _is_name_alone(_filled(self.rows[0])):
            return
        filled = [_filled(cells) for cells in self.rows]
        alone = [_is_name_alone(each) for each in filled]
        last, rows, lines = "", [], []
        for cells, name, own, line in zip(self.rows, filled, alone, self.lines, strict=True):
            if own:
                last = name[0].strip()
                continue
            if not isinstance(cells[0], str) or cells[0].strip().upper()[:1] not in "XYZ":
                return
            rows.append([last, *cells])
            lines.append(line)
        self.rows, self.lines = rows, lines
        self.names = ["Feature", self.names[0] or "Axis", *self.names[1:]]
        self.under = ["", *self.under] if self.under else []

    def trim(self) -> None:
        """Cut blank cells behind the last column; set aside names said again, and a last text."""
        width = len(self.names)
        kept = []
        for number, cells in enumerate(self.rows):
            if len(cells) > width and is_blank(cells[width:]):
                self.rows[number] = cells[:width]
            if (
                len(cells) == width
                and [str(c).strip() for c in cells[:2]] == self.names[:2]
                and ([str(cell).strip() for cell in cells] == self.names)
            ):
                self.set_aside.append((self.lines[number], cells, "the names again"))
            else:
                kept.append(number)
        while kept and (why := self._closing(kept, width)):
            last = kept.pop()
            self.set_aside.append((self.lines[last], self.rows[last], why))
        if len(kept) < len(self.rows):
            self.rows = [self.rows[number] for number in kept]
            self.lines = [self.lines[number] for number in kept]

    def _closing(self, kept: list[int], width: int) -> str:
        """What a row under the last reading is, empty where it is a reading."""
        cells = self.rows[kept[-1]]
        filled = [c for c in cells if c is not None and str(c).strip()]
        short = len(cells) < width if len(cells) != width else 2 * len(filled) < width
        text = sum(not _begins_as_number(cell) for cell in filled)
        if len(kept) > 1 and self.lines[kept[-1]] - self.lines[kept[-2]] > 1:
            # Behind a blank line, and called by a word where the others have numbers.
            own, others = (str(self.rows[number][0]).strip() for number in (kept[-1], kept[-2]))
            if own and not _HAS_DIGIT.search(own) and _HAS_DIGIT.search(others):
                return "statistics"
        return "text" if short and filled and 2 * text >= len(filled) and len(filled) < 4 else ""


def _begins_as_number(cell: object) -> bool:
    return not isinstance(cell, str) or cell.strip()[:1] in "+-.0123456789"


def tabled(
    path: str, rows: Iterable[Row], written: Written, letters: Sequence[str] = ()
) -> RawTable:
    """Rows of cells as a table. Raises InputError where names or rows are missing or ragged.

    ``letters`` of the columns where the rows are those of a sheet.
    """
    found = Sorted(rows, written)
    if found.rows:
        found.names = header_cells(found.head, max(map(len, found.rows[:_BLOCK])))
    found.name_blocks()
    names = _without_blank_columns(found, letters)
    found.trim()
    problems = _header_problems(path, found, written.delimiter, bool(letters))
    ragged = [i for i, cells in enumerate(found.rows) if len(cells) != len(found.names)]
    seen = RawTable(path, {}, np.array(found.lines), ".", letters=dict.fromkeys(letters, ""))
    if ragged and not problems:
        cells = found.rows[ragged[0]]
        what = f"{len(cells)} cells under {len(found.names)} column names"
        fix = "check the delimiter and the decimal mark"
        if written.delimiter == "," and len(ragged) == len(found.rows) and len(cells) > len(names):
            fix += ": decimal commas between commas cannot be told apart, export with another one"
        where = f"{path}: {seen.rows_in_words(np.array(ragged))}"
        allowed = f"{len(found.names)} cells in every row"
        problems.append(Problem(where, what, allowed, fix))
    refuse(problems, f"{path} cannot be read")
    columns = {
        name: list(cells)
        for name, cells in zip(found.names, zip(*found.rows, strict=True), strict=True)
    }
    under = _units_behind(columns, found.under)
    return RawTable(
        path,
        columns,
        np.array(found.lines),
        written.decimal,
        under,
        written.thousands,
        tuple(_told(found, seen)),
        tuple(line for line, _, _ in found.set_aside),
        dict(zip(found.names, names, strict=True)) if letters else {},
    )


def _units_behind(columns: dict[str, list], under: list) -> tuple[str, ...]:
    """Take the unit off columns whose every number carries the same; the units by column."""
    units = ["" if cell is None else str(cell) for cell in under]
    for place, (name, cells) in enumerate(columns.items()):
        first = next((cell for cell in cells if not RawTable.is_gap(cell)), None)
        if not isinstance(first, str) or not number_of(first.strip())[1]:
            continue
        filled = [cell for cell in cells if not RawTable.is_gap(cell)]
        parts = [number_of(cell.strip()) if isinstance(cell, str) else ("", "") for cell in filled]
        unit = parts[0][1]
        if all(each[1] == unit for each in parts):
            units = units or [""] * len(columns)
            units[place] = units[place] if units[place].strip("-/ ") else unit
            columns[name] = [
                cell if RawTable.is_gap(cell) else number_of(cell.strip())[0] for cell in cells
            ]
    return tuple(units)


def _without_blank_columns(found: Sorted, letters: Sequence[str]) -> list[str]:
    """Leave out columns without a name that hold nothing; the letters of those that stay."""
    names = found.names
    spare = [
        place
        for place, name in enumerate(names)
        if not name and all(len(c) <= place or is_blank([c[place]]) for c in found.rows)
    ]
    kept = [place for place in range(len(names)) if place not in spare]
    if spare and (letters or names.count("") > 1 or spare[-1] == len(names) - 1):
        found.names = [names[place] for place in kept]
        found.rows = [
            [c for place, c in enumerate(cells) if place not in spare] for cells in found.rows
        ]
        if found.under:
            found.under = [c for place, c in enumerate(found.under) if place not in spare]
        return [letters[place] for place in kept] if letters else found.names
    return list(letters[: len(names)]) if letters else names


def _told(found: Sorted, seen: RawTable) -> Iterator[str]:
    """What was set aside, in words, with its lines."""
    kinds = {
        "a remark": "remarks, not read",
        "statistics": "statistics of the rows, not read",
        "the names again": "the names again, not read",
        "text": "text under the rows, not read",
    }
    for kind, words in kinds.items():
        which = [(line, cells) for line, cells, why in found.set_aside if why == kind]
        if which:
            lines = sorted(line for line, _ in which)
            labels = [_label(cells) for _, cells in which]
            said = ", ".join(dict.fromkeys(label[:30] for label in labels[:3]))
            yield f"{seen.lines_in_words(lines)}: {words} ({said})"


def _label(cells: Sequence) -> str:
    return str(next(cell for cell in cells if not is_blank([cell]))).strip()


def _header_problems(path: str, found: Sorted, delimiter: str, sheet: bool) -> list[Problem]:
    header = found.names
    if not header:
        return [Problem(path, "the file is empty", "a line of column names, then rows")]
    problems = []
    if not found.rows:
        problems.append(Problem(path, "no rows under the column names", "at least one row"))
    where = f"{path}: {'row' if sheet else 'line'} {found.names_line or 1}"
    if len(header) == 1:
        others = [mark for mark in (",", ";", "\t") if mark != delimiter and mark in header[0]]
        hint = f"set measurements.file.delimiter to {others[0]!r}" if others else ""
        problems.append(Problem(where, f"only one column, {header[0][:60]!r}", "several", hint))
    doubled = doubled_in(header)
    if doubled:
        problems.append(Problem(where, f"column names given twice: {doubled}"))
    return problems

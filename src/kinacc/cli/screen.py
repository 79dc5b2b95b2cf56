"""Text for a terminal of any width, with and without colours: words and tables, by rich."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from kinacc.cli.output import plain
from kinacc.cli.sheet import Field, Sheet

_GAP = 2
_FLEXIBLE = 24  # a column of longer texts may be made as narrow as this
_NARROWEST = 12  # or any text as narrow as this, names broken, where that spares every column
_LONGEST_NAME, _LONGEST_TEXT = 40, 300
_HEADINGS = (40, 16, 13, 10, 8, 0)  # characters before one is broken, as far as there is room
_DIGITS_OF_LARGEST, _DIGITS_OF_TYPICAL = 5, 3
_MOST_DECIMALS = 7
_NUMERICAL_ZERO = 1e-9  # of the largest in its column
_DECIMALS = {"mm": 3}  # at least, where there are that many: what instruments resolve
_BEYOND = 1e15  # nobody counts so many digits
_MIXED = 1e3  # from the smallest to the largest number of a column that has several units
_NONE = "-"
_MANY = 200


@dataclass(frozen=True)
class _Shown:
    """A column as it is printed: name, heading on its lines, cells.

    ``folds``: a text is told on several lines, names too, broken after underscores.
    """

    name: str
    heading: tuple[str, ...]
    cells: tuple[str, ...]
    is_text: bool
    folds: bool = False

    @property
    def natural(self) -> int:
        """Characters of the widest line."""
        return max(map(len, (*self.heading, *self.cells)))

    @property
    def is_long(self) -> bool:
        """Whether it is a text that may be told on several lines: no name, but words."""
        words = self.natural > _LONGEST_NAME or any(" " in each for each in self.cells)
        return self.natural > _FLEXIBLE and self.is_text and words

    @property
    def least(self) -> int:
        """Characters it cannot do without."""
        if self.folds and self.is_text:
            words = (word for each in self.cells for word in _parts(each))
            return min(self.natural, max(_NARROWEST, *map(len, (*self.heading, *words))))
        return max(_FLEXIBLE, *map(len, self.heading)) if self.is_long else self.natural

    def broken(self, width: int = 0) -> _Shown:
        """With a heading on as many lines as it takes not to be wider than its cells, or this."""
        heading = _broken(" ".join(self.heading), max(width, *map(len, self.cells)))
        return replace(self, heading=heading)

    def cell(self, row: int, width: int) -> Text:
        """What stands in a row, on its lines."""
        lines = _broken(self.cells[row], width) if self.folds else (self.cells[row],)
        return Text("\n".join(lines))


@dataclass
class Screen:
    """What is to be printed, for the terminal that is there."""

    console: Console
    parts: list[RenderableType] = field(default_factory=list)

    @classmethod
    def here(cls) -> Screen:
        """For the standard output."""
        return cls(Console(file=sys.stdout, highlight=False, markup=False, emoji=False))

    @property
    def width(self) -> int:
        """Columns of characters."""
        return self.console.width

    def words(self, text: str, style: str = "") -> None:
        """A paragraph, wrapped."""
        self.parts.append(Text(printable(text), style))

    def text(self) -> str:
        """All of it, no line longer than the terminal is wide, in the characters it can print."""
        with self.console.capture() as captured:
            for part in self.parts:
                self.console.print(part, crop=False)
        lines = re.sub(r"[ ]+$", "", captured.get(), flags=re.MULTILINE)
        code = self.console.encoding
        return lines.encode(code, "replace").decode(code)

    def table(
        self, sheet: Sheet, rows: int | None, hoist: bool, option: str = "--csv has them"
    ) -> None:
        """A sheet's columns, at most ``rows`` of its rows.

        ``hoist``: what is the same in every row is said once, above. ``option``: what shows columns
        that are left out, ``{0}`` for the first of them.
        """
        count = len(sheet)
        if not count:
            self.words("no rows")
            return
        fields = [each for each in sheet.fields if each.on_screen]
        if hoist:
            fields = self._hoisted(fields)
        if rows is None or count <= rows:
            head, tail = count, count
        else:
            head, tail = rows - rows // 3, count - rows // 3
        places = [*range(head), *range(tail, count)]
        shown = [_shown(each, places) for each in fields]
        kept = _that_fit(shown, self.width)
        widths = _widths(kept, self.width)
        self.parts.append(_table(kept, widths, range(head), True))
        if head < count:
            self.words(f".. {tail - head:,} more rows (--rows all) ..", "dim")
            if tail < count:
                self.parts.append(_table(kept, widths, range(head, len(places)), False))
        names = {each.name for each in kept}
        if left_out := [each.name for each in shown if each.name not in names]:
            self.words(
                f"{self.width} characters are too narrow for {', '.join(left_out)}: "
                f"{option.format(left_out[0])}",
                "dim",
            )

    def record(self, sheet: Sheet) -> None:
        """A sheet of one row, a line per column."""
        cells = [(each.heading, _cells(each, [0])[0]) for each in sheet.fields]
        width = max(len(name) for name, _ in cells) + _GAP
        for name, cell in cells:
            lines = cell.split("\n")
            self.parts.append(
                Text.assemble((name.ljust(width), "bold"), f"\n{' ' * width}".join(lines))
                if len(lines) == 1
                else Text.assemble((name, "bold"), *(f"\n  {line}" for line in lines))
            )

    def _hoisted(self, fields: Sequence[Field]) -> list[Field]:
        """The columns that differ between rows; the others are said."""
        alike = [each for each in fields if _alike(each.values)]
        if len(alike) == len(fields):
            return list(fields)
        empty = [each.name for each in alike if plain(each.values[0]) is None]
        same = [f"{each.heading} {_cells(each, [0])[0]}" for each in alike
                if plain(each.values[0]) is not None]  # fmt: skip
        if same:
            self.words(f"in every row: {', '.join(same)}")
        if empty:
            self.words(f"without values: {', '.join(empty)}")
        return [each for each in fields if each not in alike]


def printable(text: str) -> str:
    """Text without marks that control a terminal; lines stay lines."""
    return "".join(each if each.isprintable() or each == "\n" else " " for each in text)


def decimals_of(values: np.ndarray, unit: str = "") -> int:
    """Digits after the point for numbers (n,): five of the largest, three of a typical one.

    No more than are needed to tell all of them in full.
    """
    sizes = np.abs(values[np.isfinite(values) & (values != 0)])
    if not sizes.size:
        return 0
    sizes = sizes[sizes > _NUMERICAL_ZERO * sizes.max()]
    wanted = max(
        _DIGITS_OF_LARGEST - 1 - _power(sizes.max()),
        _DIGITS_OF_TYPICAL - 1 - _power(np.median(sizes)),
        _DECIMALS.get(unit, 0),
    )
    decimals = min(wanted, _MOST_DECIMALS)
    while decimals and np.allclose(sizes, np.round(sizes, decimals - 1), rtol=1e-9, atol=0.0):
        decimals -= 1
    return decimals


def _power(size: float) -> int:
    return int(np.floor(np.log10(size)))


def number(value: float, decimals: int, largest: float = 0.0) -> str:
    """A number with so many digits after the point; two digits of one that has none there.

    Beside one of the size ``largest`` a number may be nothing but rounding: that is 0.
    """
    if abs(value) >= _BEYOND:
        return f"{value:.4e}"
    said = f"{value:.{decimals}f}"
    if float(said):
        return said
    if abs(value) > _NUMERICAL_ZERO * largest:
        return f"{value:.1e}"
    return said.lstrip("-")


def _cells(column: Field, places: Sequence[int]) -> tuple[str, ...]:
    """Values of a column at some places, written alike."""
    values = [plain(column.values[place]) for place in places]
    written = _written(column)
    return tuple(
        _NONE if value is None
        else written(value) if isinstance(value, float)
        else printable(str(value)).rstrip("\n")
        for value in values
    )  # fmt: skip


def _written(column: Field) -> Callable[[float], str]:
    """How the numbers of a column are written: with one number of digits, if they are of a kind."""
    numbers = np.array([each for each in map(plain, column.values) if isinstance(each, float)])
    sizes = np.abs(numbers[numbers != 0])
    largest = float(sizes.max(initial=0.0))
    if column.unit.startswith("see ") and largest > _MIXED * sizes.min(initial=np.inf):
        return lambda value: number(value, decimals_of(np.array([value])))
    decimals = decimals_of(numbers, column.unit)
    return lambda value: number(value, decimals, largest)


def _alike(values: np.ndarray) -> bool:
    first = plain(values[0])
    return all(plain(value) == first for value in values)


def _shown(column: Field, places: Sequence[int]) -> _Shown:
    cells = tuple(
        each if len(each) <= _LONGEST_TEXT else f"{each[:_LONGEST_TEXT]} .."
        for each in (" ".join(each.split("\n")) for each in _cells(column, places))
    )
    is_text = any(isinstance(column.values[place], str) for place in places)
    return _Shown(column.name, (column.heading,), cells, is_text)


def _broken(name: str, width: int) -> tuple[str, ...]:
    """A name or text on lines no longer than ``width``, if it can be broken after underscores."""
    parts = _parts(name)
    width = max([width, *map(len, parts)])
    lines = [""]
    for part in parts:
        if len(lines[-1]) + len(part) > width:
            lines.append("")
        lines[-1] += part if part != " " or lines[-1] else ""
    return tuple(line.rstrip() for line in lines)


def _parts(name: str) -> list[str]:
    """What stays together when a name or a text is broken."""
    return re.findall(r"[^_ ]+_?|_| ", name)


def _that_fit(columns: Sequence[_Shown], width: int) -> list[_Shown]:
    """The columns that stand beside each other, one at least, headings broken where that helps.

    Where all of them stand if names and short texts are folded too, they are. Else long texts give
    way to the others; of each the first ones are taken.
    """
    if _sum(columns) <= width:
        return list(columns)
    broken = [each.broken() for each in columns]
    taken: list[int] = []
    for of_long in (False, True):
        for i, each in enumerate(broken):
            if each.is_long != of_long:
                continue
            if taken and _sum([broken[j] for j in (*taken, i)]) > width:
                break
            taken.append(i)
    if len(taken) < len(columns) and len(columns[0].cells) <= _MANY:
        folded = [replace(each, folds=True).broken() for each in columns]
        if _sum(folded) <= width:
            return folded
    taken.sort()
    for longest in _HEADINGS:
        kept = [columns[i].broken(longest) for i in taken]
        if _sum(kept) <= width:
            break
    return kept


def _sum(columns: Sequence[_Shown]) -> int:
    return sum(each.least + _GAP for each in columns) - _GAP


def _widths(columns: Sequence[_Shown], width: int) -> list[int]:
    """Widths of columns: what is left over goes to the longest texts, the shorter ones first."""
    widths = [each.least for each in columns]
    left = width - sum(widths) - _GAP * (len(columns) - 1)
    wanting = [i for i, each in enumerate(columns) if each.natural > widths[i]]
    for rank, i in enumerate(sorted(wanting, key=lambda i: columns[i].natural)):
        more = min(columns[i].natural - widths[i], left // (len(wanting) - rank))
        widths[i] += more
        left -= more
    return widths


def _table(
    columns: Sequence[_Shown], widths: Sequence[int], rows: Sequence[int], headed: bool
) -> RenderableType:
    """Rows of columns; many by themselves, where no text is wrapped: rich takes 0.5 ms for each."""
    table = Table(
        box=SIMPLE_HEAD,
        show_edge=False,
        show_header=headed,
        pad_edge=False,
        padding=(0, _GAP - 1, 0, 0),
        header_style="bold",
        border_style="dim",
    )
    height = max(len(each.heading) for each in columns)
    for each, width in zip(columns, widths, strict=True):
        blank = [""] * (height - len(each.heading))
        table.add_column(
            Text("\n".join([*blank, *each.heading])),
            width=width,
            justify="left" if each.is_text else "right",
            overflow="fold",
        )
    if len(rows) > _MANY and not any(each.is_long for each in columns):
        lines = [
            (" " * _GAP).join(
                each.cells[row].ljust(width) if each.is_text else each.cells[row].rjust(width)
                for each, width in zip(columns, widths, strict=True)
            )
            for row in rows
        ]
        return Group(table, *lines)
    for row in rows:
        table.add_row(*(e.cell(row, width) for e, width in zip(columns, widths, strict=True)))
    return table

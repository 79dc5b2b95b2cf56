"""Text for a terminal of any width, with and without colours: words by rich, and tables."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest

import numpy as np
from rich.console import Console
from rich.text import Text

from kinacc.cli.output import plain
from kinacc.cli.sheet import Field, Sheet

_GAP = 2
_NARROWEST = 12  # characters of a text that is broken
_LONGEST_NAME, _LONGEST_TEXT = 40, 300
_DIGITS_OF_LARGEST, _DIGITS_OF_TYPICAL = 5, 3
_MOST_DECIMALS = 7
_NUMERICAL_ZERO = 1e-9  # of the largest in its column
_DECIMALS = {"mm": 3}  # at least, where there are that many: what instruments resolve
_BEYOND = 1e15  # nobody counts so many digits
_MIXED = 1e3  # from the smallest to the largest number of a column that has several units
_NONE = "-"


@dataclass(frozen=True)
class _Column:
    """A column as it is printed. Headings and texts are broken at spaces and underscores."""

    name: str
    heading: str
    cells: tuple[str, ...]
    is_text: bool

    @property
    def natural(self) -> int:
        """Characters of the longest cell or of the heading."""
        return max(map(len, (self.heading, *self.cells)))

    @property
    def is_long(self) -> bool:
        """Whether its texts are sentences, which give way to other columns."""
        return self.is_text and max(map(len, self.cells)) > _LONGEST_NAME

    def least(self, breaks_names: bool) -> int:
        """Characters it cannot do without."""
        if self.is_text and not self.is_long and not breaks_names:
            return max(map(len, (*_parts(self.heading), *self.cells)))
        broken = (self.heading, *self.cells) if self.is_text else (self.heading,)
        parts = [len(part) for text in broken for part in _parts(text)]
        whole = [_NARROWEST] if self.is_text else [*map(len, self.cells)]
        return min(self.natural, max(*parts, *whole))


@dataclass
class Screen:
    """What is to be printed, for the terminal that is there."""

    console: Console
    parts: list[Text] = field(default_factory=list)

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
        head = count if rows is None or count <= rows else rows - rows // 3
        tail = count if head == count else count - (rows or 0) // 3
        columns = [_column(each, [*range(head), *range(tail, count)]) for each in fields]
        kept, widths = _that_fit(columns, self.width)
        self.parts.append(Text("\n".join(_heading(kept, widths)), "bold", no_wrap=True))
        rule = "-" if self.console.options.ascii_only else "─"
        self.parts.append(Text(rule * (sum(widths) + _GAP * (len(widths) - 1)), "dim"))
        self._rows(kept, widths, range(head))
        if head < count:
            self.words(f".. {tail - head:,} more rows (--rows all) ..", "dim")
            self._rows(kept, widths, range(head, head + count - tail))
        if left_out := [each.name for each in columns if each not in kept]:
            self.words(
                f"{self.width} characters are too narrow for {', '.join(left_out)}: "
                f"{option.format(left_out[0])}",
                "dim",
            )

    def _rows(self, columns: Sequence[_Column], widths: Sequence[int], rows: range) -> None:
        lines = [
            line
            for row in rows
            for line in _lines(
                [
                    _broken(each.cells[row], width)
                    for each, width in zip(columns, widths, strict=True)
                ],
                columns,
                widths,
            )
        ]
        if lines:
            self.parts.append(Text("\n".join(lines), no_wrap=True))

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


def _column(column: Field, places: Sequence[int]) -> _Column:
    cells = tuple(
        each if len(each) <= _LONGEST_TEXT else f"{each[:_LONGEST_TEXT]} .."
        for each in (" ".join(each.split("\n")) for each in _cells(column, places))
    )
    is_text = any(isinstance(column.values[place], str) for place in places)
    return _Column(column.name, column.heading, cells, is_text)


def _parts(name: str) -> list[str]:
    """What stays together when a name or a text is broken."""
    return re.findall(r"[^_ ]{1,40}_?|_| ", name) or [""]


def _broken(name: str, width: int) -> list[str]:
    """A name or text on lines no longer than ``width``, if it can be broken so."""
    if len(name) <= width:
        return [name]
    lines = [""]
    for part in _parts(name):
        if lines[-1] and len(lines[-1]) + len(part) > width:
            lines.append("")
        lines[-1] += part if part != " " or lines[-1] else ""
    return [line.rstrip() for line in lines]


def _that_fit(columns: Sequence[_Column], width: int) -> tuple[list[_Column], list[int]]:
    """The first columns that stand beside each other, one at least, and their widths.

    Names are broken where all columns stand then; else sentences give way to other columns.
    """
    every = [each.least(True) for each in columns]
    if sum(every) + _GAP * (len(every) - 1) <= width:
        whole = [each.least(False) for each in columns]
        fits = sum(whole) + _GAP * (len(whole) - 1) <= width
        return list(columns), _widened(columns, whole if fits else every, width)
    taken: dict[int, int] = {}
    for place in sorted(range(len(columns)), key=lambda place: columns[place].is_long):
        needs = columns[place].least(False)
        if taken and sum(taken.values()) + needs + _GAP * len(taken) > width:
            break
        taken[place] = needs
    kept = [columns[place] for place in sorted(taken)]
    return kept, _widened(kept, [taken[place] for place in sorted(taken)], width)


def _widened(columns: Sequence[_Column], least: Sequence[int], width: int) -> list[int]:
    """Widths of columns: what is left over goes to the narrower ones first."""
    widths = list(least)
    left = width - sum(widths) - _GAP * (len(columns) - 1)
    wanting = [i for i, each in enumerate(columns) if each.natural > widths[i]]
    for rank, i in enumerate(sorted(wanting, key=lambda i: columns[i].natural)):
        more = max(0, min(columns[i].natural - widths[i], left // (len(wanting) - rank)))
        widths[i] += more
        left -= more
    return widths


def _heading(columns: Sequence[_Column], widths: Sequence[int]) -> list[str]:
    """Lines of the headings, which end on the last."""
    broken = [_broken(each.heading, width) for each, width in zip(columns, widths, strict=True)]
    height = max(map(len, broken))
    return _lines([[""] * (height - len(each)) + each for each in broken], columns, widths)


def _lines(
    cells: Sequence[Sequence[str]], columns: Sequence[_Column], widths: Sequence[int]
) -> list[str]:
    """Lines of cells beside each other: texts at the left of their column, numbers at the right."""
    return [
        (" " * _GAP).join(
            part.ljust(width) if each.is_text else part.rjust(width)
            for part, each, width in zip(parts, columns, widths, strict=True)
        )
        for parts in zip_longest(*cells, fillvalue="")
    ]

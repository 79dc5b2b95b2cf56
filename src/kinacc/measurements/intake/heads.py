"""Where the names of a file stand above its rows of numbers, and what the lines above state."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate
from operator import itemgetter

from kinacc.measurements.column_names import UNITS, plain
from kinacc.measurements.grid import Cells, Row, filled, header_cells, is_comment, number_of
from kinacc.measurements.intake.decimals import shaped_as_number
from kinacc.measurements.layout import ANGLE, LENGTH
from kinacc.measurements.robot_programs import parts_of

_UNITS = re.compile(
    r"\b(?:units?|einheit(?:en)?|unit[eéà]s?|unidad(?:es)?|単位)\b[^:=\n]{0,20}[:=]\s*([^;\n#]+)"
    r"|\b(?:values|data|coordinates|positions|points|lengths|dimensions|werte|koordinaten|punkte"
    r"|units)\b[^.;\n]{0,20}\bin\s+([^.;\n]{1,30})",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Head:
    """Where the names are.

    ``line`` of the names, 0 where there are none; ``first`` row of numbers among the rows looked
    at; ``under``: rows between; ``width`` of the rows and ``count`` of the numbers in them;
    ``names`` where two lines make them.
    """

    line: int
    first: int
    under: int
    width: int
    count: int
    names: tuple[str, ...] | None


def is_number(cell: object) -> bool:
    """Whether a cell is a number by some marks."""
    if isinstance(cell, str):
        return shaped_as_number(number_of(cell.strip())[0])
    return isinstance(cell, (int, float)) and not isinstance(cell, bool)


def numbers_in(cells: Cells) -> int:
    """How many numbers a row holds, those within cells such as {A1 10, A2 -90} included."""
    return sum(is_number(cell) or len(parts_of(cell)) for cell in cells)


def head_of(rows: Sequence[Row]) -> Head | None:
    """Where the names of the rows are; None where there are no rows of numbers."""
    counts = [0 if is_comment(cells) else numbers_in(cells) for _, cells in rows]
    widths = {number: len(rows[number][1]) for number, count in enumerate(counts) if count > 1}
    totals = Counter[int]()
    for number, width in widths.items():
        totals[width] += counts[number]
    if not totals:
        return None
    width, count = max(totals.items(), key=itemgetter(1, 0))
    many = [number for number in widths if widths[number] == width]
    usual = sorted(counts[number] for number in many)[len(many) // 2]
    first = next(number for number in many if 2 * counts[number] >= usual)
    above = [n for n in range(first) if _can_name(rows[n][1], rows[first][1], width)]
    under = 0
    while above and _are_units(rows[above[-1]][1]):
        above.pop()
        under += 1
    if not above:
        return Head(0, first, 0, width, count, _in_remark(rows[:first], width))
    names_in = {number: len(filled(rows[number][1])) for number in above}
    place = max(number for number in above if 2 * names_in[number] >= max(names_in.values()))
    line, cells = rows[place][0], header_cells(rows[place][1], width)
    over = rows[place - 1][1] if place else []
    names = None
    if len({*filled(cells)}) < len(filled(cells)) and not is_comment(over):
        # Names under those of groups: Measured over X, Y, Z.
        texts = [str(cell).strip() for cell in (*over, *[""] * width)]
        groups: Iterator[str] = accumulate(texts, lambda before, text: text or before)
        both = [f"{group} {name}".strip() for group, name in zip(groups, cells, strict=False)]
        names = tuple(both) if len({*both}) == len(both) else None
    return Head(line, first, under, width, count, names)


def _in_remark(rows: Sequence[Row], width: int) -> tuple[str, ...] | None:
    """Names that stand behind a sign of remarks in the last lines above the numbers."""
    for _, cells in rows[::-1][:3]:
        if not is_comment(cells):
            continue
        first = cells[0].lstrip(" #%/!")
        names = header_cells([first, *cells[1:]] if first else cells[1:], width)
        # The sign by itself may be the name of a column of numbers.
        names = cells if not first and len(names) < width == len(cells) else names
        names = [name.strip() for name in names]
        if len({*names}) == len(names) == width and all(names) and not numbers_in(names):
            return tuple(names)
    return None


def _can_name(cells: Cells, numbers: Cells, width: int) -> bool:
    if not filled(cells) or is_comment(cells) or numbers_in(cells) > 1:
        return False
    count = max(place + 1 for place, cell in enumerate(cells) if filled([cell]))
    fits = len(header_cells(cells, width)) == width
    return fits or count in (width, width - (not filled(numbers[-1:])))


def _are_units(cells: Cells) -> bool:
    texts = [str(cell).strip() for cell in cells if str(cell).strip("-/ ")]
    units = [plain(text.strip("[](){}<> ")) for text in texts]
    return bool(texts) and all(unit in UNITS or unit == "in" for unit in units)


def stated_above(texts: Iterable[str]) -> dict[str, str]:
    """Units of lengths and angles that the lines around the rows state."""
    stated: dict[str, str] = {}
    for text in texts:
        for match in _UNITS.finditer(text):
            for word in map(plain, re.findall(r"[^\W\d_]+|°", match[1] or match[2])):
                unit = "inch" if word == "in" else UNITS.get(word, "")
                unit = word if unit == "?" else unit
                if unit in (*LENGTH, "µm"):
                    stated.setdefault("length", unit)
                elif unit in (*ANGLE, "gon", "mrad"):
                    stated.setdefault("angle", unit)
    return stated

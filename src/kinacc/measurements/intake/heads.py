"""Where the names of a file stand above its rows of numbers, and what the lines above them say."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from kinacc.measurements.column_names import UNITS, plain
from kinacc.measurements.grid import Row, header_cells, is_blank, is_comment, number_of
from kinacc.measurements.intake.decimals import shaped_as_number
from kinacc.measurements.robot_programs import numbers_within

_UNITS = re.compile(
    r"\b(?:units?|einheit(?:en)?|unit[eéà]s?|unidad(?:es)?|単位)\b[^:=\n]{0,20}[:=]\s*([^;\n#]+)",
    re.IGNORECASE,
)
_IN_UNITS = re.compile(
    r"\b(?:values|data|coordinates|positions|points|lengths|dimensions|werte|koordinaten|punkte)\b"
    r"[^.;\n]{0,20}\bin\s+([^.;\n]{1,30})",
    re.IGNORECASE,
)
_FRAME = re.compile(
    r"\b(?:working frame|coordinate (?:frame|system)|frame|koordinatensystem|bezugssystem)\b"
    r"\s*[:=]\s*([^\n;]+)",
    re.IGNORECASE,
)
_WORD = re.compile(r"[^\W\d_]+|°")
_LENGTHS, _ANGLES = ("mm", "m", "cm", "µm", "inch"), ("deg", "rad", "gon", "mrad")


@dataclass(frozen=True)
class Head:
    """Where the names are.

    ``line`` of the names, 0 where there are none; ``first`` row of numbers among the rows looked
    at; ``under``: rows between; ``width`` of the rows; ``names`` where two lines make them.
    """

    line: int
    first: int
    under: int
    width: int
    names: tuple[str, ...] | None = None


def is_number(cell: object) -> bool:
    """Whether a cell is a number by some marks."""
    if isinstance(cell, str):
        return shaped_as_number(number_of(cell.strip())[0])
    return isinstance(cell, (int, float)) and not isinstance(cell, bool)


def numbers_in(cells: Sequence) -> int:
    """How many numbers a row holds, those within cells such as {A1 10, A2 -90} included."""
    return sum(is_number(cell) or numbers_within(cell) for cell in cells)


def head_of(rows: Sequence[Row], delimiter: str, sheet: bool = False) -> Head | None:
    """Where the names of the rows are; None where there are no rows of numbers.

    ``sheet``: the rows are those of a sheet, of any width.
    """
    counts = [0 if is_blank(cells) else numbers_in(cells) for _, cells in rows]
    remarks = [count > 1 and is_comment(cells, delimiter)
               for count, (_, cells) in zip(counts, rows, strict=True)]  # fmt: skip
    if 2 * sum(remarks) < sum(count > 1 for count in counts):  # else the points are called so
        counts = [0 if out else count for count, out in zip(counts, remarks, strict=True)]
    many = [number for number, count in enumerate(counts) if count > 1]
    if not many:
        return None
    if sheet:
        width = max(len(rows[number][1]) for number in many)
    else:
        width = Counter(len(rows[number][1]) for number in many).most_common(1)[0][0]
        many = [number for number in many if len(rows[number][1]) == width]
    usual = sorted(counts[number] for number in many)[len(many) // 2]
    first = next(number for number in many if 2 * counts[number] >= usual)
    above = [
        number
        for number in range(first)
        if _can_name(rows[number][1], rows[first][1], width, delimiter, sheet)
        and numbers_in(header_cells(rows[number][1], width)) <= 1
    ]
    units = 0
    while above and _are_units(rows[above[-1]][1]):
        above.pop()
        units += 1
    if not above:
        return Head(0, first, 0, width, _in_remark(rows[:first], width, delimiter))
    filled = {number: sum(not is_blank([c]) for c in rows[number][1]) for number in above}
    names = max(number for number in above if 2 * filled[number] >= max(filled.values()))
    cells = header_cells(rows[names][1], width)
    told = [name for name in cells if name]
    over = header_cells(rows[names - 1][1], width) if names else []
    if over and _are_units(over) and len(over) == width == len(cells):
        joined = [f"{n} [{u}]" if u.strip("-/ ") else n for n, u in zip(cells, over, strict=True)]
        return Head(rows[names][0], first, units, width, tuple(joined))
    if len(set(told)) < len(told) and over and not is_comment(rows[names - 1][1], delimiter):
        grouped = list(filter(None, over))
        if len(set(grouped)) == len(grouped) == len(told):
            return Head(rows[names - 1][0], first, units + 1, width)
        joined = _joined(over, cells)
        if grouped and len(set(joined)) == len(joined):
            return Head(rows[names][0], first, units, width, tuple(joined))
    return Head(rows[names][0], first, units, width)


def _in_remark(rows: Sequence[Row], width: int, delimiter: str) -> tuple[str, ...] | None:
    """Names that stand behind a sign of remarks in the last line above the numbers."""
    for _, cells in rows[::-1][:3]:
        if not isinstance(cells[0] if cells else None, str) or not is_comment(cells, delimiter):
            continue
        first = cells[0].lstrip(" #%/!")
        names = header_cells([first, *cells[1:]] if first else cells[1:], width)
        # The sign by itself is what a column of numbers is called.
        names = cells if not first and len(names) < width == len(cells) else names
        names = [name.strip() for name in names]
        if len(names) == width and all(names) and not numbers_in(names):
            return tuple(names) if len(set(names)) == width else None
    return None


def _can_name(cells: list, numbers: list, width: int, delimiter: str, sheet: bool) -> bool:
    if is_blank(cells) or is_comment(cells, delimiter):
        return False
    if sheet:
        beside = [
            place for place, cell in enumerate(numbers) if cell is not None and place < len(cells)
        ]
        named = sum(isinstance(cells[place], str) for place in beside)
        return 2 * named >= sum(cell is not None for cell in numbers)
    if len(header_cells(cells, width)) == width:
        return True
    filled = len(cells)
    while filled and not cells[filled - 1].strip():
        filled -= 1
    blank_end = not numbers[-1].strip() if isinstance(numbers[-1], str) else False
    return filled in (width, width - blank_end)


def _are_units(cells: Sequence) -> bool:
    filled = [str(cell).strip() for cell in cells if cell is not None and str(cell).strip("-/ ")]
    return bool(filled) and all(plain(cell.strip("[](){}<> ")) in UNITS for cell in filled)


def _joined(over: Sequence[str], names: Sequence[str]) -> list[str]:
    """Names under those of groups of columns: Measured over X, Y, Z."""
    told, group = [], ""
    for place, name in enumerate(names):
        group = over[place] if place < len(over) and over[place] else group
        told.append(f"{group} {name}".strip())
    return told


def stated_above(texts: Sequence[str]) -> dict[str, str]:
    """Units of lengths and angles, and the frame, that the lines around the rows state."""
    found: dict[str, str] = {}
    for text in texts:
        for listed in (*_UNITS.findall(text), *_IN_UNITS.findall(text)):
            for word in _WORD.findall(listed):
                unit = UNITS.get(plain(word), "")
                unit = plain(word) if unit == "?" else unit
                unit = "inch" if plain(word) == "in" else unit
                for kind, known in (("length", _LENGTHS), ("angle", _ANGLES)):
                    if unit in known:
                        found.setdefault(kind, unit)
        if frame := _FRAME.search(text):
            found.setdefault("frame", frame[1].strip(" ,\t\"'"))
    return found

"""Which mark stands before the decimals, and which between thousands, by all cells of a file."""

from __future__ import annotations

import re
from collections.abc import Iterable

from kinacc.measurements.column_names import name_of
from kinacc.measurements.intake.choices import Answers, Choice, Undecided
from kinacc.measurements.table import RawTable

_BLANK = "[ \u00a0\u2007\u2009\u202f]"
_BETWEEN = {" ": _BLANK, "'": "['\u2019]", ",": ",", ".": r"\."}
_MOST_DEG = 7200  # no joint turns further
_HUGE = re.compile(r"\d(?:[.,]\d+)?E\+?[1-9]\d", re.IGNORECASE)  # 2,02103E+13: no length or angle
_SHAPED = re.compile(
    rf"[+\-−]?(?:\d+(?:(?:{_BLANK}|[.,'\u2019])\d+)*[.,]?|[.,]\d+)(?:[eE][+\-−]?\d+)?"
)
# Cells with mark m (and the other mark o).
_DECIMAL = (  # no thousands are written so
    r"(?:\d{4,}m\d*|0\d*m\d*|m\d+|\d+m(?:\d{1,2}|\d{4,})?)(?:[eE][+\-−]?\d+)?|\d+m\d*[eE][+\-−]?\d+"
)
_GROUPED = r"\d{1,3}(?:m\d{3}){2,}"  # no decimals are written so
_BOTH = r"\d{1,3}(?:m\d{3})+o\d*"  # thousands by m, decimals by o
_EITHER = r"[1-9]\d{0,2}m\d{3}"


def shaped_as_number(cell: str) -> bool:
    """Whether a text is a number by some marks."""
    return bool(_SHAPED.fullmatch(cell))


def _first(text: str, mark: str, *shapes: str, other: str = ".") -> str:
    """The first line of a text of one of these shapes, empty for none."""
    shape = "|".join(shapes).replace("m", _BETWEEN[mark]).replace("o", _BETWEEN[other])
    match = re.search(_BETWEEN[mark], text)
    match = match and re.search(rf"^[+\-−]?(?:{shape})$", text, re.MULTILINE)
    return match[0].strip() if match else ""


def marks_of(table: RawTable, answers: Answers, delimiter: str) -> tuple[str, str | None]:
    """The two marks of the text cells of a table. Raises Undecided where one is open.

    ``answers``: decimal and thousands as answered. ``delimiter`` parts the columns.
    """
    by_column = {str(name): _text(cells) for name, cells in table.columns.items()}
    text = "\n".join(filter(None, by_column.values()))
    decisive: dict[str, str] = {}
    for mark, other in (",.", ".,"):
        cells = [_first(text, mark, _DECIMAL), _first(text, other, _GROUPED)]
        cells += [_first(text, between, _BOTH, other=mark) for between in (other, " ", "'")]
        decisive |= {mark: next(filter(None, cells))} if any(cells) else {}
    decimal = answers.get("decimal") or "".join(decisive)
    if len(decimal) > 1:
        about = "some numbers have a decimal point, some a decimal comma; one kind can be read"
        meant = {mark: f"as in {decisive[mark]}" for mark in decisive}
        raise Undecided(table.path, Choice("--decimal", about, meant))
    if not decimal and delimiter == "," and "," not in text:
        decimal = "."  # nobody writes thousands alone by points, between commas
    if not decimal:
        whole = re.search(r"^[+\-−]?[1-9]\d{0,2}$", text, re.MULTILINE)
        unclear = _first(text, ",", _EITHER) or (_first(text, ".", _EITHER) if whole else "")
        decimal, point = ",." if "," in unclear else ".,"
        angles = [by_column[name] for name in by_column if name_of(name).unit == "deg"]
        large = [cell for cell in "\n".join(angles).split("\n") if _first(cell, decimal, _EITHER)]
        # No joint turns by thousands of degrees.
        if unclear and all(int(re.sub(r"\D", "", cell)) <= _MOST_DEG for cell in large):
            meant = {decimal: f"{unclear} is {unclear.replace(decimal, '.')}",
                     point: f"{unclear} is {unclear.replace(decimal, '')}"}  # fmt: skip
            about = f"{unclear} may have decimals or thousands"
            raise Undecided(table.path, Choice("--decimal", about, meant))
    if "thousands" in answers:
        return decimal, None if answers["thousands"] == "none" else answers["thousands"]
    thousands = "," if decimal == "." else "."
    if "decimal" in answers and _first(text, thousands, _EITHER):
        return decimal, thousands  # by the answer it stands between thousands
    for mark in [m for m in _BETWEEN if m != decimal and not (m == " " and delimiter == "blanks")]:
        # Blanks and apostrophes stand between thousands alone.
        alone = [_EITHER] if mark in " '" else []
        if _first(text, mark, *alone, _GROUPED, _BOTH, other=decimal):
            return decimal, mark
    if cell := _first(text, thousands, _EITHER):
        about = f"the cell {cell} stands where the decimal mark of the file is {decimal}"
        meant = {thousands: f"{cell} is {cell.replace(thousands, '')}", "none": "it is an error"}
        raise Undecided(table.path, Choice("--thousands", about, meant))
    return decimal, None


def _text(cells: Iterable[object]) -> str:
    """Cells that are text, a line each; a column of names and rounded time stamps are left out."""
    texts = [cell.strip() for cell in cells if isinstance(cell, str)]
    texts = [text for text in texts if text and not _HUGE.fullmatch(text)]
    numeric = sum(map(shaped_as_number, texts[:200]))
    return "\n".join(texts) if numeric and 2 * numeric >= len(texts[:200]) else ""

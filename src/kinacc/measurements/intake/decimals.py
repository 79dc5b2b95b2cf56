"""Which mark stands before the decimals, and which between thousands, by all cells of a file."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from kinacc.measurements.column_names import name_of
from kinacc.measurements.intake.choices import Choice

_ENDS = (",", ".")
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


def marks_of(
    columns: Mapping[str, Sequence], answers: Mapping[str, str], blanks_part: bool = False
) -> tuple[str, str | None, Choice | None]:
    """The two marks of the text cells of a table, or the question to ask first.

    ``answers``: decimal and thousands as answered. ``blanks_part``: blanks part the columns.
    """
    by_column = {str(name): _text(columns[name]) for name in columns}
    text = "\n".join(filter(None, by_column.values()))

    def first(shape: str, sign: str, after: str = ".", among: str = text) -> str:
        if not re.search(_BETWEEN[sign], among):
            return ""
        shape = shape.replace("m", _BETWEEN[sign]).replace("o", _BETWEEN[after])
        match = re.search(rf"^[+\-−]?(?:{shape})$", among, re.MULTILINE)
        return match[0].strip() if match else ""

    decisive = {}
    for sign, thousands in (_ENDS, _ENDS[::-1]):
        both = [first(_BOTH, between, sign) for between in (thousands, " ", "'")]
        cells = (first(_DECIMAL, sign), first(_GROUPED, thousands), *both)
        decisive |= {sign: next(filter(None, cells))} if any(cells) else {}
    decimal = answers.get("decimal") or "".join(decisive)
    if len(decimal) > 1:
        about = "some numbers have a decimal point, some a decimal comma; one kind can be read"
        return ".", None, Choice("--decimal", about, {m: f"as in {decisive[m]}" for m in _ENDS})
    if not decimal:
        angles = "\n".join(t for name, t in by_column.items() if name_of(name).unit == "deg")
        whole = re.search(r"^[+\-−]?[1-9]\d{0,2}$", text, re.MULTILINE)
        unclear = first(_EITHER, ",") or (whole and first(_EITHER, ".")) or ""
        decimal, point = (",", ".") if "," in unclear else (".", ",")
        large = [cell for cell in angles.split("\n") if first(_EITHER, decimal, among=cell)]
        # No joint turns by thousands of degrees.
        if unclear and all(int(re.sub(r"\D", "", cell)) <= _MOST_DEG for cell in large):
            meant = {decimal: f"{unclear} is {unclear.replace(decimal, '.')}",
                     point: f"{unclear} is {unclear.replace(decimal, '')}"}  # fmt: skip
            about = f"{unclear} may have decimals or thousands"
            return ".", None, Choice("--decimal", about, meant)
    if "thousands" in answers:
        return decimal, None if answers["thousands"] == "none" else answers["thousands"], None
    thousands = "," if decimal == "." else "."
    if "decimal" in answers and first(_EITHER, thousands):
        return decimal, thousands, None  # by the answer it stands between thousands
    marks = [m for m in _BETWEEN if m != decimal and not (m == " " and blanks_part)]
    for sign in marks:
        # Blanks and apostrophes stand between thousands alone.
        alone = sign not in _ENDS and first(_EITHER, sign)
        if alone or first(_GROUPED, sign) or first(_BOTH, sign, decimal):
            return decimal, sign, None
    if cell := first(_EITHER, thousands):
        about = f"the cell {cell} stands where the decimal mark of the file is {decimal}"
        meant = {thousands: f"{cell} is {cell.replace(thousands, '')}", "none": "it is an error"}
        return decimal, None, Choice("--thousands", about, meant)
    return decimal, None, None


def _text(cells: Sequence) -> str:
    """Cells that are text, a line each; a column of names and rounded time stamps are left out."""
    texts = [cell.strip() for cell in cells if isinstance(cell, str)]
    texts = [text for text in texts if text and not _HUGE.fullmatch(text)]
    numeric = sum(map(shaped_as_number, texts[:200]))
    return "\n".join(texts) if numeric and 2 * numeric >= len(texts[:200]) else ""

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
    columns: Mapping[str, Sequence], given: Mapping[str, str], blanks_part: bool = False
) -> tuple[str, str | None, Choice | None]:
    """The two marks of the text cells of a table, or the question to ask first.

    ``given``: decimal and thousands as answered.
    """
    by_column = {str(name): _text(columns[name]) for name in columns}
    text = "\n".join(filter(None, by_column.values()))

    def first(shape: str, mark: str, other: str = ".", among: str = text) -> str:
        shape = shape.replace("m", _BETWEEN[mark]).replace("o", _BETWEEN[other])
        match = re.search(rf"^[+\-−]?(?:{shape})$", among, re.MULTILINE)
        return match[0].strip() if match else ""

    decisive = {}
    for mark, other in (_ENDS, _ENDS[::-1]):
        both = [first(_BOTH, between, mark) for between in (other, " ", "'")]
        if cell := next(filter(None, (first(_DECIMAL, mark), first(_GROUPED, other), *both)), ""):
            decisive[mark] = cell
    decimal = given.get("decimal") or "".join(decisive)
    if len(decimal) > 1:
        about = "some numbers have a decimal point, some a decimal comma; one kind can be read"
        return ".", None, Choice("--decimal", about, {m: f"as in {decisive[m]}" for m in _ENDS})
    if not decimal:
        angles = "\n".join(t for name, t in by_column.items() if name_of(name).unit == "deg")
        whole = re.search(r"^[+\-−]?[1-9]\d{0,2}$", text, re.MULTILINE)
        unclear = first(_EITHER, ",") or (whole and first(_EITHER, ".")) or ""
        mark = "," if "," in unclear else "."
        large = [cell for cell in angles.split("\n") if first(_EITHER, mark, among=cell)]
        if not unclear or any(int(re.sub(r"\D", "", cell)) > _MOST_DEG for cell in large):
            decimal = mark  # no joint turns by thousands of degrees
        else:
            answers = {mark: f"{unclear} is {unclear.replace(mark, '.')}"}
            answers["." if mark == "," else ","] = f"{unclear} is {unclear.replace(mark, '')}"
            about = f"{unclear} may have decimals or thousands"
            return ".", None, Choice("--decimal", about, answers)
    if "thousands" in given:
        return decimal, None if given["thousands"] == "none" else given["thousands"], None
    other = "," if decimal == "." else "."
    if "decimal" in given and first(_EITHER, other):
        return decimal, other, None  # by the answer it stands between thousands
    marks = [m for m in _BETWEEN if m != decimal and not (m == " " and blanks_part)]
    for mark in marks:
        if first(_GROUPED, mark) or first(_BOTH, mark, decimal):
            return decimal, mark, None
        if mark not in _ENDS and first(_EITHER, mark):
            return decimal, mark, None  # blanks and apostrophes stand between thousands alone
    if other in marks and (cell := first(_EITHER, other)):
        about = f"the cell {cell} stands where the decimal mark of the file is {decimal}"
        answers = {other: f"{cell} is {cell.replace(other, '')}", "none": "it is an error"}
        return decimal, None, Choice("--thousands", about, answers)
    return decimal, None, None


def _text(cells: Sequence) -> str:
    """Cells that are text, a line each; a column of names and rounded time stamps are left out."""
    texts = [cell.strip() for cell in cells if isinstance(cell, str)]
    texts = [text for text in texts if text and not _HUGE.fullmatch(text)]
    numeric = sum(map(shaped_as_number, texts[:200]))
    return "\n".join(texts) if numeric and 2 * numeric >= len(texts[:200]) else ""

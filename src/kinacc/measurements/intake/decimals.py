"""Which mark stands before the decimals, and which between thousands, by all cells of a file."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache

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
_SHAPES = {  # of a cell with mark m
    # No thousands are written so.
    "decides": r"(?:\d{4,}m\d*|0\d*m\d*|m\d+|\d+m(?:\d{1,2}|\d{4,})?)(?:[eE][+\-−]?\d+)?"
    r"|\d+m\d*[eE][+\-−]?\d+",
    "grouped": r"\d{1,3}(?:m\d{3}){2,}",  # no decimals are written so
    "both": r"\d{1,3}(?:m\d{3})+o\d*",  # thousands by the mark, decimals by the other
    "open": r"[1-9]\d{0,2}m\d{3}",
}


def shaped_as_number(cell: str) -> bool:
    """Whether a text is a number by some marks."""
    return bool(_SHAPED.fullmatch(cell))


def marks_of(
    columns: Mapping[str, Sequence], given: Mapping[str, str], blanks_part: bool = False
) -> tuple[str, str | None, Choice | None]:
    """The two marks of the text cells of a table, or what has to be asked first.

    ``given``: decimal and thousands as answered.
    """
    texts = {str(name): _text(columns[name]) for name in columns}
    texts = {name: text for name, text in texts.items() if text}
    decided = {m: cell for m in _ENDS if (cell := _decides(m, texts))}
    decimal = given.get("decimal") or "".join(decided)
    if len(decimal) > 1:
        about = "some numbers have a decimal point, some a decimal comma; one kind can be read"
        return ".", None, Choice("--decimal", about, {m: f"as in {decided[m]}" for m in _ENDS})
    if not decimal:
        commas = [name for name, text in texts.items() if _search("open", ",", text)]
        points = [name for name, text in texts.items() if _search("open", ".", text)
                  and re.search(r"^[+\-−]?[1-9]\d{0,2}$", text, re.MULTILINE)]  # fmt: skip
        decimal = _by_angles(texts) if commas or points else "."
        if not decimal:
            mark, name = (",", commas[0]) if commas else (".", points[0])
            cell = _search("open", mark, texts[name])
            answers = {mark: f"{cell} is {cell.replace(mark, '.')}"}
            answers["." if mark == "," else ","] = f"{cell} is {cell.replace(mark, '')}"
            about = f"column {name} does not tell whether {cell} has decimals or thousands"
            return ".", None, Choice("--decimal", about, answers)
    if "thousands" in given:
        return decimal, None if given["thousands"] == "none" else given["thousands"], None
    other = "," if decimal == "." else "."
    if "decimal" in given and any(_search("open", other, text) for text in texts.values()):
        return decimal, other, None  # by the answer it stands between thousands
    marks = [m for m in _BETWEEN if m != decimal and not (m == " " and blanks_part)]
    for mark in marks:
        if any(_search("grouped", mark, t) or _search("both", mark, t, decimal)
               for t in texts.values()):  # fmt: skip
            return decimal, mark, None
    for mark in marks:
        cells = {n: cell for n, text in texts.items() if (cell := _search("open", mark, text))}
        for name, cell in cells.items():
            if mark not in _ENDS:  # blanks and apostrophes stand between thousands, nowhere else
                return decimal, mark, None
            about = f"column {name} holds {cell} where the decimal mark of the file is {decimal}"
            answers = {mark: f"{cell} is {cell.replace(mark, '')}", "none": "it is a slip"}
            return decimal, None, Choice("--thousands", about, answers)
    return decimal, None, None


def _text(cells: Sequence) -> str:
    """Cells that are text, a line each; a column of names and rounded time stamps are left out."""
    told = [each.strip() for each in cells if isinstance(each, str)]
    told = [each for each in told if each and not _HUGE.fullmatch(each)]
    numeric = sum(map(shaped_as_number, told[:200]))
    return "\n".join(told) if numeric and 2 * numeric >= len(told[:200]) else ""


@cache
def _pattern(kind: str, mark: str, other: str = ".") -> re.Pattern:
    shape = _SHAPES[kind].replace("m", _BETWEEN[mark]).replace("o", _BETWEEN[other])
    return re.compile(rf"^[+\-−]?(?:{shape})$", re.MULTILINE)


def _search(kind: str, mark: str, text: str, other: str = ".") -> str:
    found = _pattern(kind, mark, other).search(text)
    return found[0].strip() if found else ""


def _decides(mark: str, texts: Mapping[str, str]) -> str:
    """A cell that can only be read with the mark before decimals."""
    other = "." if mark == "," else ","
    for text in texts.values():
        if mark in text or other in text:
            grouped = [_search("both", each, text, mark) for each in (other, " ", "'")]
            tried = [_search("decides", mark, text), _search("grouped", other, text), *grouped]
            if found := next(filter(None, tried), ""):
                return found
    return ""


def _by_angles(texts: Mapping[str, str]) -> str:
    """The mark that stands before decimals because joints do not turn by thousands of degrees."""
    for mark in _ENDS:
        for name, text in texts.items():
            cells = _pattern("open", mark).findall(text) if name_of(name).unit == "deg" else ()
            if any(float(re.sub(r"\D", "", cell)) > _MOST_DEG for cell in cells):
                return mark
    return ""

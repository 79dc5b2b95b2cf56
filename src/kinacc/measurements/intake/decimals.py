"""Which mark stands before the decimals, and which between thousands, by all cells of a file."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

from kinacc.measurements.column_names import name_of
from kinacc.measurements.intake.choices import Choice

_ENDS = (",", ".")
_BLANK = "[ \u00a0\u2007\u2009\u202f]"
_AS_TEXT = {" ": " \u00a0\u2007\u2009\u202f", "'": "'\u2019", ",": ",", ".": "."}
_BETWEEN = {" ": _BLANK, "'": "['\u2019]", ",": ",", ".": r"\."}


@dataclass(frozen=True)
class Marks:
    """The two marks, and the choices that are left where the cells do not tell them."""

    decimal: str
    thousands: str | None = None
    choices: tuple[Choice, ...] = ()


def marks_of(
    columns: Mapping[str, Sequence], given: Mapping[str, str], blanks_part: bool = False
) -> Marks:
    """The marks of the text cells of a table; ``given``: decimal and thousands as answered."""
    texts = {name: _text(cells) for name, cells in columns.items()}
    texts = {name: text for name, text in texts.items() if text}
    decimal = given.get("decimal") or _decimal(texts)
    if decimal == "both":
        return Marks(".", choices=(_both(texts),))
    if not decimal:
        open_ = [name for name, text in texts.items() if _search("open", ",", text)]
        points = [name for name, text in texts.items() if _search("open", ".", text)]
        mixed = [n for n in points if _whole(texts[n])]
        if not open_ and not mixed:
            return _with_thousands(texts, ".", given, blanks_part)
        if mark := _by_angles(texts):
            return _with_thousands(texts, mark, given, blanks_part)
        name = (open_ or mixed)[0]
        return Marks(".", choices=(_either(name, texts[name], "," if open_ else "."),))
    return _with_thousands(texts, decimal, given, blanks_part)


def _with_thousands(texts, decimal: str, given: Mapping[str, str], blanks_part: bool) -> Marks:
    if "thousands" in given:
        return Marks(decimal, None if given["thousands"] == "none" else given["thousands"])
    other = "," if decimal == "." else "."
    if "decimal" in given and any(_search("open", other, text) for text in texts.values()):
        return Marks(decimal, other)  # the other mark stands between thousands, by the answer
    marks = [m for m in _BETWEEN if m != decimal and not (m == " " and blanks_part)]
    proven = [m for m in marks if any(_proves(m, decimal, text) for text in texts.values())]
    if proven:
        return Marks(decimal, proven[0])
    for mark in marks:
        for name, text in texts.items():
            if (found := _search("open", mark, text)) and mark in _ENDS:
                return Marks(decimal, None, (_thousands(name, found, mark, decimal),))
            if found:  # blanks and apostrophes stand between thousands, and nowhere else
                return Marks(decimal, mark)
    return Marks(decimal)


def _text(cells: Sequence) -> str:
    """Cells that are text, a line each; a column of names and rounded time stamps are left out."""
    told = [each.strip() for each in cells if isinstance(each, str)]
    text = "\n".join([each for each in told if not _HUGE.fullmatch(each)])
    head = [each.strip() for each in text[:2000].split("\n")[:-1] or text.split("\n")]
    numeric = sum(bool(_SHAPED.fullmatch(each)) for each in head)
    return text if 2 * numeric >= sum(map(bool, head)) and numeric else ""


_MOST_DEG = 7200  # no joint turns further
_HUGE = re.compile(r"\d(?:[.,]\d+)?E\+?[1-9]\d", re.IGNORECASE)  # 2,02103E+13: no length or angle
_SHAPED = re.compile(
    rf"[+\-−]?(?:\d+(?:(?:{_BLANK}|[.,'\u2019])\d+)*[.,]?|[.,]\d+)(?:[eE][+\-−]?\d+)?"
)


def shaped_as_number(cell: str) -> bool:
    """Whether a text is a number by some marks."""
    return bool(_SHAPED.fullmatch(cell))


@cache
def _pattern(kind: str, mark: str, other: str = "") -> re.Pattern:
    m, start, end = _BETWEEN[mark], r"^[+\-−]?", "$"
    if kind == "decides":  # no thousands are written so
        shapes = rf"(?:\d{{4,}}{m}\d*|0\d*{m}\d*|{m}\d+|\d+{m}(?:\d{{1,2}}|\d{{4,}})?)"
        shapes = rf"(?:{shapes}(?:[eE][+\-−]?\d+)?|\d+{m}\d*[eE][+\-−]?\d+)"
    elif kind == "grouped":  # no decimals are written so
        shapes = rf"\d{{1,3}}(?:{m}\d{{3}}){{2,}}"
    elif kind == "both":  # thousands by the mark, decimals by the other
        shapes = rf"\d{{1,3}}(?:{m}\d{{3}})+{_BETWEEN[other]}\d*"
    else:  # open
        shapes = rf"[1-9]\d{{0,2}}{m}\d{{3}}"
    return re.compile(start + shapes + end, re.MULTILINE)


def _search(kind: str, mark: str, text: str, other: str = "") -> str:
    if not any(each in text for each in _AS_TEXT[mark]) or (other and other not in text):
        return ""
    found = _pattern(kind, mark, other).search(text)
    return found[0].strip() if found else ""


def _proves(mark: str, decimal: str, text: str) -> bool:
    """Whether a cell can only be read with the mark between thousands."""
    return bool(_search("grouped", mark, text) or _search("both", mark, text, decimal))


def _decimal(texts: Mapping[str, str]) -> str:
    """The decimal mark that a cell proves; "both", or empty where none does."""
    said = set()
    for mark, other in ((",", "."), (".", ",")):
        for text in texts.values():
            if (
                _search("decides", mark, text)
                or _search("grouped", other, text)
                or any(_search("both", each, text, mark) for each in (other, " ", "'"))
            ):
                said.add(mark)
                break
    if not said and not any(mark in text for mark in _ENDS for text in texts.values()):
        return "."
    return "both" if len(said) > 1 else next(iter(said), "")


def _by_angles(texts: Mapping[str, str]) -> str:
    """The mark that stands before decimals because joints do not turn by thousands of degrees."""
    for mark in _ENDS:
        for name, text in texts.items():
            cells = _pattern("open", mark).findall(text) if name_of(name).unit == "deg" else ()
            if any(float(re.sub(r"\D", "", cell)) > _MOST_DEG for cell in cells):
                return mark
    return ""


def _whole(text: str) -> bool:
    """Whether a column has numbers without a mark too, of less than four digits, not all 0."""
    return bool(re.search(r"^[+\-−]?[1-9]\d{0,2}$", text, re.MULTILINE))


def _either(name: str, text: str, mark: str) -> Choice:
    cell = _search("open", mark, text)
    other = "." if mark == "," else ","
    whole, parted = cell.replace(mark, ""), cell.replace(mark, ".")
    return Choice(
        "--decimal",
        f"column {name} does not tell whether {cell} has decimals or thousands",
        {mark: f"{cell} is {parted}", other: f"{cell} is {whole}"},
    )


def _both(texts: Mapping[str, str]) -> Choice:
    found = {}
    for mark in _ENDS:
        for name, text in texts.items():
            if cell := _search("decides", mark, text):
                found[mark] = f"as in {cell} of column {name}"
                break
    return Choice(
        "--decimal",
        "some numbers have a decimal point, some a decimal comma; one kind can be read",
        {mark: found.get(mark, "as in other columns") for mark in _ENDS},
    )


def _thousands(name: str, cell: str, mark: str, decimal: str) -> Choice:
    whole = cell.replace(mark, "")
    return Choice(
        "--thousands",
        f"column {name} holds {cell} where the decimal mark of the file is {decimal}",
        {mark: f"{cell} is {whole}", "none": f"{cell} is a slip, and is refused"},
    )

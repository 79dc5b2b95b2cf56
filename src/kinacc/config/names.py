"""Names that people give: what they may consist of, and how Markdown and CSV take them as text."""

from __future__ import annotations

import re
import unicodedata

from kinacc.errors import Problem

LONGEST = 100  # a file name has at most 255 bytes, and others are made of it
# An underscore inside a word, as in ur10_b, is no mark of Markdown.
_MARKS = re.compile(r"[\\`*\[\]<>|~$]|(?<![^\W_])_|_(?![^\W_])|&(?=#?\w+;)")
# A spreadsheet takes a cell that begins so for a formula; a number may begin with its sign.
_FORMULA = re.compile(r"'*[=+\-@＝＋－＠\t\r\n]")
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")


def not_in_a_line(where: str, name: str) -> list[Problem]:
    """The problem with a name that does not stand in a line of text."""
    if name.strip() and not any(map(_unseen, name)):
        return []
    return [Problem(where, f"{name!r} cannot be a name", "text on one line, without control marks")]


def in_markdown(text: str) -> str:
    """Text that Markdown shows as it is, within a line, a cell of a table or a heading."""
    line = "".join(" " if _unseen(item) else item for item in text)
    return _MARKS.sub(r"\\\g<0>", line)


def in_csv(text: str) -> str:
    """Text that no spreadsheet takes for a formula: an apostrophe before what would be one."""
    return f"'{text}" if _FORMULA.match(text) and not _NUMBER.fullmatch(text) else text


def of_csv(cell: str) -> str:
    """The text that ``in_csv`` wrote."""
    return cell[1:] if cell.startswith("'") and in_csv(cell[1:]) == cell else cell


def _unseen(character: str) -> bool:
    """Whether it controls or ends a line instead of being seen."""
    return unicodedata.category(character) in ("Cc", "Cf", "Cs", "Zl", "Zp")

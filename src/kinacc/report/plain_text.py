"""The first screen of a page as plain text, where there is no browser."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from itertools import zip_longest

from kinacc.report.page import FirstScreen, Table, Text

_WIDTH = 100  # characters of a line; a command stands whole
_NARROWEST = 12  # characters of a column whose heading is broken
_GAP = "  "


def plain_text(screen: FirstScreen) -> str:
    """Every word of the first screen, in lines of 100 characters; a command stands whole."""
    lines = [f"{screen.title}: {screen.subtitle}", screen.badge[0], ""]
    lines += [line for each in screen.answers for line in _wrapped(each)]
    for table in screen.tables:
        lines += ["", *_wrapped(table.caption), *_table(table)]
    margin = _GAP + " " * max((len(name) for name, _ in screen.notes), default=0)
    lines.append("")
    for name, texts in screen.notes:
        told = [line for each in texts for line in _note(each, len(margin))]
        heads = [name, *[""] * len(told)]
        lines += [f"{head:{len(margin)}}{line}" for head, line in zip(heads, told, strict=False)]
    return "".join(f"{line.rstrip()}\n" for line in lines)


def _note(text: Text, margin: int) -> list[str]:
    return [text.words] if text.code else _wrapped(text.words, _WIDTH - margin)


def _wrapped(words: str, width: int = _WIDTH) -> list[str]:
    return textwrap.wrap(words, width, break_long_words=False, break_on_hyphens=False)


def _table(table: Table) -> list[str]:
    """Rows below their headings, numbers to the right; the remark of a row behind it."""
    columns = list(zip(table.heads, *table.rows, strict=True))
    cells = [max((len(each) for each in column[1:]), default=0) for column in columns]
    heads = [
        _wrapped(head, max(cell, _NARROWEST)) for head, cell in zip(table.heads, cells, strict=True)
    ]
    widths = [max(cell, *map(len, head)) for cell, head in zip(cells, heads, strict=True)]
    height = max(map(len, heads))
    above = zip_longest(*([""] * (height - len(each)) + each for each in heads), fillvalue="")
    lines = [_row(each, widths, table.numeric) for each in above]
    for number, row in enumerate(table.rows):
        remark = table.marked.get(number, "")
        lines.append(_row(row, widths, table.numeric) + (f"{_GAP}{remark}" if remark else ""))
    return lines


def _row(cells: Iterable[str], widths: Sequence[int], numeric: frozenset[int]) -> str:
    return _GAP.join(
        each.rjust(width) if column in numeric else each.ljust(width)
        for column, (each, width) in enumerate(zip(cells, widths, strict=True))
    )

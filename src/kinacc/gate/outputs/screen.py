"""What the gate says on the screen."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Iterator

from kinacc.gate.outcome import PASSED, Outcome, Verdicts
from kinacc.gate.outputs import told

_WIDTH, _LEAST = 100, 30  # characters where there is no terminal, and however narrow it is
_MARGIN = 11  # the longest verdict and a gap


def as_text(verdicts: Verdicts, width: int | None = None) -> str:
    """Failed gates first, what to do below each, then counts; lines as wide as the terminal.

    ``width`` in characters, without it the terminal's.
    """
    width = max(_LEAST, width or shutil.get_terminal_size((_WIDTH, 0)).columns)
    passed = 0
    lines: list[str] = []
    for each in told.ordered(verdicts.outcomes):
        passed += each.verdict == PASSED
        if passed <= told.MOST_PASSED:
            lines += _of_one(each, width)
    if passed > told.MOST_PASSED:
        lines.append(f"{PASSED:{_MARGIN}}and {passed - told.MOST_PASSED} more")
    lines += ["", *_wrapped(told.headline(verdicts), width, "", "")]
    if verdicts.digest:
        lines += _wrapped(f"digest of all records: {verdicts.digest}", width, "", "")
    return "\n".join(lines)


def _of_one(outcome: Outcome, width: int) -> Iterator[str]:
    margin = " " * _MARGIN
    words = f"{told.title(outcome)}: {told.said(outcome)}"
    yield from _wrapped(words, width, f"{outcome.verdict:{_MARGIN}}", margin)
    for cause, differences in told.by_cause(outcome.differences):
        yield from _wrapped(cause, width, margin, margin)
        for each in differences:
            yield from _wrapped(each, width, f"{margin}- ", f"{margin}  ")
    if outcome.fix and outcome.verdict != PASSED:
        yield from _wrapped(f"-> {outcome.fix}", width, margin, f"{margin}   ")


def _wrapped(text: str, width: int, first: str, others: str) -> list[str]:
    """On lines of at most ``width``; a path or command that is longer stands whole."""
    return textwrap.wrap(
        told.line(text),
        width,
        initial_indent=first,
        subsequent_indent=others,
        break_long_words=False,
        break_on_hyphens=False,
    )

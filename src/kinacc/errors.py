"""Errors a person can act on: every problem at once, each with its place, value and remedy."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong with an input.

    ``where`` names the file, row, column or key path; ``what`` says what is wrong and quotes the
    value found; ``allowed`` says what would be accepted; ``fix`` says what to do next.
    """

    where: str
    what: str
    allowed: str = ""
    fix: str = ""

    def __str__(self) -> str:
        parts = [f"{self.where}: {self.what}"]
        if self.allowed:
            parts.append(f"allowed: {self.allowed}")
        if self.fix:
            parts.append(self.fix)
        return as_seen("; ".join(parts))


_STEERING = {
    code: f"\\u{code:04x}"
    for code in (*range(0x20), *range(0x7F, 0xA0), *range(0x202A, 0x202F), *range(0x2066, 0x206A))
    if chr(code) not in "\n\t"
}


def as_seen(text: str) -> str:
    """A text whose characters that would steer a terminal, or turn its lines, are written out."""
    return text.translate(_STEERING)


def and_more(count: int) -> str:
    """`` and 3 more``, or nothing where there is none."""
    return f" and {count} more" if count > 0 else ""


def first_few(items: Sequence[object], shown: int = 5) -> str:
    """The first items, and how many there are beside them: ``2, 3, 5 and 4 more``."""
    return ", ".join(map(str, items[:shown])) + and_more(len(items) - shown)


_MOST_SHOWN = 30  # nobody reads more, and a file may hold a hundred thousand faults; JSON has all


class KinaccError(Exception):
    """Base of every error kinacc raises on purpose."""


class InputError(KinaccError):
    """The input cannot be used; carries every problem found, not only the first."""

    def __init__(self, problems: Iterable[Problem] | Problem, title: str = "") -> None:
        self.problems = (problems,) if isinstance(problems, Problem) else tuple(problems)
        self.title = title
        super().__init__(str(self))

    def __str__(self) -> str:
        count = len(self.problems)
        if count == 1 and not self.title:
            return str(self.problems[0])
        head = self.title or f"{count} problems in the input"
        lines = [f"  - {problem}" for problem in self.problems[:_MOST_SHOWN]]
        if count > _MOST_SHOWN:
            lines.append(f"  -{and_more(count - _MOST_SHOWN)}")
        return "\n".join([head, *lines])


def input_error(where: str, what: str, allowed: str = "", fix: str = "") -> InputError:
    """The error of one :class:`Problem`."""
    return InputError(Problem(where, what, allowed, fix))


class MachineError(InputError):
    """The machine did not do what was asked of it: a disk that is full, a file that is closed."""


_REMEDIES = {
    errno.ENOSPC: "make room, then give the same command again",
    errno.EDQUOT: "make room, then give the same command again",
    errno.ENAMETOOLONG: "give a shorter name",
}


def refused(error: OSError, where: object = None, what: str = "") -> MachineError:
    """What a system refuses, as an error for people: ``where``, ``what`` and why, in its words.

    ``where`` is the file the system names where that is not given.
    """
    where = error.filename if where is None else where
    # A library may say more than the system, in words for programmers.
    reason = os.strerror(error.errno) if error.errno else str(error) or type(error).__name__
    reason = reason[:1].lower() + reason[1:]
    message = ": ".join(filter(None, [what, reason]))
    place = "this machine" if where is None else str(where)
    return MachineError(Problem(place, message, fix=_REMEDIES.get(error.errno or 0, "")))


def refuse(problems: Iterable[Problem], title: str = "") -> None:
    """Raise InputError with all ``problems``, where there is one."""
    if several := tuple(problems):
        raise InputError(several, title)


def require_type(name: str, value: object, *kinds: type) -> None:
    """Raise InputError for a value of another type."""
    if not isinstance(value, kinds):
        expected = " or ".join(kind.__name__ for kind in kinds)
        raise input_error(name, f"is of type {type(value).__name__}", expected)


@contextmanager
def gathered(problems: list[Problem]) -> Iterator[None]:
    """Let problems of an InputError raised inside join ``problems``, and go on."""
    try:
        yield
    except InputError as error:
        problems += error.problems


class FitError(KinaccError):
    """A fit did not reach what was asked of it; the message carries the numbers."""

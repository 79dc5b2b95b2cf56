"""What a file leaves open, with the options that decide."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from kinacc.errors import InputError, Problem

TAKE = "--take"
Answers = Mapping[str, Any]  # to choices, by their keys


@dataclass(frozen=True)
class Choice:
    """A question ``about`` a file, and the meaning of each of the ``answers`` to ``option``.

    ``option`` is that of ``kinacc init``, such as --decimal.
    """

    option: str
    about: str
    answers: Mapping[str, str]


class Undecided(InputError):
    """The file can be read in more than one way: the ``choices`` that are open."""

    def __init__(self, path: str, *choices: Choice) -> None:
        problems = []
        for choice in choices:
            meant = "; ".join(f"{value}: {text}" for value, text in choice.answers.items())
            ways = [f"{choice.option} {shlex.quote(value)}" for value in choice.answers]
            fix = f"give {' or '.join(ways)}" + " (or several)" * (choice.option == TAKE)
            problems.append(Problem(path, f"{choice.about}: {meant}", fix=fix))
        super().__init__(problems, f"{path} leaves open how it is to be read")

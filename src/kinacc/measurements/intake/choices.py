"""What a file leaves open before its columns are looked at, with the options that decide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from kinacc.errors import InputError, Problem


@dataclass(frozen=True)
class Choice:
    """A question: ``about`` what, and what each of the ``answers`` to ``option`` would mean.

    ``option`` is that of ``kinacc init``, such as --decimal; ``key`` its name among the answers.
    """

    option: str
    about: str
    answers: Mapping[str, str]

    @property
    def key(self) -> str:
        """Name of the answer: decimal, sheet, direction_unit."""
        return self.option.removeprefix("--").replace("-", "_")


class Undecided(InputError):
    """The file can be read in more than one way; carries the ``choices``."""

    def __init__(self, path: str, choices: Sequence[Choice]) -> None:
        self.choices = tuple(choices)
        problems = []
        for each in self.choices:
            meant = "; ".join(f"{value}: {words}" for value, words in each.answers.items())
            told = [value if value.isalnum() else f'"{value}"' for value in each.answers]
            ways = " or ".join(f"{each.option} {value}" for value in told)
            problems.append(Problem(path, f"{each.about}: {meant}", fix=f"give {ways}"))
        super().__init__(problems, f"{path} leaves open how it is to be read")

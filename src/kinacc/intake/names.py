"""What a column's name says: its words, its unit, and which quantity it may hold."""

from __future__ import annotations

import re
from dataclasses import dataclass

UNITS = {
    "deg": "deg",
    "degree": "deg",
    "degrees": "deg",
    "grad": "deg",
    "°": "deg",
    "rad": "rad",
    "radian": "rad",
    "radians": "rad",
    "mm": "mm",
    "m": "m",
    "c": "C",
    "°c": "C",
}
_WORD = re.compile(r"[a-z]+|\d+|°c?", re.IGNORECASE)
_HUMP = re.compile(r"(?<=[a-z]{2})(?=[A-Z])")


@dataclass(frozen=True)
class Name:
    """A column's name taken apart: ``words`` in small letters, ``unit`` or empty.

    ``spelled`` are the words as the file writes them.
    """

    column: str
    words: tuple[str, ...]
    unit: str
    spelled: tuple[str, ...] = ()

    def without(self, place: int) -> tuple[str, ...]:
        """The words but the one at ``place``."""
        return self.words[:place] + self.words[place + 1 :]


def name_of(column: str, unit: str = "") -> Name:
    """The name taken apart; ``unit`` is what a line of units says of it."""
    stated = _bracketed(unit) or unit.strip().lower()
    inside = re.search(r"[\[(]\s*([^\])]*)\s*[\])]", column)
    text = column
    if inside:
        stated = stated or inside[1].strip().lower()
        text = column[: inside.start()] + " " + column[inside.end() :]
    spelled = [each for part in _HUMP.split(text) for each in _WORD.findall(part)]
    words = [each.lower() for each in spelled]
    if not inside and len(words) > 1 and words[-1] in UNITS and UNITS[words[-1]] != "C":
        stated = stated or words[-1]
        words = words[:-1]
    return Name(column, tuple(words), UNITS.get(stated, ""), tuple(spelled[: len(words)]))


def _bracketed(unit: str) -> str:
    inside = re.search(r"[\[(]\s*([^\])]*)\s*[\])]", unit)
    return inside[1].strip().lower() if inside else ""

"""Values in messages: how they are shown, the nearest known word, and what was meant."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

_LARGEST = 10**300  # a whole number beyond may have no float, and a million digits
_LONGEST_WORD = 100  # to compare words takes their lengths multiplied
# (unit, other unit, what one of the other unit is in the unit)
_MIXED_UP = (
    ("mm", "um", 1.0e-3),
    ("mm", "m", 1.0e3),
    ("mm", "nm", 1.0e-6),
    ("deg", "rad", 180.0 / math.pi),
    ("mrad", "rad", 1.0e3),
    ("mrad", "deg", 1.0e3 * math.pi / 180.0),
    ("mm/rad", "m/rad", 1.0e3),
)
_UNIT_ENDINGS = ("nm", "um", "mm", "cm", "m", "deg", "rad", "mrad", "urad", "percent")


def shown(value: Any) -> str:
    """A value as it stands in the file, shortened."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, int) and abs(value) >= _LARGEST:
        return "a number of more than 300 digits"
    text = repr(value) if isinstance(value, (str, dict, list)) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."


def nearest(word: object, known: tuple[str, ...]) -> str:
    """The known word most like ``word``; empty if none is."""
    text = str(word)
    return _nearest(text, known) if len(text) <= _LONGEST_WORD else ""


@lru_cache(1000)
def _nearest(text: str, known: tuple[str, ...]) -> str:
    """Thousands of data sets may have the same mistake."""
    same = [each for each in known if stem(each) == stem(text)]
    found = same or difflib.get_close_matches(text, known, n=1, cutoff=0.6)
    return found[0] if found else {each.lower(): each for each in known}.get(text.lower(), "")


def stem(name: str) -> str:
    """The name of a key without its unit."""
    head, _, ending = name.rpartition("_")
    return head if head and ending in _UNIT_ENDINGS else name


def number_in_text(text: str) -> str:
    """What to do about a text where a number belongs; empty where it holds none."""
    for each, fix in ((text, "write {:g}, without quotes"), (text.split()[:1], "")):
        try:
            number = float("".join(each).replace(",", "."))
        except ValueError:
            continue
        return (
            fix.format(number) or f"write the number alone, without {' '.join(text.split()[1:])!r}"
        )
    return ""


def other_unit(value: float, unit: str, limits: Mapping[str, float]) -> str:
    """The value converted, where it would be in range had it been given in another unit."""
    low = limits.get("minimum", limits.get("exclusiveMinimum", -math.inf))
    high = limits.get("maximum", limits.get("exclusiveMaximum", math.inf))
    for own, other, factor in _MIXED_UP:
        if own == unit and value and low <= value * factor <= high:
            return f"the unit is {unit}; if {value:g} {other} was meant, write {value * factor:g}"
    if limits.get("exclusiveMaximum") == 1 and 1 < value < 100:
        return f"if {value:g} % was meant, write {value / 100:g}"
    return ""

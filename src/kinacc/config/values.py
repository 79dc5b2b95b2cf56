"""Check single values against their key: type, limits, words, and units that were mixed up."""

from __future__ import annotations

import difflib
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

from kinacc.config.reading import KeyPath
from kinacc.config.schema import NUMERIC, Key, Section, walk
from kinacc.errors import Problem, first_few

Place = Callable[[KeyPath], str]
Checked = tuple[Any, list[Problem]]  # the value in its canonical type, what is wrong with it
Check = Callable[[Key, Any, KeyPath, Place], Checked]

_LARGEST = 10**300  # a whole number beyond may have no float, and a million digits
_ITEM = {"ints": "int", "floats": "float", "texts": "text", "pairs": "pair"}
INVALID = object()  # what a value that cannot be used is replaced by

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
_LONGEST_WORD = 100  # to compare words takes their lengths multiplied
_MOST_NAMES = 2000  # of one mapping: they are held against each other
_UNIT_ENDINGS = ("nm", "um", "mm", "cm", "m", "deg", "rad", "mrad", "urad", "percent")


def check(key: Key, value: Any, path: KeyPath, place: Place) -> Checked:
    """The value in its canonical type, and what is wrong with it (then INVALID)."""
    if value is None:
        if key.nullable:
            return None, []
        return _refuse(key, path, place, "has no value")
    if isinstance(value, str) and value in key.choices and key.kind in NUMERIC:
        return value, []
    return _CHECKS[key.kind](key, value, path, place)


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
    stem = _stem(text)
    same = [each for each in known if _stem(each) == stem]
    found = same or difflib.get_close_matches(text, known, n=1, cutoff=0.6)
    folded = {each.lower(): each for each in known}
    return found[0] if found else folded.get(text.lower(), "")


def unknown_key(name: object, section: Section, top: Section) -> tuple[str, str]:
    """What to say of a key that is not known: the fault, and what to do about it."""
    what = f"unknown key {shown(name)}"
    close = nearest(name, section.names)
    if close:
        entry = section.entry(close)
        unit = f" (in {entry.unit})" if isinstance(entry, Key) and entry.unit else ""
        if unit and _stem(str(name)) == _stem(close) and str(name) != close:
            return what, f"the unit is fixed: give {close}{unit}"
        return what, f"did you mean {close}{unit}?"
    homes = [".".join(path) for path, key in walk(top) if key.name == name]
    homes += [
        entry.name for entry in top.entries if isinstance(entry, Section) and entry.name == name
    ]
    return what, f"it belongs at {' or '.join(homes)}" if homes else ""


def _stem(name: str) -> str:
    head, _, ending = name.rpartition("_")
    return head if head and ending in _UNIT_ENDINGS else name


def _refuse(key: Key, path: KeyPath, place: Place, what: str, fix: str = "") -> Checked:
    return INVALID, [Problem(place(path), what, key.allowed, fix)]


def _number(key: Key, value: Any, path: KeyPath, place: Place, whole: bool) -> Checked:
    """One number within the key's limits, as int or float."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        fix = ""
        if isinstance(value, str):
            fix = _number_in_text(value)
        return _refuse(key, path, place, f"{shown(value)} is not a number", fix)
    if not abs(value) < _LARGEST:
        return _refuse(key, path, place, f"{shown(value)} is not a finite number")
    if whole and value != int(value):
        return _refuse(key, path, place, f"{shown(value)} is not a whole number")
    if not _within(key, value):
        return _refuse(key, path, place, f"{shown(value)} is out of range", _other_unit(key, value))
    return (int(value) if whole else float(value)), []


def _number_in_text(text: str) -> str:
    try:
        number = float(text.replace(",", "."))
    except ValueError:
        words = text.split()
        if len(words) == 2 and _is_number(words[0]):
            return f"write the number alone, without {words[1]!r}"
        return ""
    return f"write {number:g}, without quotes"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _within(key: Key, value: float) -> bool:
    if key.open_ends and value in (key.low, key.high):
        return False
    return not (
        (key.low is not None and value < key.low) or (key.high is not None and value > key.high)
    )


def _other_unit(key: Key, value: float) -> str:
    """The value converted, where it would be in range had it been given in another unit."""
    for unit, other, factor in _MIXED_UP:
        if unit == key.unit and value and _within(key, value * factor):
            return f"the unit is {unit}; if {value:g} {other} was meant, write {value * factor:g}"
    if key.open_ends and key.high == 1 and 1 < value < 100:
        return f"if {value:g} % was meant, write {value / 100:g}"
    return ""


def _int(key: Key, value: Any, path: KeyPath, place: Place) -> Checked:
    return _number(key, value, path, place, whole=True)


def _float(key: Key, value: Any, path: KeyPath, place: Place) -> Checked:
    return _number(key, value, path, place, whole=False)


def _bool(key: Key, value: Any, path: KeyPath, place: Place) -> Checked:
    if isinstance(value, bool):
        return value, []
    return _refuse(key, path, place, f"{shown(value)} is neither true nor false")


def _text(key: Key, value: Any, path: KeyPath, place: Place) -> Checked:
    if not isinstance(value, str):
        fix = (
            "put it in quotes" if isinstance(value, (bool, int, float)) and not key.choices else ""
        )
        return _refuse(key, path, place, f"{shown(value)} is not text", fix)
    if key.choices and value not in key.choices:
        close = nearest(value, key.choices)
        fix = f"did you mean {close}?" if close else ""
        return _refuse(key, path, place, f"{shown(value)} is not known", fix)
    if not value:
        return _refuse(key, path, place, "is empty text")
    return value, []


def _list(key: Key, value: Any, path: KeyPath, place: Place, item: Check) -> Checked:
    """A list of allowed length whose items pass ``item``."""
    if not isinstance(value, list):
        what = f"{shown(value)} is not a list"
        if isinstance(value, str) and key.choices:
            close = nearest(value, key.choices)
            return _refuse(key, path, place, what, f"did you mean {close}?" if close else "")
        fix = "write it in brackets" if isinstance(value, (int, float, str)) else ""
        return _refuse(key, path, place, what, fix)
    fewest, most = key.length
    if not fewest <= len(value) <= most:
        return _refuse(key, path, place, f"has {len(value)} items")
    single = replace(key, kind=_ITEM[key.kind], choices=key.choices if key.kind == "texts" else ())
    items: list[Any] = []
    problems: list[Problem] = []
    for number, each in enumerate(value):
        cleaned, found = item(single, each, (*path, number), place)
        items.append(cleaned)
        problems += found
    return (INVALID if problems else items), problems


def _repeated(items: list[Any]) -> list[Any]:
    """What stands in a list more than once, each of it once."""
    return [item for item, count in Counter(items).items() if count > 1]


def _pair(key: Key, value: Any, path: KeyPath, place: Place) -> Checked:
    if not isinstance(value, list) or len(value) != 2:
        return _refuse(key, path, place, f"{shown(value)} is not two numbers")
    single = replace(key, kind="float")
    low, problems = _float(single, value[0], (*path, 0), place)
    high, more = _float(single, value[1], (*path, 1), place)
    if problems or more:
        return INVALID, problems + more
    if not low < high:
        return _refuse(
            key, path, place, f"{shown(value)} is reversed or empty", "put the smaller number first"
        )
    return [low, high], []


def _distinct(item: Check) -> Check:
    def check_list(key: Key, value: Any, path: KeyPath, place: Place) -> Checked:
        items, problems = _list(key, value, path, place, item)
        repeated = [] if problems else sorted(map(str, _repeated(items)))
        if repeated:
            return _refuse(key, path, place, f"names {first_few(repeated)} more than once")
        return items, problems

    return check_list


def _names(key: Key, value: Any, path: KeyPath, place: Place) -> Checked:
    if not isinstance(value, dict):
        return _refuse(key, path, place, f"{shown(value)} is not a mapping")
    if len(value) > _MOST_NAMES:
        return _refuse(key, path, place, f"has {len(value)} names, more than {_MOST_NAMES}")
    problems = []
    turned = [name for name, each in value.items() if not key.takes(name) and key.takes(each)]
    if turned and not any(key.takes(name) for name in value):
        what = f"the file's names stand first, as in {turned[0]}: {value[turned[0]]}"
        right = f"{value[turned[0]]}: {turned[0]}"
        problem = Problem(place(path), what, f"ours first, as in {right}", "turn them all round")
        return INVALID, [problem]
    for name, each in value.items():
        here = place((*path, name))
        if not key.takes(name):
            close = nearest(name, key.choices + key.behind)
            fix = f"did you mean {close}?" if close else ""
            problems.append(Problem(here, f"unknown name {shown(name)}", key.names, fix))
        if not isinstance(each, str) or not each:
            wanted = "name of a column" if key.behind else "the reason, in words"
            problems.append(Problem(here, f"{shown(each)} is not text", wanted))
    return (INVALID if problems else dict(value)), problems


def _rows(key: Key, value: Any, path: KeyPath, place: Place) -> Checked:
    if not isinstance(value, list):
        return _refuse(key, path, place, f"{shown(value)} is not a list")
    lines = Key("lines", "ints", None, "", low=1, high=1e9, length=(1, 100_000))
    reason = Key("reason", "text", None, "")
    items: list[dict[str, Any]] = []
    problems: list[Problem] = []
    for number, each in enumerate(value):
        here = (*path, number)
        if not isinstance(each, dict) or set(each) != {"lines", "reason"}:
            problems += _refuse(key, here, place, f"{shown(each)} does not give lines and reason")[
                1
            ]
            continue
        given = each["lines"] if isinstance(each["lines"], list) else [each["lines"]]
        numbers, wrong = _CHECKS["ints"](lines, given, (*here, "lines"), place)
        why, wrong_too = check(reason, each["reason"], (*here, "reason"), place)
        problems += wrong + wrong_too
        items.append({"lines": numbers, "reason": why})
    if problems:
        return INVALID, problems
    every = [line for item in items for line in item["lines"]]
    twice = sorted(_repeated(every))
    if twice:
        what = f"names line {first_few(twice)} more than once"
        return _refuse(key, path, place, what, "give every line one reason")
    return items, []


def _records(key: Key, value: Any, path: KeyPath, place: Place) -> Checked:
    if not isinstance(value, list):
        return _refuse(key, path, place, f"{shown(value)} is not a list")
    fewest, most = key.length
    if not fewest <= len(value) <= most:
        return _refuse(key, path, place, f"has {len(value)} items")
    wanted = [field.name for field in key.fields]
    items: list[dict[str, Any]] = []
    problems: list[Problem] = []
    for number, each in enumerate(value):
        here = (*path, number)
        if not isinstance(each, dict) or set(each) != set(wanted):
            what = f"{shown(each)} does not give {' and '.join(wanted)}"
            problems += _refuse(key, here, place, what)[1]
            continue
        found = {}
        for field in key.fields:
            found[field.name], wrong = check(field, each[field.name], (*here, field.name), place)
            problems += wrong
        items.append(found)
    return (INVALID if problems else items), problems


def _variants(key: Key, value: Any, path: KeyPath, place: Place) -> Checked:
    from kinacc.config import variants

    found, problems = variants.variants(key, value, path, place)
    problems = [each if each.allowed else replace(each, allowed=key.allowed) for each in problems]
    return (INVALID if problems else found), problems


def _parameters(key: Key, value: Any, path: KeyPath, place: Place) -> Checked:
    from kinacc.config import parameter_rules

    if not isinstance(value, dict):
        return _refuse(key, path, place, f"{shown(value)} is not a mapping")
    if len(value) > _MOST_NAMES:
        return _refuse(key, path, place, f"has {len(value)} names, more than {_MOST_NAMES}")
    problems = parameter_rules.rules(value, key.choices[0], lambda name: place((*path, name)))[1]
    return (INVALID if problems else dict(value)), problems


def _series(key: Key, value: Any, path: KeyPath, place: Place) -> Checked:
    from kinacc.config import series

    lines, problems = series.lines(value, path, place)
    return (INVALID if problems else lines), problems


_CHECKS: dict[str, Check] = {
    "int": _int,
    "float": _float,
    "bool": _bool,
    "text": _text,
    "ints": _distinct(_int),
    "floats": lambda key, value, path, place: _list(key, value, path, place, _float),
    "texts": _distinct(_text),
    "pair": _pair,
    "pairs": lambda key, value, path, place: _list(key, value, path, place, _pair),
    "names": _names,
    "parameters": _parameters,
    "rows": _rows,
    "records": _records,
    "variants": _variants,
    "series": _series,
}

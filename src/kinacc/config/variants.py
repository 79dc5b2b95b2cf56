"""Lists of mappings of several kinds: each has the keys of one kind, told by a key of that name."""

from __future__ import annotations

from typing import Any

from kinacc.config import gate_rules
from kinacc.config.reading import KeyPath
from kinacc.config.schema import Key, Section
from kinacc.config.values import Place, check, nearest, shown, unknown_key
from kinacc.errors import Problem


def variants(
    key: Key, value: Any, path: KeyPath, place: Place
) -> tuple[list[dict[str, Any]], list[Problem]]:
    """The mappings whole, with defaults and their ``kind``, and everything wrong with any."""
    if not isinstance(value, list):
        return [], [
            Problem(place(path), f"{shown(value)} is not a list", fix="write - before each")
        ]
    if len(value) > key.length[1]:
        return [], [Problem(place(path), f"has {len(value)} items", f"at most {key.length[1]}")]
    items: dict[int, dict[str, Any]] = {}
    problems: list[Problem] = []
    for number, each in enumerate(value):
        found, wrong = _variant(key, each, (*path, number), place)
        items |= {} if wrong else {number: found}
        problems += wrong
    problems += gate_rules.wrong(items, lambda *at: place((*path, *at)))
    return [*items.values()], problems


def _variant(
    key: Key, value: Any, path: KeyPath, place: Place
) -> tuple[dict[str, Any], list[Problem]]:
    kinds = tuple(each.name for each in key.variants)
    one_of = f"one of {', '.join(kinds)}"
    if not isinstance(value, dict):
        return {}, [Problem(place(path), f"{shown(value)} is not a mapping", f"with {one_of}")]
    told = [each for each in key.variants if each.name in value]
    # A kind may have the key of another as a field of its own: then the former is meant.
    told = [each for each in told if not any(o is not each and o.entry(each.name) for o in told)]
    if len(told) != 1:
        close = [near for each in value if (near := nearest(each, kinds))]
        fix = f"did you mean {close[0]}?" if close and not told else ""
        what = f"is of {len(told)} kinds" if told else "says nothing to hold results to"
        return {}, [Problem(place(path), what, one_of, fix)]
    known = Section(told[0].name, "", (*key.fields, *told[0].entries))
    found: dict[str, Any] = {"kind": told[0].name}
    problems: list[Problem] = []
    for name in value:
        if name not in known.names:
            what, fix = unknown_key(name, known, Section("", "", ()))
            problems.append(Problem(place((*path, name)), what, ", ".join(known.names), fix))
    for field in known.entries:
        assert isinstance(field, Key)
        if field.name in value:
            here = (*path, field.name)
            found[field.name], wrong = check(field, value[field.name], here, place)
            problems += wrong
        elif field.needed:
            allowed = f"{field.name}: {field.allowed}"
            problems.append(Problem(place(path), f"has no {field.name}", allowed))
        else:
            found[field.name] = field.default
    return found, problems

"""A part of a configuration held to its model: what can be used, and every problem."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from kinacc import removed
from kinacc.config.names import LONGEST
from kinacc.config.reading import Place
from kinacc.config.schema import DATASET_NAME, allowed, json_schema, node_at
from kinacc.config.values import nearest, number_in_text, other_unit, shown, stem
from kinacc.errors import Problem

ROBOTS = Path(__file__).parents[1] / "kinematics" / "robots"
_MOST_PROBLEMS = 100  # in one section: nobody has more, and each is held against all names
# What is wrong, by what pydantic calls it.
_WHAT = {
    "int_type": "is not a number",
    "float_type": "is not a number",
    "finite_number": "is not a finite number",
    "greater_than": "is out of range",
    "greater_than_equal": "is out of range",
    "less_than": "is out of range",
    "less_than_equal": "is out of range",
    "bool_type": "is neither true nor false",
    "string_type": "is not text",
    "literal_error": "is not known",
    "list_type": "is not a list",
    "dict_type": "is not a mapping",
    "model_type": "is not a section",
}


def check_section(
    model: type[BaseModel], content: Any, place: Place
) -> tuple[dict[str, Any], list[Problem]]:
    """A section as given without what cannot be used, and everything wrong with it."""
    problems: list[Problem] = []
    try:
        model.model_validate(content)
    except ValidationError as error:
        found = error.errors(include_url=False)
        problems = [_problem(model, each, place) for each in found[:_MOST_PROBLEMS]]
        if len(found) > _MOST_PROBLEMS:
            what = f"and {len(found) - _MOST_PROBLEMS} more"
            problems.append(Problem(place(()), what, fix="mend the others first"))
            return {}, problems
        for each in found:
            content = _without(content, _steps(each["loc"]))
    return dict(content or {}), problems


def _steps(loc: tuple[Any, ...]) -> list[Any]:
    """Keys and places of an error as they stand in the file: without the kind of a gate."""
    steps = [each for each in loc if each != "[key]"]
    return steps[:2] + steps[3:] if steps[:1] == ["gates"] else steps


def _without(content: Any, steps: list[Any]) -> Any:
    """Content without the value at a path, or without the list that it stands in."""
    if not steps or not isinstance(content, Mapping):
        return {}
    first, *rest = steps
    if first not in content:
        return content
    if not rest or isinstance(rest[0], int) or not isinstance(content[first], Mapping):
        return {key: value for key, value in content.items() if key != first}
    return {**content, first: _without(content[first], rest)}


def _problem(model: type[BaseModel], error: Any, place: Place) -> Problem:
    kind, value, known = error["type"], error["input"], error.get("ctx", {})
    loc, steps = error["loc"], _steps(error["loc"])
    where = place(tuple(steps))
    if loc[-1:] == ("[key]",):
        node = node_at(loc[:-2], model)
        node = {"allowed": node["allowed"]} if "allowed" in node else node["propertyNames"]
    else:
        node = node_at(loc, model)
    if kind in ("extra_forbidden", "invalid_key"):
        return _unknown(loc, model, where)
    words = allowed(node)
    if kind == "missing":
        return Problem(place(tuple(steps[:-1])), f"has no {steps[-1]}", f"{steps[-1]}: {words}")
    if kind == "refused":
        return Problem(where, known["what"], words, known["fix"])
    if value is None:
        return Problem(where, "has no value", words)
    if kind in ("too_short", "too_long"):
        return Problem(where, f"has {len(value)} items", words)
    if kind == "string_too_short":
        return Problem(where, "is empty text", words)
    is_share = kind == "int_type" and isinstance(value, float)
    what = "is not a whole number" if is_share else _WHAT.get(kind, "is not understood")
    what = f"{shown(value)} {what}"
    return Problem(where, what, words, _fix(kind, value, node))


def _fix(kind: str, value: Any, node: dict[str, Any]) -> str:
    """What to do about a value, where that can be told."""
    words = [word for each in (node, *node.get("anyOf", ())) for word in each.get("enum", ())]
    if kind in ("int_type", "float_type") and isinstance(value, str):
        return number_in_text(value)
    if kind == "int_type" and isinstance(value, float) and value.is_integer():
        return f"write {value:.0f}"
    if kind.startswith(("greater_than", "less_than")):
        return other_unit(value, node.get("unit", ""), node)
    if kind == "string_type" and isinstance(value, (int, float)):
        return "put it in quotes"
    if kind in ("literal_error", "list_type") and (close := nearest(value, tuple(words))):
        return f"did you mean {close}?"
    return "write it in brackets" if kind == "list_type" and not isinstance(value, dict) else ""


def _unknown(loc: tuple[Any, ...], model: type[BaseModel], where: str) -> Problem:
    """What to say of a key that is not known."""
    name, section = loc[-1], node_at(loc[:-1], model)["properties"]
    if name in removed.KEYS:
        return Problem(where, f"{name} is gone", fix=removed.KEYS[name])
    fix, close = "", nearest(name, tuple(section))
    if close:
        unit = f" (in {section[close]['unit']})" if "unit" in section[close] else ""
        other = bool(unit) and stem(str(name)) == stem(close)
        fix = f"the unit is fixed: give {close}{unit}" if other else f"did you mean {close}{unit}?"
    elif homes := [".".join(path) for path in _places(json_schema(model), name)]:
        fix = f"it belongs at {' or '.join(homes)}"
    return Problem(where, f"unknown key {shown(name)}", ", ".join(section), fix)


def _places(schema: dict[str, Any], name: Any) -> Iterator[tuple[str, ...]]:
    """Paths of all keys and sections of a name."""

    def below(node: dict[str, Any], path: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
        if "$ref" in node:
            node = schema["$defs"][node["$ref"].rpartition("/")[2]]
        for key, inner in node.get("properties", {}).items():
            if key == name:
                yield (*path, key)
            yield from below(inner, (*path, key))

    return below(schema, ())


def check_dataset_name(name: Any, where: str) -> list[Problem]:
    """A name becomes a folder below results/, so it may not lead anywhere else."""
    words = f"at most {LONGEST} letters, digits, _ and -, the first not -"
    if not isinstance(name, str):
        what = f"the data set's name {shown(name)} is not text"
        return [Problem(where, what, words, "put the name in quotes")]
    if not re.fullmatch(DATASET_NAME, name) or len(name) > LONGEST:
        return [Problem(where, f"{shown(name)} cannot be the name of a data set", words)]
    return []


def check_robot(robot: str, where: str, folder: Path) -> list[Problem]:
    """A robot is one that is shipped, or a file that exists."""
    shipped = tuple(sorted(item.stem for item in ROBOTS.glob("*.yaml")))
    if robot in shipped or (folder / robot).is_file():
        return []
    words = f"{', '.join(shipped)}, or the path of a robot file"
    file = "file " if robot.endswith((".yaml", ".yml")) or "/" in robot else ""
    close = "" if file else nearest(robot, shipped)
    fix = f"did you mean {close}?" if close else ""
    return [Problem(where, f"there is no robot {file}{shown(robot)}", words, fix)]

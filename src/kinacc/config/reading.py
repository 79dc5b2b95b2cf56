"""One configuration file as plain data, with the line of every key and all that YAML would hide."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from kinacc.errors import Problem

KeyPath = tuple[Any, ...]

# Thousands of data sets in one file stay below these, a second of work and 100 MB; what does not
# would take minutes or all memory.
_MOST_BYTES = 4_000_000
_MOST_VALUES = 200_000
_DEEPEST = 12
_LONGEST_TEXT = 10_000
_LONGEST_NUMBER = 100
_READINGS = (".csv", ".tsv", ".xlsx", ".xls")

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_CONSTRUCTOR = yaml.constructor.SafeConstructor()
_MAKERS = {
    tag: yaml.constructor.SafeConstructor.yaml_constructors[tag]
    for tag in (
        f"tag:yaml.org,2002:{kind}" for kind in ("null", "bool", "int", "float", "timestamp")
    )
}

# YAML 1.1 reads 1e-6 (no point, no sign) as text; nobody who writes it means a text.
_FLOAT = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)[eE][-+]?\d+")
_LIKE_A_NUMBER = re.compile(r"[-+]?(0[xb][\da-fA-F_]+|[\d.][\d._:]*([eE][-+]?\d*)?)")


@dataclass(frozen=True)
class Document:
    """Content of one file: ``data`` as nested plain values, ``lines`` of every key path."""

    name: str
    data: dict[str, Any]
    lines: dict[KeyPath, int] = field(default_factory=dict)

    def gives(self, path: KeyPath) -> bool:
        """Whether the file has something at a key path."""
        value: Any = self.data
        for step in path:
            if isinstance(value, dict):
                if step not in value:
                    return False
            elif not (isinstance(value, list) and isinstance(step, int) and step < len(value)):
                return False
            value = value[step]
        return True

    def place(self, path: KeyPath) -> str:
        """File, line and key path in words; the nearest known line where a key has none."""
        known = path
        while known and known not in self.lines:
            known = known[:-1]
        line = f":{self.lines[known]}" if known in self.lines else ""
        return f"{self.name}{line}, {dotted(path)}" if path else f"{self.name}{line}"


def dotted(path: KeyPath) -> str:
    """A key path as people write it: ``study.noise_mm[2]``."""
    text = ""
    for step in path:
        text += f"[{step}]" if isinstance(step, int) else f".{step}" if text else str(step)
    return text


def read(path: Path | str) -> tuple[Document, list[Problem]]:
    """One YAML file; problems instead of exceptions for all that is wrong with it as YAML."""
    name = str(path)
    try:
        # No more is read than is needed to see that it is too much: the file may be a device.
        with open(path, "rb") as stream:
            content = stream.read(_MOST_BYTES + 1)
        if Path(path).suffix.lower() in _READINGS:
            return Document(name, {}), [_readings(name)]
        text = content.decode("utf-8-sig") if len(content) <= _MOST_BYTES else ""
    except FileNotFoundError:
        fix = "give the path of a configuration file, e.g. config.yaml"
        return Document(name, {}), [Problem(name, "no such file", fix=fix)]
    except IsADirectoryError:
        return Document(name, {}), [Problem(name, "is a folder", "a YAML file")]
    except UnicodeDecodeError as error:
        what = f"is not text in UTF-8 (byte {error.start})"
        return Document(name, {}), [Problem(name, what, "a YAML file")]
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        return Document(name, {}), [Problem(name, f"cannot be read: {reason}")]
    if len(content) > _MOST_BYTES:
        allowed = f"a YAML file of at most {_MOST_BYTES // 1000} kB"
        return Document(name, {}), [Problem(name, "is too large for a description", allowed)]
    return parsed(text, name)


def _readings(name: str) -> Problem:
    """What to say of a file of readings, given where the file that describes it is meant."""
    fix = f"{shlex.join(['kinacc', 'init', name])} writes it: give that"
    return Problem(name, "holds readings", "the .yaml file that describes them", fix)


def parsed(text: str, name: str) -> tuple[Document, list[Problem]]:
    """YAML text, as ``read``; ``name`` is what problems call it."""
    problem = unreadable(text, name)
    if problem:
        return Document(name, {}), [problem]
    try:
        node = yaml.compose(text, Loader=_LOADER)
    except yaml.YAMLError as error:
        return Document(name, {}), [_yaml_problem(name, error)]
    if node is None:
        return Document(name, {}), [Problem(name, "is empty", "at least one key")]
    if not isinstance(node, yaml.MappingNode):
        return Document(name, {}), [Problem(name, "holds no keys", "a mapping such as seed: 1")]
    walk = _Walk(name)
    data = walk.plain(node, ())
    if walk.left < 0:
        what = "its aliases (*name) stand for too many values, or for themselves"
        allowed = f"at most {_MOST_VALUES} values, aliases counted as what they stand for"
        return Document(name, {}), [Problem(name, what, allowed, "write the values out")]
    return Document(name, data, walk.lines), walk.problems


def unreadable(text: str, name: str) -> Problem | None:
    """Why a text is not YAML, or too much of it to be read safely; None where nothing is wrong.

    Looks at one event after another: to build values of nested ones takes a step of the machine's
    own stack for each level, which ends the process where the text is nested deeply enough.
    """
    depth = values = 0
    try:
        for event in yaml.parse(text, Loader=_LOADER):
            what = allowed = ""
            if isinstance(event, yaml.CollectionStartEvent):
                depth, values = depth + 1, values + 1
            elif isinstance(event, yaml.CollectionEndEvent):
                depth -= 1
            elif isinstance(event, yaml.ScalarEvent):
                values += 1
                what, allowed = _too_long(event)
            if depth > _DEEPEST:
                what, allowed = "is nested without end", f"at most {_DEEPEST} levels"
            elif values > _MOST_VALUES:
                what, allowed = "holds too many values", f"at most {_MOST_VALUES} in a file"
            if what:
                line = event.start_mark.line + 1 if event.start_mark else 1
                return Problem(f"{name}:{line}", what, allowed)
    except (yaml.YAMLError, ValueError) as error:
        return _yaml_problem(name, error)
    return None


def _too_long(event: yaml.ScalarEvent) -> tuple[str, str]:
    """What is wrong with the length of a text or number, and what is allowed; empty if nothing."""
    length = len(event.value)
    if length > _LONGEST_NUMBER and event.implicit[0] and _LIKE_A_NUMBER.fullmatch(event.value):
        return f"a number of {length} characters", f"numbers of at most {_LONGEST_NUMBER}"
    if length > _LONGEST_TEXT:
        return f"a text of {length} characters", f"texts of at most {_LONGEST_TEXT}"
    return "", ""


def _yaml_problem(name: str, error: Exception) -> Problem:
    mark = getattr(error, "problem_mark", None)
    line = f":{mark.line + 1}" if mark is not None else ""
    said = [getattr(error, "context", None), getattr(error, "problem", None)]
    reason = ", ".join(part for part in said if part) or str(error).splitlines()[0]
    fix = "use blanks, not tabs, to indent" if "\\t" in reason or "tab" in reason else ""
    return Problem(f"{name}{line}", f"is not YAML: {reason}", fix=fix)


class _Walk:
    """From nodes to plain values; notes lines and repeated keys on the way.

    ``left`` counts down the values that may still come; below zero, no more are made.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.lines: dict[KeyPath, int] = {}
        self.problems: list[Problem] = []
        self.left = _MOST_VALUES

    def plain(self, node: yaml.Node, path: KeyPath) -> Any:
        """Plain value of a YAML node."""
        self.left -= 1
        if self.left < 0:
            return None
        if len(path) > _DEEPEST:  # only aliases lead so deep
            self.left = -1
            return None
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, path)
        if not isinstance(node, yaml.SequenceNode):
            return _scalar(node)
        items = []
        for number, item in enumerate(node.value):
            here = (*path, number)
            self.lines[here] = item.start_mark.line + 1
            items.append(self.plain(item, here))
            if self.left < 0:
                break
        return items

    def _mapping(self, node: yaml.MappingNode, path: KeyPath) -> dict[Any, Any]:
        mapping: dict[Any, Any] = {}
        for key_node, value_node in node.value:
            key, line = _scalar(key_node), key_node.start_mark.line + 1
            here = (*path, key)
            if key in mapping:
                what = f"{key!r} is given twice, first in line {self.lines[here]}"
                if path == ("datasets",):
                    what = f"data set {what}"
                place = f"{self.name}:{line}, {dotted(here)}"
                self.problems.append(Problem(place, what, "every name once", "keep one of the two"))
                continue
            self.lines[here] = line
            mapping[key] = self.plain(value_node, here)
            if self.left < 0:
                break
        return mapping


def _scalar(node: yaml.Node) -> Any:
    """Value of a scalar node as YAML's safe loader would give it; anything else as its text."""
    if not isinstance(node, yaml.ScalarNode):
        return "<sequence>" if isinstance(node, yaml.SequenceNode) else "<mapping>"
    if not node.style and _FLOAT.fullmatch(node.value):
        return float(node.value)
    make = _MAKERS.get(node.tag)
    # A tag (!!int) may stand before any text, and the constructors trust it.
    if make is None or len(node.value) > _LONGEST_NUMBER:
        return node.value
    try:
        return make(_CONSTRUCTOR, node)
    except (ArithmeticError, AttributeError, LookupError, ValueError):
        return node.value

"""One configuration file as plain data, with the line of every key and all that YAML would hide."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import Any

import yaml

from kinacc.errors import Problem

KeyPath = tuple[Any, ...]
Place = Callable[[KeyPath], str]

# Thousands of data sets in one file stay below these, a second of work and 100 MB; what does not
# would take minutes or all memory.
_MOST_BYTES = 4_000_000
_MOST_VALUES = 200_000
_DEEPEST = 12
_LONGEST_TEXT = 10_000
_LONGEST_NUMBER = 100
_READINGS = (".csv", ".tsv", ".xlsx", ".xls")

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

_SCALARS = (str, int, float, date, type(None))
# YAML 1.1 reads 1e-6 (no point, no sign) as text; nobody who writes it means a text.
_FLOAT = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)[eE][-+]?\d+")
_NUMBER = re.compile(r"[-+]?(0[xb][\da-fA-F_]+|[\d.][\d._:]*([eE][-+]?\d*)?)")


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
    name, what, allowed, fix = str(path), "", "a YAML file", ""
    try:
        # No more is read than is needed to see that it is too much: the file may be a device.
        with open(path, "rb") as stream:
            content = stream.read(_MOST_BYTES + 1)
        if Path(path).suffix.lower() in _READINGS:
            what, allowed = "holds readings", "the .yaml file that describes them"
            fix = f"{shlex.join(['kinacc', 'init', name])} writes it: give that"
        elif len(content) > _MOST_BYTES:
            what = "is too large for a description"
            allowed = f"a YAML file of at most {_MOST_BYTES // 1000} kB"
        else:
            return parsed(content.decode("utf-8-sig"), name)
    except FileNotFoundError:
        what, fix = "no such file", "give the path of a configuration file, e.g. config.yaml"
    except IsADirectoryError:
        what = "is a folder"
    except UnicodeDecodeError as error:
        what = f"is not text in UTF-8 (byte {error.start})"
    except (OSError, ValueError) as error:
        what = f"cannot be read: {getattr(error, 'strerror', None) or error}"
    return Document(name, {}), [Problem(name, what, allowed, fix)]


def parsed(text: str, name: str) -> tuple[Document, list[Problem]]:
    """YAML text, as ``read``; ``name`` is what problems call it."""
    problem = unreadable(text, name)
    if problem:
        return Document(name, {}), [problem]
    try:
        node = yaml.compose(text, Loader=_LOADER)
    except yaml.YAMLError as error:
        return Document(name, {}), [_yaml_problem(name, error)]
    if not isinstance(node, yaml.MappingNode):
        what = "is empty" if node is None else "holds no keys"
        return Document(name, {}), [Problem(name, what, "a mapping such as seed: 1")]
    return _plain(node, name)


def unreadable(text: str, name: str) -> Problem | None:
    """Why a text is not YAML, or too much of it to be read safely; None where nothing is wrong.

    Looks at one event after another: to build values of nested ones takes a step of the machine's
    own stack for each level, which ends the process where the text is nested deeply enough.
    """
    depth = values = 0
    try:
        for event in yaml.parse(text, Loader=_LOADER):
            what = allowed = ""
            scalar = event.value if isinstance(event, yaml.ScalarEvent) else None
            opens = isinstance(event, yaml.CollectionStartEvent)
            depth += opens - isinstance(event, yaml.CollectionEndEvent)
            values += opens or scalar is not None
            length = len(scalar or "")
            if length > _LONGEST_NUMBER and _NUMBER.fullmatch(scalar or ""):
                what, allowed = f"a number of {length} characters", f"at most {_LONGEST_NUMBER}"
            elif length > _LONGEST_TEXT:
                what, allowed = f"a text of {length} characters", f"at most {_LONGEST_TEXT}"
            elif depth > _DEEPEST:
                what, allowed = "is nested without end", f"at most {_DEEPEST} levels"
            elif values > _MOST_VALUES:
                what, allowed = "holds too many values", f"at most {_MOST_VALUES} in a file"
            if what:
                line = event.start_mark.line + 1 if event.start_mark else 1
                return Problem(f"{name}:{line}", what, allowed)
    except (yaml.YAMLError, ValueError) as error:
        return _yaml_problem(name, error)
    return None


def _yaml_problem(name: str, error: Exception) -> Problem:
    mark = getattr(error, "problem_mark", None)
    line = f":{mark.line + 1}" if mark is not None else ""
    told = [getattr(error, "context", None), getattr(error, "problem", None)]
    reason = ", ".join(part for part in told if part) or str(error).splitlines()[0]
    fix = "use blanks, not tabs, to indent" if "\\t" in reason or "tab" in reason else ""
    return Problem(f"{name}{line}", f"is not YAML: {reason}", fix=fix)


def _plain(node: yaml.MappingNode, name: str) -> tuple[Document, list[Problem]]:
    """A document of plain values with the lines of its keys, and keys that are repeated."""
    lines: dict[KeyPath, int] = {}
    problems: list[Problem] = []
    constructor = yaml.constructor.SafeConstructor()
    left = _MOST_VALUES  # aliases may stand for many values, or for themselves

    def scalar(node: yaml.Node) -> Any:
        if not isinstance(node, yaml.ScalarNode):
            return "<sequence>" if isinstance(node, yaml.SequenceNode) else "<mapping>"
        if not node.style and _FLOAT.fullmatch(node.value):
            return float(node.value)
        if len(node.value) > _LONGEST_NUMBER:  # a tag (!!int) may stand before any text
            return node.value
        try:
            value = constructor.construct_object(node)
        except (ArithmeticError, AttributeError, LookupError, ValueError, yaml.YAMLError):
            return node.value
        return value if isinstance(value, _SCALARS) else node.value

    def plain(node: yaml.Node, path: KeyPath) -> Any:
        nonlocal left
        left = -1 if len(path) > _DEEPEST else left - 1  # only aliases lead so deep
        if left < 0 or isinstance(node, yaml.ScalarNode):
            return None if left < 0 else scalar(node)
        if isinstance(node, yaml.SequenceNode):
            items = []
            for number, item in enumerate(node.value):
                lines[(*path, number)] = item.start_mark.line + 1
                items.append(plain(item, (*path, number)))
                if left < 0:
                    break
            return items
        mapping: dict[Any, Any] = {}
        for key_node, value_node in node.value:
            key, line = scalar(key_node), key_node.start_mark.line + 1
            here = (*path, key)
            if key in mapping:
                what = f"{key!r} is given twice, first in line {lines[here]}"
                what = f"data set {what}" if path == ("datasets",) else what
                place = f"{name}:{line}, {dotted(here)}"
                problems.append(Problem(place, what, "every name once", "keep one of the two"))
                continue
            lines[here] = line
            mapping[key] = plain(value_node, here)
            if left < 0:
                break
        return mapping

    data = plain(node, ())
    if left < 0:
        what = "its aliases (*name) stand for too many values, or for themselves"
        allowed = f"at most {_MOST_VALUES} values, aliases counted as what they stand for"
        return Document(name, {}), [Problem(name, what, allowed, "write the values out")]
    return Document(name, data, lines), problems

"""One YAML file as plain values, with the line of every key; too much of it is refused."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import Any

import yaml

from kinacc.errors import InputError, Problem, input_error, refused

KeyPath = tuple[Any, ...]
Place = Callable[[KeyPath], str]

# Thousands of data sets in one file stay below these.
_MOST_BYTES, _MOST_VALUES, _DEEPEST = 4_000_000, 200_000, 12
_TABLES = (".csv", ".tsv", ".xlsx", ".xls")
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
# YAML 1.1 reads 1e-6 (no point, no sign) as text; nobody who writes it means a text.
_FLOAT = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)[eE][-+]?\d+")


@dataclass(frozen=True)
class Document:
    """Content of one file: ``data`` as nested plain values, ``lines`` of every key path.

    ``problems``: keys that are given twice, or why there is no data.
    """

    name: str
    data: Any
    lines: dict[KeyPath, int] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)

    def place(self, path: KeyPath) -> str:
        """File, line and key path; the nearest known line where a key has none."""
        known = path
        while known and known not in self.lines:
            known = known[:-1]
        line = f":{self.lines[known]}" if known else ""
        return f"{self.name}{line}, {dotted(path)}" if path else f"{self.name}{line}"


def paths_of(value: Any, path: KeyPath = ()) -> Iterator[KeyPath]:
    """Path of every value that stands in a nested one."""
    yield path
    inner = value.items() if isinstance(value, Mapping) else ()
    for key, item in enumerate(value) if isinstance(value, list) else inner:
        yield from paths_of(item, (*path, key))


def dotted(path: KeyPath) -> str:
    """A key path as people write it: ``study.noise_mm[2]``."""
    steps = (f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)
    return "".join(steps).removeprefix(".")


def read(path: Path | str) -> Document:
    """One YAML file; problems instead of exceptions for all that is wrong with it as YAML."""
    try:
        return mapping(_text(str(path)), str(path))
    except InputError as error:
        return Document(str(path), {}, problems=[*error.problems])


def _text(name: str) -> str:
    """Text of a file; no more is read than shows that it is too much: it may be a device."""
    try:
        with open(name, "rb") as stream:
            content = stream.read(_MOST_BYTES + 1)
        if Path(name).suffix.lower() in _TABLES:
            fix = f"{shlex.join(['kinacc', 'init', name])} writes a YAML file: give that"
            raise input_error(name, "holds readings", "a .yaml file", fix)
        if len(content) > _MOST_BYTES:
            allowed = f"at most {_MOST_BYTES // 1000} kB"
            raise input_error(name, "is too large for a description", allowed)
        return content.decode("utf-8-sig")
    except OSError as error:
        raise refused(error, name) from None
    except ValueError as error:  # or a name that no file can have
        raise input_error(name, f"is not text in UTF-8: {error}", "a YAML file") from None


def mapping(text: str, name: str) -> Document:
    """A YAML text whose top level is a mapping. Raises InputError where it is anything else."""
    document = parsed(text, name)
    if not isinstance(document.data, dict):
        message = "is empty" if document.data is None else "holds no keys"
        raise input_error(name, message, "a mapping such as seed: 1")
    return document


def parsed(text: str, name: str) -> Document:
    """A YAML text. Raises InputError where it is not YAML, or too much to be read safely."""
    lines: dict[KeyPath, int] = {}
    problems: list[Problem] = []
    count = 0

    def plain(node: yaml.Node, path: KeyPath) -> Any:
        nonlocal count
        count += 1
        if count > _MOST_VALUES or len(path) > _DEEPEST:  # aliases may stand for themselves
            message = "its aliases (*name) stand for too many values, or for themselves"
            raise input_error(name, message, f"at most {_MOST_VALUES} values")
        if isinstance(node, yaml.ScalarNode):
            return _scalar(node)
        if isinstance(node, yaml.SequenceNode):
            lines.update(((*path, n), e.start_mark.line + 1) for n, e in enumerate(node.value))
            return [plain(item, (*path, number)) for number, item in enumerate(node.value)]
        values: dict[Any, Any] = {}
        for key_node, value_node in node.value:
            key = _scalar(key_node) if isinstance(key_node, yaml.ScalarNode) else "<values>"
            here, line = (*path, key), key_node.start_mark.line + 1
            if key in values:
                message = f"{key!r} is given twice, first in line {lines[here]}"
                problems.append(Problem(f"{name}:{line}, {dotted(here)}", message, "once"))
            else:
                lines[here] = line
                values[key] = plain(value_node, here)
        return values

    try:
        depth = 0  # nodes within nodes take a step of the stack for each level
        for number, event in enumerate(yaml.parse(text, Loader=_LOADER)):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > _DEEPEST or number > 2 * _MOST_VALUES:
                allowed = f"at most {_DEEPEST} levels and {_MOST_VALUES} values"
                raise input_error(name, "holds too much", allowed)
        node = yaml.compose(text, Loader=_LOADER)
    except (yaml.YAMLError, ValueError) as error:
        mark = getattr(error, "problem_mark", None)
        reason = getattr(error, "problem", None) or str(error).splitlines()[0]
        fix = "indent with blanks, not tabs" if "\\t" in reason else ""
        where = f"{name}:{mark.line + 1}" if mark else name
        raise input_error(where, f"is not YAML: {reason}", fix=fix) from None
    return Document(name, None if node is None else plain(node, ()), lines, problems)


def _scalar(node: yaml.ScalarNode) -> Any:
    """The value of a node; text where YAML has no plain value for it, or no float holds it."""
    if not node.style and _FLOAT.fullmatch(node.value):
        return float(node.value)
    if node.tag == "tag:yaml.org,2002:str":
        return node.value
    try:
        value = yaml.constructor.SafeConstructor().construct_object(node)
    except (ArithmeticError, AttributeError, LookupError, ValueError, yaml.YAMLError):
        return node.value
    is_plain = isinstance(value, (str, int, float, date, type(None)))
    return node.value if not is_plain or (isinstance(value, int) and abs(value) > 1e300) else value

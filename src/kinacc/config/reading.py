"""One configuration file as plain data, with the line of every key and all that YAML would hide."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from kinacc.errors import Problem

KeyPath = tuple[Any, ...]

_CONSTRUCTOR = yaml.constructor.SafeConstructor()
_DEEPEST = 12

# YAML 1.1 reads 1e-6 (no point, no sign) as text; nobody who writes it means a text.
_FLOAT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+")


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
        text = Path(path).read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        fix = "give the path of a configuration file, e.g. config.yaml"
        return Document(name, {}), [Problem(name, "no such file", fix=fix)]
    except IsADirectoryError:
        return Document(name, {}), [Problem(name, "is a folder", "a YAML file")]
    except UnicodeDecodeError as error:
        what = f"is not text in UTF-8 (byte {error.start})"
        return Document(name, {}), [Problem(name, what, "a YAML file")]
    except OSError as error:
        return Document(name, {}), [Problem(name, f"cannot be read: {error.strerror}")]
    return parsed(text, name)


def parsed(text: str, name: str) -> tuple[Document, list[Problem]]:
    """YAML text, as ``read``; ``name`` is what problems call it."""
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)(text)
    try:
        node = loader.get_single_node()
    except yaml.YAMLError as error:
        return Document(name, {}), [_yaml_problem(name, error)]
    finally:
        loader.dispose()
    if node is None:
        return Document(name, {}), [Problem(name, "is empty", "at least one key")]
    if not isinstance(node, yaml.MappingNode):
        return Document(name, {}), [Problem(name, "holds no keys", "a mapping such as seed: 1")]
    lines: dict[KeyPath, int] = {}
    problems: list[Problem] = []
    data = _plain(name, node, (), lines, problems)
    return Document(name, data, lines), problems


def _yaml_problem(name: str, error: Exception) -> Problem:
    mark = getattr(error, "problem_mark", None)
    line = f":{mark.line + 1}" if mark is not None else ""
    said = [getattr(error, "context", None), getattr(error, "problem", None)]
    reason = ", ".join(part for part in said if part) or str(error).splitlines()[0]
    fix = "use blanks, not tabs, to indent" if "\\t" in reason or "tab" in reason else ""
    return Problem(f"{name}{line}", f"is not YAML: {reason}", fix=fix)


def _plain(name: str, node, path: KeyPath, lines: dict, problems: list[Problem]) -> Any:
    """Plain value of a YAML node; notes lines and repeated keys on the way."""
    if len(path) > _DEEPEST:
        problems.append(Problem(f"{name}, {dotted(path[:3])}", "is nested without end"))
        return None
    if isinstance(node, yaml.MappingNode):
        mapping: dict[Any, Any] = {}
        for key_node, value_node in node.value:
            key, line = _scalar(key_node), key_node.start_mark.line + 1
            here = (*path, key)
            if key in mapping:
                what = f"{key!r} is given twice, first in line {lines[here]}"
                if path == ("datasets",):
                    what = f"data set {what}"
                place = f"{name}:{line}, {dotted(here)}"
                problems.append(Problem(place, what, "every name once", "keep one of the two"))
                continue
            lines[here] = line
            mapping[key] = _plain(name, value_node, here, lines, problems)
        return mapping
    if isinstance(node, yaml.SequenceNode):
        items = []
        for number, item in enumerate(node.value):
            here = (*path, number)
            lines[here] = item.start_mark.line + 1
            items.append(_plain(name, item, here, lines, problems))
        return items
    return _scalar(node)


def _scalar(node) -> Any:
    """Value of a scalar node as YAML's safe loader would give it; anything else as its text."""
    if not isinstance(node, yaml.ScalarNode):
        return f"<{node.id}>"
    if not node.style and _FLOAT.fullmatch(node.value):
        return float(node.value)
    try:
        return _CONSTRUCTOR.construct_object(node)
    except (yaml.YAMLError, ValueError):
        return node.value

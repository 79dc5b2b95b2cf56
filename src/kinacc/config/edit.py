"""A value added to the text of a YAML file, whose comments and layout stay as they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import Any

import yaml

from kinacc.errors import InputError, Problem

Path = Sequence[str]


def with_added(text: str, path: Path, value: Any, name: str) -> str:
    """The text with ``value`` joined to the list or mapping at a path of keys.

    Parameters
    ----------
    text
        A YAML document whose top level is a mapping.
    path
        Keys that lead to the list or mapping; those that are missing are made.
    value
        A list or mapping: its items come after those that are there.
    name
        Name of the file in messages.

    Raises
    ------
    InputError
        Where the text cannot be changed without changing more than that.
    """
    try:
        data = yaml.safe_load(text)
        node: Any = yaml.compose(text, Loader=yaml.SafeLoader)
        wanted = _joined(data, path, value)
        changed = _changed(text, node, path, value, wanted)
        if yaml.safe_load(changed) == wanted:
            return changed
    except (yaml.YAMLError, TypeError, AttributeError, KeyError):
        pass
    what = f"cannot be changed safely at {'.'.join(path)}"
    fix = f"add by hand: {_flow(_nested(path, value))}"
    raise InputError(Problem(name, what, fix=fix))


def _joined(data: Any, path: Path, value: Any) -> Any:
    whole = deepcopy(data)
    place = whole
    for key in path[:-1]:
        if place.get(key) is None:
            place[key] = {}
        place = place[key]
    before = place.get(path[-1])
    both = {**(before or {}), **value} if isinstance(value, Mapping) else [*(before or []), *value]
    place[path[-1]] = both
    return whole


def _changed(text: str, node: Any, path: Path, value: Any, wanted: Any) -> str:
    """The text with the value put behind the last entry of the deepest part that is there."""
    depth = 0
    while depth < len(path):
        found = {key.value: each for key, each in node.value}.get(path[depth])
        if found is None or not isinstance(found, yaml.CollectionNode):
            break
        node, depth = found, depth + 1
    rest = path[depth:]
    if node.flow_style or not node.value:
        own = wanted
        for key in path[:depth]:
            own = own[key]
        return text[: node.start_mark.index] + _flow(own) + text[node.end_mark.index :]
    present = {key.value: each for key, each in node.value} if rest else {}
    if rest and rest[0] in present:  # null: its place takes the value
        each = present[rest[0]]
        inner = wanted
        for key in path[: depth + 1]:
            inner = inner[key]
        return text[: each.start_mark.index] + " " + _flow(inner) + text[each.end_mark.index :]
    line = _last_line(node)
    indent = " " * node.start_mark.column
    lines = text.splitlines(keepends=True)
    if not lines[line].endswith("\n"):
        lines[line] += "\n"
    lines.insert(line + 1, _block(rest, value, indent))
    return "".join(lines)


def _last_line(node: yaml.Node) -> int:
    """Line of the last scalar or flow collection of a node: block nodes end at what follows."""
    while isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last = node.value[-1]
        node = last[1] if isinstance(last, tuple) else last
    return node.end_mark.line


def _block(rest: Path, value: Any, indent: str) -> str:
    """Lines of the missing keys and the value, each of whose items has a line."""
    lines = []
    for key in rest:
        lines.append(f"{indent}{key}:")
        indent += "  "
    if isinstance(value, Mapping):
        lines += [f"{indent}{_flow(key)}: {_flow(each)}" for key, each in value.items()]
    else:
        lines += [f"{indent}- {_flow(each)}" for each in value]
    return "".join(f"{line}\n" for line in lines)


def _nested(path: Path, value: Any) -> Any:
    return {path[0]: _nested(path[1:], value)} if path else value


def _flow(value: Any) -> str:
    text = yaml.safe_dump(value, default_flow_style=True, allow_unicode=True, width=10_000)
    return text.removesuffix("\n").removesuffix("\n...")

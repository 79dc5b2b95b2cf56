"""A value added to the text of a YAML file, whose comments and layout stay as they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce
from typing import Any

import yaml

from kinacc.config.reading import value_of
from kinacc.errors import InputError, Problem

Path = Sequence[str]


def with_added(text: str, path: Path, value: Any, name: str, emptied: Path = ()) -> str:
    """The text with ``value`` joined to the list or mapping at a path of keys.

    Parameters
    ----------
    text
        A YAML document whose top level is a mapping.
    path
        Keys that lead to the list or mapping; missing keys are added.
    value
        A list or mapping: its items come after those that are there.
    name
        Name of the file in messages.
    emptied
        Keys that lead to a value in place of which null is written.

    Raises
    ------
    InputError
        Where the text cannot be changed without changing more than that.
    """
    try:
        wanted, changed = value_of(text, name), text
        if emptied:
            reduce(dict.__getitem__, emptied[:-1], wanted)[emptied[-1]] = None
            node = _deepest(text, emptied)[0]
            node = next(item for key, item in node.value if key.value == emptied[-1])
            changed = text[: node.start_mark.index] + "null" + text[node.end_mark.index :]
        parent = reduce(lambda section, key: _section(section, key, {}), path[:-1], wanted)
        _section(parent, path[-1], type(value)())
        parent[path[-1]] = (
            parent[path[-1]] | value if isinstance(value, Mapping) else parent[path[-1]] + value
        )
        changed = _joined(changed, wanted, path, value)
        if value_of(changed, name) == wanted:
            return changed
    except (yaml.YAMLError, TypeError, AttributeError, LookupError, StopIteration):
        pass
    message = f"cannot be changed safely at {'.'.join(path)}"
    instead = f", in place of {'.'.join(emptied)}" if emptied else ""
    items = [value] if isinstance(value, Mapping) else value
    fix = f"add by hand{instead}: {' '.join(f'- {flow(item)}' for item in items)}"
    raise InputError(Problem(name, message, fix=fix))


def flow(value: Any) -> str:
    """A value as YAML in one line: ``{path: june.csv, base: moved}``."""
    text = yaml.safe_dump(value, default_flow_style=True, allow_unicode=True, sort_keys=False,
                          width=10_000)  # fmt: skip
    return text.removesuffix("\n").removesuffix("\n...")


def _section(parent: dict[str, Any], key: str, empty: Any) -> Any:
    """The value of a key, ``empty`` where it has none."""
    parent[key] = empty if parent.get(key) is None else parent[key]
    return parent[key]


def _joined(text: str, wanted: Any, path: Path, value: Any) -> str:
    """The text with a value behind what is at a path; ``wanted`` are its values with that."""
    node, depth = _deepest(text, path)
    if node.flow_style or not node.value:
        whole = flow(reduce(dict.__getitem__, path[:depth], wanted))
        return text[: node.start_mark.index] + whole + text[node.end_mark.index :]
    if path[depth:] and path[depth] in {key.value for key, _ in node.value}:
        raise KeyError(path[depth])  # null, or a value of another kind
    newline = "\r\n" if "\r\n" in text else "\n"
    indent, lines = " " * node.start_mark.column, []
    for key in path[depth:]:
        lines.append(f"{indent}{key}:")
        indent += "  "
    items = (
        [f"{flow(key)}: {flow(item)}" for key, item in value.items()]
        if isinstance(value, Mapping)
        else [f"- {flow(item)}" for item in value]
    )
    lines += [indent + item for item in items]
    while isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last = node.value[-1]  # block nodes end at what follows: their last value does not
        node = last[1] if isinstance(last, tuple) else last
    stop = text.find("\n", node.end_mark.index) + 1 or len(text)
    gap = "" if text[stop - 1] == "\n" else newline
    return text[:stop] + gap + "".join(f"{line}{newline}" for line in lines) + text[stop:]


def _deepest(text: str, path: Path) -> tuple[Any, int]:
    """YAML node of the deepest list or mapping on a path, and how deep it is."""
    node: Any = yaml.compose(text, Loader=yaml.SafeLoader)
    for depth, key in enumerate(path):
        inner = {item.value: inner for item, inner in node.value}.get(key)
        if not isinstance(inner, yaml.CollectionNode):
            return node, depth
        node = inner
    return node, len(path)

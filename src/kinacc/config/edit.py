"""A value added to the text of a YAML file, whose comments and layout stay as they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce
from textwrap import indent
from typing import Any

import yaml

from kinacc.config.reading import parsed
from kinacc.errors import input_error

Path = Sequence[str]


def with_added(text: str, path: Path, value: Any, name: str) -> str:
    """The text with ``value`` joined to the list or mapping at a path of keys.

    Parameters
    ----------
    text
        A YAML document whose top level is a mapping.
    path
        Keys that lead to the list or mapping; missing keys are added.
    value
        A list, or a mapping of one key: its items come after those that are there.
    name
        Name of the file in messages.

    Raises
    ------
    InputError
        Where the text cannot be changed without changing more than that.
    """
    try:
        parent = wanted = parsed(text, name).data
        for key in path[:-1]:
            parent[key] = parent.get(key) or {}
            parent = parent[key]
        old = parent.get(path[-1]) or type(value)()
        parent[path[-1]] = old | value if isinstance(value, Mapping) else old + value
        changed = _joined(text, wanted, path, value)
        if parsed(changed, name).data == wanted:
            return changed
    except (yaml.YAMLError, TypeError, AttributeError, LookupError):
        pass
    message = f"cannot be changed safely at {'.'.join(path)}"
    raise input_error(name, message, fix=f"add by hand: {flow(value)}")


def flow(value: Any) -> str:
    """A list or mapping as YAML in one line: ``{path: june.csv, base: moved}``."""
    text = yaml.safe_dump(
        value, default_flow_style=True, allow_unicode=True, sort_keys=False, width=10_000
    )
    return text.removesuffix("\n")


def _joined(text: str, wanted: Any, path: Path, value: Any) -> str:
    """The text with a value behind what is at a path; ``wanted`` are its values with that."""
    node: Any = yaml.compose(text, Loader=yaml.SafeLoader)
    depth = 0
    for key in path:  # to the deepest list or mapping that is there
        inner = {item.value: inner for item, inner in node.value}.get(key)
        if not isinstance(inner, yaml.CollectionNode):
            break
        node, depth = inner, depth + 1
    if node.flow_style or not node.value:
        whole = flow(reduce(dict.__getitem__, path[:depth], wanted))
        return text[: node.start_mark.index] + whole + text[node.end_mark.index :]
    is_mapping = isinstance(value, Mapping)
    items = [flow(value)[1:-1]] if is_mapping else [f"- {flow(item)}" for item in value]
    added = "\n".join(items) + "\n"
    for key in reversed(path[depth:]):
        added = f"{key}:\n{indent(added, '  ')}"
    last = node
    while isinstance(last, yaml.CollectionNode) and not last.flow_style and last.value:
        # Block nodes end at what follows: their last value does not.
        last = last.value[-1][1] if isinstance(last, yaml.MappingNode) else last.value[-1]
    before, line_end, after = text[last.end_mark.index :].partition("\n")
    newline = "\r\n" if "\r\n" in text else "\n"
    start = text[: last.end_mark.index] + before + (line_end or newline)
    lines = indent(added, " " * node.start_mark.column)
    return start + lines.replace("\n", newline) + after

"""A value added to the text of a YAML file, whose comments and layout stay as they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import yaml

from kinacc.config.reading import value_of
from kinacc.errors import InputError, Problem

Path = Sequence[str]


def with_added(text: str, path: Path, value: Any, name: str, without: Path = ()) -> str:
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
    without
        Keys that lead to a value which is left out, with its line.

    Raises
    ------
    InputError
        Where the text cannot be changed without changing more than that.
    """
    try:
        changed, wanted = text, value_of(text, name)
        if without:
            changed = _without(changed, wanted, without)
        changed = _joined(changed, wanted, path, value)
        if value_of(changed, name) == wanted:
            return changed
    except (yaml.YAMLError, TypeError, AttributeError, KeyError):
        pass
    message = f"cannot be changed safely at {'.'.join(path)}"
    instead = f", in place of {'.'.join(without)}" if without else ""
    items = [value] if isinstance(value, Mapping) else value
    fix = f"add by hand{instead}: {' '.join(f'- {flow(item)}' for item in items)}"
    raise InputError(Problem(name, message, fix=fix))


def flow(value: Any) -> str:
    """A value as YAML in one line: ``{path: june.csv, base: moved}``."""
    text = yaml.safe_dump(value, default_flow_style=True, allow_unicode=True, sort_keys=False,
                          width=10_000)  # fmt: skip
    return text.removesuffix("\n").removesuffix("\n...")


def _without(text: str, data: Any, path: Path) -> str:
    """The text without the value at a path; ``data``, its values, lose it too."""
    *above, key = path
    parent, node, _ = _deepest(text, data, above)
    del parent[key]
    if node.flow_style:
        return text[: node.start_mark.index] + flow(parent) + text[node.end_mark.index :]
    begin, end = next((k.start_mark, v.end_mark) for k, v in node.value if k.value == key)
    if not parent:  # what is left is null
        holder, _, _ = _deepest(text, data, above[:-1])
        holder[above[-1]] = None
    return text[: begin.index - begin.column] + text[_line_end(text, end.index) :]


def _joined(text: str, data: Any, path: Path, value: Any) -> str:
    """The text with a value behind what is at a path; ``data``, its values, get it too."""
    subset, node, depth = _deepest(text, data, path)
    rest = path[depth:]
    for key in rest[:-1]:
        subset[key] = subset.get(key) or {}
        subset = subset[key]
    if rest:
        before = subset.get(rest[-1]) or type(value)()
        subset[rest[-1]] = {**before, **value} if isinstance(value, Mapping) else [*before, *value]
    elif isinstance(subset, dict):
        subset.update(value)
    else:
        subset.extend(value)
    whole, _, _ = _deepest(text, data, path[:depth])
    if node.flow_style or not node.value:
        return text[: node.start_mark.index] + flow(whole) + text[node.end_mark.index :]
    if rest and rest[0] in {key.value for key, _ in node.value}:
        raise KeyError(rest[0])  # null, or a value of another kind
    newline = "\r\n" if "\r\n" in text else "\n"
    indent, lines = " " * node.start_mark.column, []
    for key in rest:
        lines.append(f"{indent}{key}:")
        indent += "  "
    if isinstance(value, Mapping):
        lines += [f"{indent}{flow(key)}: {flow(item)}" for key, item in value.items()]
    else:
        lines += [f"{indent}- {flow(item)}" for item in value]
    while isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last = node.value[-1]  # block nodes end at what follows: their last value does not
        node = last[1] if isinstance(last, tuple) else last
    stop = _line_end(text, node.end_mark.index)
    gap = "" if text[stop - 1] == "\n" else newline
    return text[:stop] + gap + "".join(f"{line}{newline}" for line in lines) + text[stop:]


def _deepest(text: str, data: Any, path: Path) -> tuple[Any, Any, int]:
    """Values and YAML node of the deepest list or mapping on a path, and how deep it is."""
    node: Any = yaml.compose(text, Loader=yaml.SafeLoader)
    for depth, key in enumerate(path):
        results = {item.value: inner for item, inner in node.value}.get(key)
        if not isinstance(results, yaml.CollectionNode):
            return data, node, depth
        node, data = results, data[key]
    return data, node, len(path)


def _line_end(text: str, place: int) -> int:
    """Where the line of a place ends, its line feed included."""
    return text.find("\n", place) + 1 or len(text)

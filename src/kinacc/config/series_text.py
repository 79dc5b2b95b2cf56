"""Write a line of a series into the text of a configuration file; all else stays as it is."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

import yaml

from kinacc.config.reading import parsed
from kinacc.config.series import KEYS

_PLAIN = re.compile(r"(?=[^\W\d])[\w./-]*|\d+-\d{2}-\d{2}", re.ASCII)
_WORDS = ("true", "false", "yes", "no", "on", "off", "null", "y", "n")
_FILE = ("measurements", "file")
Pair = tuple[yaml.Node, yaml.Node]


def as_text(line: Mapping[str, str]) -> str:
    """A line as it stands in a file: ``{path: june.csv, date: 2026-06-02, base: moved}``."""
    told = [f"{key}: {_scalar(line[key])}" for key in KEYS if line.get(key)]
    return f"{{{', '.join(told)}}}"


def _scalar(text: str) -> str:
    plain = _PLAIN.fullmatch(text) and text.lower() not in _WORDS
    return text if plain else json.dumps(text, ensure_ascii=False)


def with_line(text: str, dataset: str, lines: Sequence[Mapping[str, str]]) -> str | None:
    """The text with further lines of a data set's series, None where it cannot be done safely.

    A data set without a series gets one: of its ``measurements.file.path``, which goes, ``lines``
    are all. What a parser makes of the text before and after differs by this alone.
    """
    try:
        whole = yaml.compose(text, Loader=yaml.SafeLoader)
        own = _at(whole, ("datasets", dataset))
        changed = _with_items(text, own, lines) if own is not None else None
    except (yaml.YAMLError, ValueError, IndexError):
        return None
    if changed is None:
        return None
    before, after = (parsed(each, "text") for each in (text, changed))
    if before[1] or after[1]:
        return None
    return changed if after[0].data == _expected(before[0].data, dataset, lines) else None


def _expected(data: Mapping[str, Any], dataset: str, lines: Sequence[Mapping[str, str]]) -> Any:
    """What the text has to say afterwards."""
    told, _ = parsed("\n".join(["lines:", *(f"- {as_text(each)}" for each in lines)]), "lines")
    own = dict(data["datasets"][dataset])
    if "series" not in own:
        section = dict(own["measurements"])
        file = {key: value for key, value in section["file"].items() if key != "path"}
        own["measurements"] = {**section, "file": file or None}
    own["series"] = [*own.get("series", ()), *told.data["lines"]]
    return {**data, "datasets": {**data["datasets"], dataset: own}}


def _with_items(text: str, own: yaml.Node, lines: Sequence[Mapping[str, str]]) -> str | None:
    items, newline = [as_text(each) for each in lines], "\r\n" if "\r\n" in text else "\n"
    series = _pair(own, "series")
    if series is not None:
        node = series[1]
        if not isinstance(node, yaml.SequenceNode) or not node.value:
            return None
        if _is_flow(node):
            end = node.end_mark.index - 1
            comma = "" if text[:end].rstrip().endswith(",") else ", "
            return f"{text[:end].rstrip(' ')}{comma}{', '.join(items)}{text[end:]}"
        indent = " " * node.start_mark.column
        return _after(text, _end(text, node), [f"{indent}- {each}" for each in items], newline)
    section = _pair(own, "measurements")
    file = _at(own, _FILE)
    path = _pair(file, "path") if file is not None else None
    if section is None or file is None or path is None or _is_flow(own):
        return None
    indent = " " * own.start_mark.column
    without, comment = _without(text, file, path)
    if without is None:
        return None
    end = _end(text, section[1]) + len(without) - len(text)
    head = f"{indent}series:{f' {comment}' if comment else ''}"
    return _after(without, end, [head, *(f"{indent}  - {each}" for each in items)], newline)


def _without(text: str, file: yaml.Node, path: Pair) -> tuple[str | None, str]:
    """The text without the pair of a mapping, and the comment behind it."""
    places = [number for number, pair in enumerate(file.value) if pair[0] is path[0]]
    number, (key, value) = places[0], path
    begin, end = key.start_mark.index, value.end_mark.index
    if end < begin:
        return None, ""  # an alias: what it stands for is elsewhere
    if _is_flow(file):
        if number + 1 < len(file.value):
            end = file.value[number + 1][0].start_mark.index
        elif number:
            begin = text.rindex(",", 0, begin)
        return (None if "#" in text[begin:end] else text[:begin] + text[end:]), ""
    first, last = text.rfind("\n", 0, begin) + 1, _line_end(text, end)
    comment = text[end:last].strip()
    if text[first:begin].strip() or (comment and not comment.startswith("#")):
        return None, ""
    return text[:first] + text[last:], comment


def _after(text: str, place: int, lines: Sequence[str], newline: str) -> str:
    """The text with lines below the line of a place."""
    end = _line_end(text, place)
    gap = "" if end == 0 or text[end - 1] == "\n" else newline
    return text[:end] + gap + "".join(f"{line}{newline}" for line in lines) + text[end:]


def _line_end(text: str, place: int) -> int:
    """Where the line of a place ends, its line feed included."""
    found = text.find("\n", place)
    return len(text) if found < 0 else found + 1


def _end(text: str, node: yaml.Node) -> int:
    """Where the last thing of a node ends, without comments and blanks that follow."""
    if isinstance(node, yaml.ScalarNode) or _is_flow(node) or not node.value:
        return len(text[: node.end_mark.index].rstrip())
    pairs = node.value if isinstance(node, yaml.MappingNode) else [(node, n) for n in node.value]
    ends = [_end(text, each) for pair in pairs for each in pair if each is not node]
    return max(ends)


def _is_flow(node: yaml.Node) -> bool:
    """Whether it is written in brackets."""
    return isinstance(node, yaml.CollectionNode) and bool(node.flow_style)


def _pair(node: yaml.Node, key: str) -> Pair | None:
    """Key and value of a mapping."""
    pairs = node.value if isinstance(node, yaml.MappingNode) else ()
    return next((pair for pair in pairs if pair[0].value == key), None)


def _at(node: yaml.Node | None, path: Sequence[str]) -> yaml.Node | None:
    """The node at a path of keys; None where there is none."""
    for key in path:
        pair = None if node is None else _pair(node, key)
        node = None if pair is None else pair[1]
    return node

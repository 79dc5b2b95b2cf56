"""JSON Schema of the settings, their defaults, and every key by its dotted path."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from typing import Any

from pydantic import BaseModel

from kinacc.config.fields import Section
from kinacc.config.settings import Configuration, DataSet, Settings

Node = dict[str, Any]


@cache
def json_schema(model: type[BaseModel] = Settings) -> Node:
    """JSON Schema of a model, for editors; with ``unit`` and ``execution`` of keys."""
    return model.model_json_schema()


@cache
def keys(model: type[BaseModel] = DataSet) -> dict[str, Node]:
    """Schema of every section and key by its path: ``study.alpha``, no places in lists."""
    results: dict[str, Node] = {}
    definitions = json_schema(model).get("$defs", {})

    def walk(node: Node, path: str) -> None:
        if "$ref" in node:
            node = definitions[node["$ref"].rpartition("/")[2]] | node
        if path:
            results.setdefault(path, node)
        for name, inner in node.get("properties", {}).items():
            walk(inner, f"{path}.{name}".lstrip("."))
        parts = [node["items"]] if "items" in node else []
        for inner in (*parts, *node.get("oneOf", ()), *node.get("anyOf", ())):
            walk(inner, path)

    walk(json_schema(model), "")
    return results


def key(path: str) -> Node:
    """The key at a dotted path such as ``study.alpha``: its default, unit, description, limits."""
    return keys()[path]


def defaults(model: type[Section] = Settings) -> dict[str, Any]:
    """Default values of a section (all settings if none) as nested dictionaries and lists."""
    return model().model_dump(by_alias=True)


def without_execution_keys(values: Mapping[str, Any], path: str = "") -> dict[str, Any]:
    """Settings without the keys that change only how a run is carried out, for hashing.

    Parameters
    ----------
    values
        Full settings of a data set, or of the section at ``path``.
    path
        Dotted path of the section, as ``study``.

    Returns
    -------
    dict
        A copy without keys that are marked ``execution``.
    """
    selected: dict[str, Any] = {}
    for name, value in values.items():
        here = f"{path}.{name}".lstrip(".")
        node = keys().get(here, {})
        if not node.get("execution"):
            is_section = isinstance(value, Mapping) and "properties" in node
            selected[name] = without_execution_keys(value, here) if is_section else value
    return selected


if __name__ == "__main__":
    print(json.dumps(json_schema(Configuration), indent=1))

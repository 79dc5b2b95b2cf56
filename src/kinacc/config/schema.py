"""JSON Schema of the settings, their defaults, and every key by its dotted path."""

from __future__ import annotations

import json
from collections.abc import Mapping
from copy import deepcopy
from functools import cache, reduce
from typing import Any

from pydantic import BaseModel

from kinacc.config.settings import Configuration, DataSet, Settings

Node = dict[str, Any]


@cache
def json_schema(model: type[BaseModel]) -> Node:
    """JSON Schema of a model, for editors; with ``unit`` and ``execution`` of keys."""
    return model.model_json_schema()


@cache
def keys() -> dict[str, Node]:
    """Schema of every section and key by its path: ``study.alpha``, no places in lists."""
    results: dict[str, Node] = {}
    definitions = json_schema(DataSet)["$defs"]

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

    walk(json_schema(DataSet), "")
    return results


def key(path: str) -> Node:
    """The key at a dotted path such as ``study.alpha``: its default, unit, description, limits."""
    return keys()[path]


def defaults() -> dict[str, Any]:
    """Default values of all settings, as nested dictionaries and lists."""
    return Settings().model_dump(by_alias=True)


def without_execution_keys(values: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of a data set without the keys that change only how a run is carried out."""
    selected = deepcopy(dict(values))
    for path, node in keys().items():
        if node.get("execution"):
            *sections, name = path.split(".")
            reduce(dict.__getitem__, sections, selected).pop(name, None)
    return selected


if __name__ == "__main__":
    print(json.dumps(json_schema(Configuration), indent=1))

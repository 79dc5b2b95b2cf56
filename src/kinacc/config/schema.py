"""What the models of the settings say of every key: defaults, what is allowed, JSON Schema."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from typing import Any

from pydantic import BaseModel

from kinacc.config.fields import Section
from kinacc.config.settings import Settings

DATASET_NAME = "[A-Za-z0-9_][A-Za-z0-9_-]*"  # with - first it would read as an option
Node = dict[str, Any]


@cache
def json_schema(model: type[BaseModel] = Settings) -> Node:
    """JSON Schema of a model, for editors; with ``unit`` and ``execution`` of keys."""
    return model.model_json_schema()


def node_at(path: tuple[Any, ...], model: type[BaseModel] = Settings) -> Node:
    """What the JSON Schema says at a path of keys, places in lists and kinds of gates."""
    whole = json_schema(model)
    node: Node = whole
    for step in path:
        if isinstance(step, int):
            node = {"unit": node.get("unit", "")} | node.get("items", {})
        elif "oneOf" in node:
            node = {"$ref": f"#/$defs/{str(step).capitalize()}"}
        else:
            node = node.get("properties", {}).get(step) or node.get("additionalProperties") or {}
        node = node if isinstance(node, dict) else {}
        for inner in [node, *node.get("anyOf", ())]:
            if "$ref" in inner:
                node = whole["$defs"][inner["$ref"].rpartition("/")[2]] | node
            elif inner.get("type") in ("array", "object"):
                node = inner | node
    return node


def key(path: str) -> Node:
    """The key at a dotted path such as ``study.alpha``: its default, unit, description, limits."""
    return node_at(tuple(path.split(".")))


def allowed(node: Node, unit: str = "") -> str:
    """What a key takes, in words."""
    unit = node.get("unit", unit)
    if "allowed" in node:
        return str(node["allowed"])
    if "anyOf" in node:
        return " or ".join(allowed(each, unit) for each in node["anyOf"])
    if words := node.get("enum", [node["const"]] if "const" in node else None):
        return ", ".join(repr(each) if not str(each).strip() else str(each) for each in words)
    if "properties" in node:
        return ", ".join(node["properties"])
    if "oneOf" in node:
        return "mappings, each with the key of one kind"
    kind = node.get("type", "")
    if kind == "array":
        if "pair" in node:
            return f"two numbers [smaller, larger]{_limits(node['items'], unit)}"
        fewest, most = node.get("minItems", 0), node.get("maxItems")
        count = "" if most is None else f" ({fewest if fewest == most else f'{fewest} to {most}'})"
        return f"a list{count} of: {allowed(node['items'], unit)}"
    if kind == "object":
        return f"a mapping of {allowed(node.get('propertyNames', {'type': 'string'}))} to text"
    if kind in ("integer", "number"):
        return f"a {'whole ' if kind == 'integer' else ''}number{_limits(node, unit)}"
    return {"null": "null", "boolean": "true, false", "string": "text"}.get(kind, "")


def _limits(node: Node, unit: str) -> str:
    low = node.get("minimum", node.get("exclusiveMinimum"))
    high = node.get("maximum", node.get("exclusiveMaximum"))
    ends = ", ends excluded" if "exclusiveMinimum" in node else ""
    parts = [f" in {unit}" if unit else "", "" if low is None else f" from {low:g}"]
    return "".join(parts) + ("" if high is None else f" to {high:g}") + ends


def defaults(model: type[Section] = Settings) -> dict[str, Any]:
    """Default values of a section (all settings if none) as nested dictionaries and lists."""
    return model().model_dump(by_alias=True)


def without_execution_keys(values: Mapping[str, Any], path: tuple[str, ...] = ()) -> dict[str, Any]:
    """Settings without the keys that change only how a run is carried out, for hashing.

    ``values`` may be any part of the settings that starts at the top level, or at ``path``.
    """
    kept: dict[str, Any] = {}
    for name, value in values.items():
        node = node_at((*path, name))
        if isinstance(value, Mapping) and "properties" in node:
            kept[name] = without_execution_keys(value, (*path, name))
        elif not node.get("execution"):
            kept[name] = value
    return kept


def plain(value: Any) -> Any:
    """A copy in plain dictionaries and lists, all the way down."""
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    return [plain(each) for each in value] if isinstance(value, (list, tuple)) else value


if __name__ == "__main__":
    from kinacc.config.settings import Configuration

    print(json.dumps(json_schema(Configuration), indent=1))

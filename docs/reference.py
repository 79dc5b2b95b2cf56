"""What the site adds to pages of commands, settings, tables and robots, from the code."""

import click

from kinacc.cli.group import SECTIONS, main
from kinacc.config.schema import json_schema
from kinacc.config.settings import Configuration
from kinacc.kinematics import robot
from kinacc.tables.contract import ARTEFACTS


def commands():
    """The help of each command, in the sections of ``kinacc --help``."""
    parts = []

    def entry(words, command):
        context = click.Context(command, info_name=words, terminal_width=80, max_content_width=80)
        parts.append(f"### {words}\n\n```text\n{command.get_help(context)}\n```\n")
        for name, below in getattr(command, "commands", {}).items():
            entry(f"{words} {name}", below)

    root = click.Context(main, info_name="kinacc")
    for title, names in SECTIONS.items():
        parts.append(f"\n## {title}\n")
        for name in names:
            entry(f"kinacc {name}", main.get_command(root, name))
    return "\n".join(parts)


def settings():
    """A table of keys for each section of the configuration."""
    schema = json_schema(Configuration)
    parts = []

    def section(node, path):
        node = schema["$defs"][node["$ref"].rpartition("/")[2]] if "$ref" in node else node
        keys = {name: each for name, each in node["properties"].items() if "$ref" not in each}
        parts.append(f"## {f'`{path}`' if path else 'Top level'}\n\n{node['description']}\n")
        needed = node.get("required", ())
        parts.append(
            _table(
                ("key", "default", "unit", "allowed", "meaning"),
                (
                    (f"`{name}`", "to be given" if name in needed else f"`{key.get('default')}`",
                     key.get("unit", "-"), allowed(key), key["description"])
                    for name, key in keys.items()
                ),
            )
        )  # fmt: skip
        for name, each in node["properties"].items():
            if "$ref" in each:
                section(each, f"{path}.{name}".lstrip("."))

    section(schema, "")
    for kind in schema["properties"]["gates"]["items"]["oneOf"]:
        section(kind, f"gates, {kind['$ref'].rpartition('/')[2].lower()}")
    return "\n".join(parts)


def tables():
    """A table of columns for each artefact."""
    parts, same = [], {0.0: "equal", None: "by the row's unit"}
    for each in ARTEFACTS.values():
        key = ", ".join(f"`{name}`" for name in each.key)
        parts.append(f"## {each.name}.parquet\n\n{each.meaning} Key: {key}.\n")
        rows = (
            (f"`{column.name}`", column.kind, column.unit or "-", column.limits or "any",
             same.get(column.same_within, str(column.same_within)), column.meaning)
            for column in each.columns
        )  # fmt: skip
        head = ("column", "type", "unit", "allowed", "same within", "meaning")
        parts.append(_table(head, rows))
    return "\n".join(parts)


def robots():
    """A table of the shipped robots."""
    arms = [robot.load(name) for name in robot.shipped()]
    rows = ((f"`{arm.name}`", str(arm.dh.joints), arm.source, arm.date) for arm in arms)
    return "\n## Sources\n\n" + _table(("name", "axes", "source", "date"), rows)


def _table(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    cells = ([cell.replace("|", "\\|") for cell in row] for row in lines)
    return "".join(f"| {' | '.join(row)} |\n" for row in cells)


def allowed(node, unit=""):
    """What a key takes, in words."""
    unit = node.get("unit", unit)
    if "allowed" in node:
        return str(node["allowed"])
    choices = node.get("anyOf", node.get("oneOf", ()))
    if any("$ref" in each for each in choices):
        return "mappings, each with the key of one kind"
    if choices:
        return " or ".join(allowed(each, unit) for each in choices)
    if words := node.get("enum", [node["const"]] if "const" in node else None):
        return ", ".join(repr(each) if not str(each).strip() else str(each) for each in words)
    if "properties" in node:
        return ", ".join(node["properties"])
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


def _limits(node, unit):
    low = node.get("minimum", node.get("exclusiveMinimum"))
    high = node.get("maximum", node.get("exclusiveMaximum"))
    ends = ", ends excluded" if "exclusiveMinimum" in node else ""
    parts = [f" in {unit}" if unit else "", "" if low is None else f" from {low:g}"]
    return "".join(parts) + ("" if high is None else f" to {high:g}") + ends

"""Values and records of configuration, apart from the schema, on whose texts no stage depends."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, TypeVar

Record = TypeVar("Record")


def of_section(record: type[Record], section: Mapping[str, Any]) -> Record:
    """A dataclass ``record`` of the values that a section has under the names of its fields.

    Lists become tuples. The section's other values are left out; TypeError where one is missing.
    """
    named = (each.name for each in fields(record) if each.name in section)  # type: ignore[arg-type]
    return record(**{name: _fixed(section[name]) for name in named})


def _fixed(value: Any) -> Any:
    return tuple(map(_fixed, value)) if isinstance(value, list) else value


def value_at(config: Mapping[str, Any], key: str) -> Any:
    """The value at a dotted path."""
    found: Any = config
    for part in key.split("."):
        found = found[part]
    return found


def with_values(config: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """``config`` with the ``values`` at their dotted paths; what is not on them is shared."""
    changed = dict(config)
    for path, value in values.items():
        first, _, rest = path.partition(".")
        changed[first] = with_values(changed[first], {rest: value}) if rest else value
    return changed

"""Values of a configuration at dotted paths."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


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

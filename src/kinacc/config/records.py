"""Records of sections of the configuration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, TypeVar

Record = TypeVar("Record")
Settings = Mapping[str, Any]  # a configuration or a section of it


def of_section(record: type[Record], section: Mapping[str, Any]) -> Record:
    """A dataclass of the values that a section has under the names of its fields.

    Parameters
    ----------
    record
        A dataclass.
    section
        Values by name; those without a field are left out.

    Returns
    -------
    record
        With lists as tuples.

    Raises
    ------
    TypeError
        Where a value is missing.
    """
    named = (item.name for item in fields(record) if item.name in section)  # type: ignore[arg-type]
    return record(**{name: _fixed(section[name]) for name in named})


def _fixed(value: Any) -> Any:
    return tuple(map(_fixed, value)) if isinstance(value, list) else value

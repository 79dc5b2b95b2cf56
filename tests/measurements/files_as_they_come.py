"""Measured files as trackers, arms and engineers write them, with what is true of each.

`FILES` maps a name to a function that writes one file, or two (joints first), into a folder and
returns a `Measured`. The kinds are those that a reader of measured files has to know.
"""

from __future__ import annotations

from inspect import getmembers, isfunction
from types import ModuleType

from measurements import (
    controllers_as_they_come,
    tables_as_they_come,
    trackers_as_they_come,
    workbooks_as_they_come,
)
from measurements.measured_file import Measured, Writer

__all__ = ["FILES", "Measured"]


def _writers(module: ModuleType) -> dict[str, Writer]:
    """Functions of a module that take a folder and return a measured file."""
    return {
        name: made
        for name, made in getmembers(module, isfunction)
        if made.__module__ == module.__name__ and made.__annotations__.get("return") == "Measured"
    }


FILES: dict[str, Writer] = {
    name: made
    for module in (
        tables_as_they_come,
        workbooks_as_they_come,
        trackers_as_they_come,
        controllers_as_they_come,
    )
    for name, made in _writers(module).items()
}

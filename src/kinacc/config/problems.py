"""What is wrong with settings, as their reader is told: place in the file, reason and remedy."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

from pydantic import ValidationError

from kinacc.config.reading import KeyPath, Place
from kinacc.config.schema import keys
from kinacc.config.values import did_you_mean, shown
from kinacc.errors import Problem

MOST_PROBLEMS = 100  # nobody reads more, and each is held against all names


def by_line(problem: Problem) -> list[Any]:
    """Texts and numbers of a place in turn, by which line 9 comes before line 10."""
    parts = re.split(r"(\d+)", problem.where)
    return [int(part) if part.isdecimal() else part for part in parts]


def _meant(path: KeyPath) -> str:
    """What to write instead of an unknown key of the settings."""
    path = path[2:] if path[0] == "datasets" else path
    *above, key = [str(step) for step in path if not isinstance(step, int)]
    known = [item.rpartition(".") for item in keys()]
    there = [name for section, _, name in known if section == ".".join(above)]
    homes = ["".join(item) for item in known if item[2] == key][:3]
    return did_you_mean(key, there) or (
        f"it belongs at {' or '.join(homes)}" if homes else f"known: {', '.join(there)}"
    )


def problems_of(
    error: ValidationError, place: Place, meant: Callable[[KeyPath], str] = _meant
) -> Iterator[Problem]:
    """The problems of a pydantic error; ``meant`` names what to write for an unknown key."""
    for item in error.errors(include_url=False)[: MOST_PROBLEMS + 1]:
        more = item.get("ctx", {})
        # Kinds of gates and of values, and keys that are values, are no steps of the file.
        path = (*item["loc"], *more.get("keys", ()))
        path = tuple(step for step in path if not (isinstance(step, str) and step[:1] == "["))
        message = item["msg"].removeprefix("Input ").partition(" or instance of ")[0]
        reason, fix = f"{shown(item['input'])} {message}", ""
        if item["type"] == "missing":
            path, reason = path[:-1], f"has no {path[-1]}"
        elif item["type"] == "extra_forbidden":
            reason, fix = f"unknown key {path[-1]!r}", meant(path)
        elif item["type"] == "refused":
            reason, fix = more["what"], more["fix"]
        elif item["type"] == "literal_error":
            fix = did_you_mean(item["input"], re.findall(r"'([^']*)'", more["expected"]))
        yield Problem(place(path), reason, fix=fix)

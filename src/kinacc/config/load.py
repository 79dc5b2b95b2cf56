"""Load configuration files: merge, complete every data set, check everything at once."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from kinacc.config import series
from kinacc.config.reading import KeyPath, Place, dotted, paths_of, read
from kinacc.config.schema import keys
from kinacc.config.settings import ROBOTS, Configuration
from kinacc.config.values import did_you_mean, overlay, shown
from kinacc.errors import InputError, Problem, gathered, input_error, refuse

Contradictions = Callable[..., Iterable[Problem]]
COMMAND_LINE = "command line"
_MOST_DATASETS = 5_000
_MOST_PROBLEMS = 100  # nobody reads more, and each is held against all names
# Whose text names a file, wherever these keys stand.
_FILES = ("robot", "path", "campaign")
# One value each, not a section: a data set's own replaces that of the top level.
_MAPPINGS = ("columns", "parameters", "frames", "accept")
_PATH = ("measurements", "file", "path")
# Given in two files, two different data sets share a name.
_IDENTITY = (("measurements", "source"), _PATH, ("series",))


def load(
    paths: Sequence[Path | str],
    overrides: Mapping[str, Any] | None = None,
    folder: Path | str = ".",
    contradictions: Contradictions = lambda *_: (),
    source: str = COMMAND_LINE,
) -> dict[str, dict[str, Any]]:
    """Read full settings of every data set, by name.

    Files are merged as Snakemake merges its ``--configfile``: sections key by
    key, all else replaced.

    Parameters
    ----------
    paths
        YAML files, in order; paths of data and robots in them are relative to the file.
    overrides
        Nested values laid over them, as from ``--config``; their paths are relative to ``folder``.
    folder
        What paths of the result are relative to.
    contradictions
        Yields Problems of settings that are valid one by one, of (full settings, place, folder).
    source
        What problems call the place of ``overrides``.

    Returns
    -------
    dict
        ``{name: settings}``: ``robot``, ``seed`` and all sections of :class:`Settings`,
        numbers in the units that their names carry.

    Raises
    ------
    InputError
        Listing every problem in all files.
    """
    contents: list[dict[str, Any]] = []
    problems: list[Problem] = []
    places: dict[KeyPath, str] = {}
    for path in paths:
        document = read(path)
        beside = os.path.relpath(Path(path).absolute().parent, folder)
        contents.append(_relocated(document.data, beside, Path(folder)))
        problems += document.problems
        for keys_ in document.lines:
            if keys_[2:] in _IDENTITY and keys_ in places:
                message = f"data set {keys_[1]!r} has its measurements given in two files"
                fix = "give the second data set a name of its own"
                allowed = f"once; first in {places[keys_]}"
                problems.append(Problem(document.place(keys_), message, allowed, fix))
        places |= {keys_: f"{path}:{line}" for keys_, line in document.lines.items()}
    if overrides:
        contents.append(dict(overrides))
        places |= dict.fromkeys(paths_of(overrides), source)
    if not contents:
        raise input_error("configuration", "no file given", fix="give config.yaml")
    merged = reduce(overlay, contents)
    shared = {key: value for key, value in merged.items() if key != "datasets"}
    datasets = merged.get("datasets")
    resolved: dict[str, dict[str, Any]] = {}
    if isinstance(datasets, Mapping) and 0 < len(datasets) <= _MOST_DATASETS:
        for name in datasets:
            with gathered(problems):
                resolved |= _data_set(name, datasets, shared, places, Path(folder), contradictions)
            if len(problems) > _MOST_PROBLEMS:
                break
    elif merged or not problems:
        message = "is no mapping of data sets by name" if datasets else "no data set is given"
        allowed = f"datasets: with a section for each of at most {_MOST_DATASETS}"
        where = places.get(("datasets",), str([*paths, source][0]))
        problems.append(Problem(where, message, allowed))
    if problems:
        problems = sorted(dict.fromkeys(problems), key=by_line)[:_MOST_PROBLEMS]
        title = f"{len(problems)} problems in the configuration" if len(problems) > 1 else ""
        raise InputError(problems, title)
    return resolved


def by_line(problem: Problem) -> list[Any]:
    """Texts and numbers of a place in turn, by which line 9 comes before line 10."""
    parts = re.split(r"(\d+)", problem.where)
    return [int(part) if part.isdecimal() else part for part in parts]


def _relocated(value: Any, beside: str, folder: Path, key: Any = None) -> Any:
    """Values whose files, named from the folder ``beside``, are as seen from ``folder``."""
    if isinstance(value, dict):
        return {name: _relocated(item, beside, folder, name) for name, item in value.items()}
    if isinstance(value, list):
        return [_relocated(item, beside, folder) for item in value]
    if key not in _FILES or not isinstance(value, str) or not value or os.path.isabs(value):
        return value
    near = os.path.normpath(f"{beside}/{value}").replace(os.sep, "/")
    is_name = (ROBOTS / f"{value}.yaml").is_file() or not os.path.exists(folder / near)
    return value if key == "robot" and is_name else near


def _data_set(
    name: str,
    datasets: Mapping[str, Any],
    shared: Mapping[str, Any],
    places: Mapping[KeyPath, str],
    folder: Path,
    contradictions: Contradictions,
) -> dict[str, dict[str, Any]]:
    """Full settings of a data set, and of those its series stands for, by name."""
    subset, base = datasets[name], ("datasets", name)

    def place(path: KeyPath) -> str:
        """Where a key was given last, else the section that it would stand in."""
        return next(
            f"{places[start + path[:length]]}, {dotted(start + path)}"
            for length in range(len(path), -1, -1)
            for start in (base, ())
            if start + path[:length] in places
        )

    content = overlay(shared, subset, _MAPPINGS) if isinstance(subset, Mapping) else subset
    try:
        whole = Configuration.model_validate(
            {"datasets": {name: content}}, context={"folder": folder}
        )
    except ValidationError as error:
        raise InputError(problems_of(error, lambda path: place(path[2:]))) from None
    full, problems = whole.datasets[name].model_dump(by_alias=True), []
    lines = [line.get("path") for line in subset.get("series") or ()]
    resolved = series.expanded(name, full)
    for item, settings in resolved.items():
        if item != name and item in datasets:
            message = f"its line {item} has the name of another data set"
            problems.append(Problem(place(("series",)), message, "another name"))
        path = settings["measurements"]["file"]["path"]

        def of_line(keys: KeyPath, path: str = path) -> str:
            is_line = keys == _PATH and path in lines
            return place(("series", lines.index(path), "path") if is_line else keys)

        problems += contradictions(settings, of_line, folder)
    refuse(problems)
    return resolved


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
    for item in error.errors(include_url=False)[: _MOST_PROBLEMS + 1]:
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

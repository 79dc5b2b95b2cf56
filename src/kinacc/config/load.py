"""Load configuration files: merge, complete every data set, check everything at once."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from functools import reduce
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from kinacc.config import series
from kinacc.config.reading import Document, KeyPath, Place, read
from kinacc.config.schema import keys
from kinacc.config.settings import ROBOTS, Configuration
from kinacc.config.values import did_you_mean, shown
from kinacc.errors import InputError, Problem

Contradictions = Callable[..., Iterable[Problem]]
COMMAND_LINE = "command line"
_MOST_DATASETS = 5_000
_MOST_PROBLEMS = 100  # nobody reads more, and each is held against all names
# Whose text names a file, wherever these keys stand.
_FILES = ("robot", "path", "campaign")
# One value each, not a section: a data set's own replaces that of the top level.
_MAPPINGS = ("columns", "parameters", "frames", "accept")
# Given in two files, two different data sets share a name.
_IDENTITY = (("measurements", "source"), ("measurements", "file", "path"), ("series",))


def load(
    paths: Sequence[Path | str],
    overrides: Mapping[str, Any] | None = None,
    folder: Path | str = ".",
    contradictions: Contradictions = lambda *_: (),
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
    documents: list[Document] = []
    problems: list[Problem] = []
    for path in paths:
        document, wrong = read(path)
        beside = os.path.relpath(Path(path).absolute().parent, folder)
        documents.append(
            replace(document, data=_relocated(document.data, beside, Path(folder)))
            if os.path.realpath(Path(path).parent) != os.path.realpath(folder)
            else document
        )
        problems += wrong
    if overrides:
        documents.append(Document(COMMAND_LINE, deepcopy(dict(overrides))))
    if not documents:
        raise InputError(Problem("configuration", "no file given", fix="give config.yaml"))
    merged = reduce(overlay, (item.data for item in documents))
    resolved: dict[str, dict[str, Any]] = {}
    if merged or not problems:
        problems += _given_twice(documents)
        shared = {key: value for key, value in merged.items() if key != "datasets"}
        datasets = merged.get("datasets")
        if not isinstance(datasets, Mapping) or not 0 < len(datasets) <= _MOST_DATASETS:
            message = (
                "no data set is given" if not datasets else "is no mapping of data sets by name"
            )
            allowed = f"datasets: with a section for each of at most {_MOST_DATASETS}"
            where = next((e.place(("datasets",)) for e in documents if "datasets" in e.data), None)
            problems.append(Problem(where or documents[0].name, message, allowed))
            datasets = {}
        for name, subset in datasets.items():
            context = {"folder": Path(folder), "dataset": name, "datasets": datasets}
            try:
                resolved |= _data_set(subset, shared, documents, context, contradictions)
            except InputError as error:
                problems += error.problems
            if len(problems) > _MOST_PROBLEMS:
                break
    if problems:
        problems = sorted(dict.fromkeys(problems), key=_line)[:_MOST_PROBLEMS]
        title = f"{len(problems)} problems in the configuration" if len(problems) > 1 else ""
        raise InputError(problems, title)
    return resolved


def _line(problem: Problem) -> tuple[str, int]:
    """File and line of a problem, to sort by."""
    file, _, rest = problem.where.partition(", ")[0].rpartition(":")
    return (file, int(rest)) if rest.isdecimal() else (problem.where, 0)


def overlay(
    below: Mapping[str, Any], above: Mapping[str, Any], whole: Sequence[str] = ()
) -> dict[str, Any]:
    """Lay values over settings, section by section.

    Parameters
    ----------
    below, above
        Nested settings; a value of ``above`` replaces that of ``below``.
    whole
        Names of mappings that are replaced as other values are.

    Returns
    -------
    dict
        A copy; ``below`` and ``above`` stay as they are.
    """
    merged = dict(below)
    for name, value in above.items():
        old = merged.get(name)
        both = isinstance(old, Mapping) and isinstance(value, Mapping) and name not in whole
        merged[name] = overlay(old, value, whole) if both else value  # type: ignore[arg-type]
    return merged


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
    subset: Any,
    shared: Mapping[str, Any],
    documents: Sequence[Document],
    context: Mapping[str, Any],
    contradictions: Contradictions,
) -> dict[str, dict[str, Any]]:
    """Full settings of a data set, and of those its series stands for, by name."""
    name = context["dataset"]

    def place(path: KeyPath) -> str:
        """Where a key was given last, else where the section was that it would stand in."""
        return next(
            document.place(base + path)
            for length in range(len(path), -1, -1)
            for base in (("datasets", name), ())
            for document in reversed(documents)
            if base + path[:length] and document.gives(base + path[:length])
        )

    content = overlay(shared, subset, _MAPPINGS) if isinstance(subset, Mapping) else subset
    try:
        whole = Configuration.model_validate({"datasets": {name: content}}, context=context)
    except ValidationError as error:
        raise InputError(problems_of(error, lambda path: place(path[2:]))) from None
    full, problems = whole.datasets[name].model_dump(by_alias=True), []
    if subset.get("gates") and any(item["datasets"] for item in full["gates"]):
        message = "names data sets inside of a data set, which its gates are about alone"
        problems.append(Problem(place(("gates",)), message, fix="leave datasets out of the gate"))
    full["gates"] = [item for item in full["gates"] if name in (item["datasets"] or [name])]
    resolved = series.expanded(name, full)
    lines = [line.get("path") for line in subset.get("series") or ()]
    for item, settings in resolved.items():
        if item != name and item in context["datasets"]:
            message = f"its line {item} has the name of another data set"
            problems.append(Problem(place(("series",)), message, "another name"))
        path = settings["measurements"]["file"]["path"]

        def of_line(keys: KeyPath, path: str = path) -> str:
            is_line = path in lines and keys == _IDENTITY[1]
            return place(("series", lines.index(path), "path") if is_line else keys)

        problems += contradictions(settings, of_line, context["folder"])
    if problems:
        raise InputError(problems)
    return resolved


def problems_of(error: ValidationError, place: Place) -> Iterator[Problem]:
    """The problems of a pydantic error, with the key that is nearest to an unknown one."""
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
            reason, fix = f"unknown key {path[-1]!r}", _meant(path)
        elif item["type"] == "refused":
            reason, fix = more["what"], more["fix"]
        elif item["type"] == "literal_error":
            fix = did_you_mean(item["input"], re.findall(r"'([^']*)'", more["expected"]))
        yield Problem(place(path), reason, fix=fix)


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


def _given_twice(documents: Sequence[Document]) -> Iterator[Problem]:
    """Data sets whose measurements are given in two files; the command line replaces on purpose."""
    first: dict[KeyPath, Document] = {}
    for document in documents:
        datasets = document.data.get("datasets") if document.name != COMMAND_LINE else None
        for name in datasets if isinstance(datasets, Mapping) else ():
            for path in (("datasets", name, *steps) for steps in _IDENTITY):
                if document.gives(path) and first.setdefault(path, document) is not document:
                    message = f"data set {name!r} has its measurements given in two files"
                    allowed = f"once; first in {first[path].place(path)}"
                    fix = "give the second data set a name of its own"
                    yield Problem(document.place(path), message, allowed, fix)

"""Load configuration files: merge, check everything at once, complete every data set."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from kinacc.config import gate_rules
from kinacc.config.reading import Document, KeyPath, dotted, read
from kinacc.config.schema import Section, plain, settings
from kinacc.config.series import contradicted, expanded, taken
from kinacc.config.validate import (
    ROBOT,
    ROBOTS,
    SERIES,
    check_dataset_name,
    check_robot,
    check_section,
    complete,
    overlay,
)
from kinacc.config.values import shown
from kinacc.errors import InputError, Problem

Contradictions = Callable[..., Iterable[Problem]]
COMMAND_LINE = "command line"
_MOST_DATASETS = 5_000
_MOST_PROBLEMS = 1_000  # more are not sought: each takes a search for what was meant
# What makes a data set the one it is: given in two files, two different data sets share a name.
_IDENTITY = (("measurements", "source"), ("measurements", "file", "path"), ("series",))
# Values that name files: in every data set, and of the top level.
_FILES = (
    ("robot",),
    ("measurements", "file", "path"),
    ("measurements", "file", "joints", "path"),
)
# The same in lists of mappings: the list, and the key.
_LISTED_FILES = (("series", "path"), ("gates", "campaign"))


def _none(*given: Any) -> tuple[Problem, ...]:
    """Settings that are each fine are all well together."""
    return ()


def load(
    paths: Sequence[Path | str],
    overrides: Mapping[str, Any] | None = None,
    folder: Path | str = ".",
    contradictions: Contradictions = _none,
) -> dict[str, dict[str, Any]]:
    """Full settings of every data set, by name.

    ``paths`` are merged in order as Snakemake merges its ``--configfile``: sections key by key, all
    else replaced. ``overrides`` (nested, as from ``--config``) come last. Paths of data and robots
    are relative to the file they stand in, those of ``overrides`` to the current ``folder``, and so
    are those returned. ``contradictions`` (name, robot, full settings, place, folder) yields what
    is wrong with settings that are each fine. Every data set has ``robot``, ``seed`` and all
    sections of schema.yaml, numbers in the units their names carry.

    Raises InputError listing every problem in all files.
    """
    documents, problems = [], []
    for path in paths:
        document, found = read(path)
        document, moved = _from_here(document, Path(folder))
        documents.append(document)
        problems += found + moved
    if overrides:
        documents.append(Document(COMMAND_LINE, plain(overrides)))
    if not documents:
        raise InputError(Problem("configuration", "no file given", fix="give config.yaml"))
    problems += _defined_twice(documents)
    merged: dict[str, Any] = {}
    for document in documents:
        merged = overlay(merged, document.data)
    if merged or not problems:
        resolved, found = _resolve(merged, documents, Path(folder), contradictions)
        problems += found
    if problems:
        problems.sort(key=_reading_order([document.name for document in documents]))
        count = len(problems)
        title = f"{count} problem{'s' if count > 1 else ''} in the configuration"
        raise InputError(problems, title)
    return resolved


def _from_here(document: Document, folder: Path) -> tuple[Document, list[Problem]]:
    """The document with the paths in it, which start where it stands, as seen from ``folder``."""
    beside = Path(document.name).absolute().parent
    if not document.data or os.path.realpath(beside) == os.path.realpath(folder):
        return document, []
    data, problems = document.data, []
    for path in _places_of_files(data):
        value = _value(data, path)
        if not isinstance(value, str) or not value or os.path.isabs(value):
            continue
        near = os.path.relpath(beside / value, folder).replace(os.sep, "/")
        there, here = os.path.exists(folder / near), os.path.exists(folder / value)
        if path[-1] == "robot" and ((ROBOTS / f"{value}.yaml").is_file() or not (there or here)):
            continue  # a robot's name
        if here and not there:
            fix = f"write {os.path.relpath(folder / value, beside)}"
            what = f"{shown(value)} is not there, seen from the folder of {document.name}"
            problems.append(Problem(document.place(path), what, "a path from there", fix))
        elif here and there and not os.path.samefile(folder / near, folder / value):
            warnings.warn(
                f"{document.place(path)}: {near} is read, beside the configuration file, and "
                f"not {value} of the current folder",
                stacklevel=2,
            )
        data = _with(data, path, value if here and not there else near)
    return replace(document, data=data), problems


def _places_of_files(data: Mapping[str, Any]) -> Iterator[KeyPath]:
    """Paths of the keys whose values name files, of the top level and of every data set."""
    datasets = data.get("datasets")
    names = datasets if isinstance(datasets, Mapping) else ()
    for start in [(), *(("datasets", name) for name in names)]:
        yield from ((*start, *keys) for keys in _FILES)
        for listed, key in _LISTED_FILES:
            items = _value(data, (*start, listed))
            for number in range(len(items) if isinstance(items, list) else 0):
                yield (*start, listed, number, key)


def _value(data: Any, path: KeyPath) -> Any:
    """The value at a path of keys and places in lists; None where there is none."""
    for key in path:
        if isinstance(data, list) and isinstance(key, int):
            data = data[key]
        else:
            data = data.get(key) if isinstance(data, Mapping) else None
    return data


def _with(data: Any, path: KeyPath, value: Any) -> Any:
    """A copy of ``data`` with another value at a path at which it has one."""
    if not path:
        return value
    copy = list(data) if isinstance(data, list) else dict(data)
    copy[path[0]] = _with(data[path[0]], path[1:], value)
    return copy


def _reading_order(names: Sequence[str]) -> Callable[[Problem], tuple[int, int]]:
    """Sort key of problems: file by file as given, then line by line."""

    def key(problem: Problem) -> tuple[int, int]:
        for number, name in enumerate(names):
            found = re.match(re.escape(name) + r"(?::(\d+))?(?:, |$)", problem.where)
            if found:
                return number, int(found.group(1) or 0)
        return len(names), 0

    return key


def _resolve(
    merged: Mapping[str, Any],
    documents: Sequence[Document],
    folder: Path,
    contradictions: Contradictions,
) -> tuple[dict[str, dict[str, Any]], list[Problem]]:
    def place(path: KeyPath) -> str:
        return _place(documents, path)

    names = ("datasets", *settings().names)
    top = Section("", "", (*settings().entries, Section("datasets", "", ())))
    shared, problems = check_section(
        top, {name: value for name, value in merged.items() if name != "datasets"}, (), place
    )
    datasets = merged.get("datasets")
    if not isinstance(datasets, Mapping) or not datasets:
        what = "no data set is given" if not datasets else f"{shown(datasets)} is not a section"
        where = place(("datasets",)) if "datasets" in merged else documents[0].place(())
        fix = f"known at the top level: {', '.join(names)}"
        problems.append(Problem(where, what, "datasets: with a section for each data set", fix))
        return {}, problems
    if len(datasets) > _MOST_DATASETS:
        what = f"{len(datasets)} data sets are given"
        allowed = f"at most {_MOST_DATASETS} in one run"
        return {}, [*problems, Problem(place(("datasets",)), what, allowed)]
    problems += gate_rules.wrong_datasets(
        shared.get("gates", ()), list(datasets), lambda *at: place(at)
    )
    resolved: dict[str, dict[str, Any]] = {}
    for name, content in datasets.items():
        if len(problems) > _MOST_PROBLEMS:
            what = "this data set and those after it were not looked at"
            problems.append(Problem(place(("datasets", name)), what, fix="mend the others first"))
            break
        problems += check_dataset_name(name, place)
        found, wrong = _dataset(name, content, shared, place, folder, contradictions)
        problems += [*wrong, *taken(name, found, datasets, place)]
        resolved |= found
    return resolved, list(dict.fromkeys(problems))


def _dataset(
    name: str,
    content: Any,
    shared: Mapping[str, Any],
    place: Callable[[KeyPath], str],
    folder: Path,
    contradictions: Contradictions,
) -> tuple[dict[str, dict[str, Any]], list[Problem]]:
    """Full settings of a data set, and of those its series stands for, by name."""
    path: KeyPath = ("datasets", name)
    problems: list[Problem] = []
    known = Section("", "", (ROBOT, SERIES, *settings().entries))
    own, found = check_section(known, content, path, place)
    robot, lines = own.pop("robot", None), own.pop("series", ())
    known_robot = None
    if robot is not None:
        unknown = check_robot(robot, (*path, "robot"), place, folder)
        known_robot = None if unknown else robot
        problems += unknown
    elif content is None or (isinstance(content, Mapping) and "robot" not in content):
        allowed = "robot: a shipped robot's name or the path of a robot file"
        problems.append(Problem(place(path), "names no robot", allowed))
    full = {"robot": robot, **complete(shared, own)}

    def origin(*keys: str | int) -> str:
        given: Any = own
        for key in keys:
            if isinstance(given, list):
                break  # a list is given whole
            given = given.get(key, {}) if isinstance(given, Mapping) else {}
        return place((*path, *keys)) if given != {} else f"{place(keys)} (data set {name})"

    def origin_of_line(number: int) -> Callable[..., str]:
        def of_file(*keys: str) -> str:
            is_path = keys == ("measurements", "file", "path")
            return place((*path, "series", number, "path")) if is_path else origin(*keys)

        return of_file

    problems += [*found, *(contradicted(full, origin) if lines else ())]
    problems += gate_rules.wrong_datasets(own.get("gates", ()), None, origin)
    problems += gate_rules.without_limit(full["gates"], name, full["tolerance"], origin)
    full["gates"] = gate_rules.about(full["gates"], name)
    if not lines:
        has_series = isinstance(content, Mapping) and "series" in content
        given = () if has_series else contradictions(name, known_robot, full, origin, folder)
        return {name: full}, [*problems, *given]
    resolved = expanded(name, full, lines)
    for line in lines:
        own_settings = resolved[line.dataset(name)]
        where = origin_of_line(line.number)
        problems += contradictions(name, known_robot, own_settings, where, folder)
    return resolved, problems


def _place(documents: Sequence[Document], path: KeyPath) -> str:
    """Where a key was given last, else the section it would stand in, else that it is a default."""
    for length in range(len(path), 0, -1):
        for document in reversed(documents):
            if document.gives(path[:length]):
                return document.place(path)
    return f"default, {dotted(path)}" if path else documents[-1].name


def _defined_twice(documents: Sequence[Document]) -> list[Problem]:
    problems = []
    first: dict[KeyPath, Document] = {}
    for document in documents:
        if document.name == COMMAND_LINE:
            continue  # replaces values on purpose
        datasets = document.data.get("datasets")
        for name in datasets if isinstance(datasets, Mapping) else ():
            for keys in _IDENTITY:
                path = ("datasets", name, *keys)
                if not document.gives(path):
                    continue
                if path in first:
                    what = f"data set {name!r} has its measurements given in two files"
                    allowed = f"once; first in {first[path].place(path)}"
                    fix = "give the second data set a name of its own"
                    problems.append(Problem(document.place(path), what, allowed, fix))
                first.setdefault(path, document)
    return problems

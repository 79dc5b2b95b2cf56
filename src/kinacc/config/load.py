"""Load configuration files: merge, check everything at once, complete every data set."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from kinacc.config import gate_rules, series
from kinacc.config.reading import Document, KeyPath, dotted, read
from kinacc.config.schema import plain
from kinacc.config.settings import Configuration, DataSet, Settings
from kinacc.config.validate import (
    ROBOTS,
    Place,
    check_dataset_name,
    check_robot,
    check_section,
)
from kinacc.config.values import shown
from kinacc.errors import InputError, Problem

Contradictions = Callable[..., Iterable[Problem]]
COMMAND_LINE = "command line"
_MOST_DATASETS = 5_000
_MOST_PROBLEMS = 1_000  # more are not sought: each takes a search for what was meant
# What makes a data set the one it is: given in two files, two different data sets share a name.
_IDENTITY = (("measurements", "source"), ("measurements", "file", "path"), ("series",))
# Values that name files: in every data set, and of the top level; and in lists of mappings.
_FILES: tuple[KeyPath, ...] = (("robot",), _IDENTITY[1], ("measurements", "file", "joints", "path"))
_LISTED_FILES = (("series", "path"), ("gates", "campaign"))
# One value each, not a section: a data set's own replaces that of the top level.
_MAPPINGS = ("columns", "parameters", "frames", "accept")


def load(
    paths: Sequence[Path | str],
    overrides: Mapping[str, Any] | None = None,
    folder: Path | str = ".",
    contradictions: Contradictions = lambda *_: (),
) -> dict[str, dict[str, Any]]:
    """Full settings of every data set, by name.

    ``paths`` are merged in order as Snakemake merges its ``--configfile``: sections key by key, all
    else replaced. ``overrides`` (nested, as from ``--config``) come last. Paths of data and robots
    are relative to the file they stand in, those of ``overrides`` to the current ``folder``, and so
    are those returned. ``contradictions`` (name, robot, full settings, place, folder) yields what
    is wrong with settings that are each fine. Every data set has ``robot``, ``seed`` and all
    sections of :class:`Settings`, numbers in the units their names carry.

    Raises InputError listing every problem in all files.
    """
    documents: list[Document] = []
    problems: list[Problem] = []
    for path in paths:
        document, found = read(path)
        documents.append(_from_here(document, Path(folder)))
        problems += found
    if overrides:
        documents.append(Document(COMMAND_LINE, plain(overrides)))
    if not documents:
        raise InputError(Problem("configuration", "no file given", fix="give config.yaml"))
    problems += _defined_twice(documents)
    merged: dict[str, Any] = {}
    for document in documents:
        merged = overlay(merged, document.data)
    resolved: dict[str, dict[str, Any]] = {}
    if merged or not problems:
        resolved, found = _resolve(merged, documents, Path(folder), contradictions)
        problems += found
    if problems:
        problems = sorted(dict.fromkeys(problems), key=_reading_order(documents))
        count = len(problems)
        title = f"{count} problem{'s' if count > 1 else ''} in the configuration"
        raise InputError(problems, title)
    return resolved


def overlay(
    below: Mapping[str, Any], above: Mapping[str, Any], whole: Sequence[str] = ()
) -> dict[str, Any]:
    """``below`` with the values of ``above`` laid over it, section by section.

    Mappings named in ``whole`` are replaced as other values are.
    """
    merged = dict(below)
    for name, value in above.items():
        old = merged.get(name)
        both = isinstance(old, Mapping) and isinstance(value, Mapping) and name not in whole
        merged[name] = overlay(old, value, whole) if both else value  # type: ignore[arg-type]
    return merged


def _from_here(document: Document, folder: Path) -> Document:
    """The document with the paths in it, which start where it stands, as seen from ``folder``."""
    beside = Path(document.name).absolute().parent
    if os.path.realpath(beside) == os.path.realpath(folder):
        return document
    data = plain(document.data)
    datasets = data.get("datasets")
    for own in [data, *(datasets.values() if isinstance(datasets, dict) else ())]:
        for holder, key in _holders_of_files(own):
            value = holder.get(key)
            if not isinstance(value, str) or not value:
                continue
            near = os.path.relpath(beside / value, folder).replace(os.sep, "/")
            is_name = (ROBOTS / f"{value}.yaml").is_file() or not os.path.exists(folder / near)
            if not os.path.isabs(value) and not (key == "robot" and is_name):
                holder[key] = near
    return replace(document, data=data)


def _holders_of_files(own: Any) -> Iterator[tuple[dict[str, Any], str]]:
    """Mappings, and the keys in them, whose values name files."""
    for *sections, key in _FILES:
        found = own
        for section in sections:
            found = found.get(section) if isinstance(found, dict) else None
        if isinstance(found, dict):
            yield found, key
    for listed, key in _LISTED_FILES:
        items = own.get(listed) if isinstance(own, dict) else None
        yield from (
            (item, key)
            for item in (items if isinstance(items, list) else ())
            if isinstance(item, dict)
        )


def _reading_order(documents: Sequence[Document]) -> Callable[[Problem], tuple[int, int]]:
    """Sort key of problems: file by file as given, then line by line."""

    def key(problem: Problem) -> tuple[int, int]:
        for number, document in enumerate(documents):
            found = re.match(re.escape(document.name) + r"(?::(\d+))?(?:, |$)", problem.where)
            if found:
                return number, int(found.group(1) or 0)
        return len(documents), 0

    return key


def _resolve(
    merged: Mapping[str, Any],
    documents: Sequence[Document],
    folder: Path,
    contradictions: Contradictions,
) -> tuple[dict[str, dict[str, Any]], list[Problem]]:
    def place(path: KeyPath) -> str:
        """Where a key was given last, else the section it would stand in, else a default."""
        for length in range(len(path), 0, -1):
            for document in reversed(documents):
                if document.gives(path[:length]):
                    return document.place(path)
        return f"default, {dotted(path)}" if path else documents[-1].name

    shared, datasets = dict(merged), merged.get("datasets")
    shared.pop("datasets", None)
    shared, problems = check_section(Configuration, shared, place)
    if not isinstance(datasets, Mapping) or not datasets:
        what = "no data set is given" if not datasets else f"{shown(datasets)} is not a section"
        where = place(("datasets",)) if "datasets" in merged else documents[0].place(())
        fix = f"known at the top level: {', '.join(Configuration.model_fields)}"
        problems.append(Problem(where, what, "datasets: with a section for each data set", fix))
        return {}, problems
    if len(datasets) > _MOST_DATASETS:
        what = f"{len(datasets)} data sets are given"
        allowed = f"at most {_MOST_DATASETS} in one run"
        return {}, [*problems, Problem(place(("datasets",)), what, allowed)]
    problems += gate_rules.wrong_datasets(shared.get("gates") or (), [*datasets], place)
    resolved: dict[str, dict[str, Any]] = {}
    for name, content in datasets.items():
        if len(problems) > _MOST_PROBLEMS:
            what = "this data set and those after it were not looked at"
            problems.append(Problem(place(("datasets", name)), what, fix="mend the others first"))
            break
        found, wrong = _dataset(name, content, shared, place, folder, contradictions)
        problems += [*wrong, *series.taken(name, found, datasets, place)]
        resolved |= found
    return resolved, problems


def _dataset(
    name: str,
    content: Any,
    shared: Mapping[str, Any],
    place: Place,
    folder: Path,
    contradictions: Contradictions,
) -> tuple[dict[str, dict[str, Any]], list[Problem]]:
    """Full settings of a data set, and of those its series stands for, by name."""
    path: KeyPath = ("datasets", name)

    def below(keys: KeyPath) -> str:
        return place((*path, *keys))

    problems = check_dataset_name(name, below(()))
    own, wrong = check_section(DataSet, content, below)
    problems += wrong
    robot, lines = own.pop("robot", None), series.by_date(own.pop("series", None) or ())
    problems += series.of_each_other(lines, below)
    known_robot = None
    if robot is not None:
        unknown = check_robot(robot, below(("robot",)), folder)
        known_robot = None if unknown else robot
        problems += unknown
    elif not isinstance(content, Mapping) or "robot" not in content:
        allowed = "robot: a shipped robot's name or the path of a robot file"
        problems.append(Problem(below(()), "names no robot", allowed))
    settings = Settings.model_validate(overlay(shared, own, _MAPPINGS))
    full = {"robot": robot, **settings.model_dump(by_alias=True)}

    def origin(*keys: str | int) -> str:
        given: Any = own
        for key in keys:
            if isinstance(given, list):
                break  # a list is given whole
            given = given.get(key, {}) if isinstance(given, Mapping) else {}
        return below(keys) if given != {} else f"{place(keys)} (data set {name})"

    problems += series.contradicted(full, origin) if lines else ()
    problems += gate_rules.wrong_datasets(own.get("gates") or (), None, below)
    problems += gate_rules.without_limit(full["gates"], name, full["tolerance"], origin)
    full["gates"] = gate_rules.about(full["gates"], name)
    resolved = series.expanded(name, full, [line for _, line in lines])
    is_series = bool(lines) or (isinstance(content, Mapping) and "series" in content)
    for number, line in lines if is_series else [(None, None)]:

        def of_file(*keys: str | int, number: int | None = number) -> str:
            is_line = number is not None and keys == _IDENTITY[1]
            return below(("series", number, "path")) if is_line else origin(*keys)

        one = resolved[f"{name}-{line.date}" if line else name]
        problems += contradictions(name, known_robot, one, of_file, folder)
    return resolved, problems


def _defined_twice(documents: Sequence[Document]) -> Iterator[Problem]:
    first: dict[KeyPath, Document] = {}
    for document in documents:
        datasets = document.data.get("datasets")
        if document.name == COMMAND_LINE or not isinstance(datasets, Mapping):
            continue  # replaces values on purpose
        paths = [("datasets", name, *keys) for name in datasets for keys in _IDENTITY]
        for path in filter(document.gives, paths):
            if path in first:
                what = f"data set {path[1]!r} has its measurements given in two files"
                allowed = f"once; first in {first[path].place(path)}"
                fix = "give the second data set a name of its own"
                yield Problem(document.place(path), what, allowed, fix)
            first.setdefault(path, document)

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
    """Full settings of every data set, by name.

    ``paths`` are merged in order as Snakemake merges its ``--configfile``: sections key by key, all
    else replaced. ``overrides`` (nested, as from ``--config``) come last. Paths of data and robots
    are relative to the file they stand in, those of ``overrides`` to the current ``folder``, and so
    are those returned. ``contradictions`` (full settings, place, folder) yields what is wrong with
    settings that are each fine. Every data set has ``robot``, ``seed`` and all sections of
    :class:`Settings`, numbers in the units their names carry.

    Raises InputError listing every problem in all files.
    """
    documents: list[Document] = []
    problems: list[Problem] = []
    for path in paths:
        document, wrong = read(path)
        if os.path.realpath(Path(path).parent) != os.path.realpath(folder):
            beside = os.path.relpath(Path(path).absolute().parent, folder)
            document = replace(document, data=_relocated(document.data, beside, Path(folder)))
        documents.append(document)
        problems += wrong
    if overrides:
        documents.append(Document(COMMAND_LINE, deepcopy(dict(overrides))))
    if not documents:
        raise InputError(Problem("configuration", "no file given", fix="give config.yaml"))
    merged = reduce(overlay, (each.data for each in documents))
    resolved: dict[str, dict[str, Any]] = {}
    if merged or not problems:
        problems += _given_twice(documents)
        shared = {key: value for key, value in merged.items() if key != "datasets"}
        datasets = merged.get("datasets")
        if not isinstance(datasets, Mapping) or not 0 < len(datasets) <= _MOST_DATASETS:
            what = "no data set is given" if not datasets else "is no mapping of data sets by name"
            allowed = f"datasets: with a section for each of at most {_MOST_DATASETS}"
            where = next((e.place(("datasets",)) for e in documents if "datasets" in e.data), None)
            problems.append(Problem(where or documents[0].name, what, allowed))
            datasets = {}
        for name, own in datasets.items():
            context = {"folder": Path(folder), "dataset": name, "datasets": datasets}
            found, wrong = _data_set(own, shared, documents, context, contradictions)
            resolved |= found
            problems += wrong
            if len(problems) > _MOST_PROBLEMS:
                break
    if problems:
        problems = sorted(dict.fromkeys(problems), key=_reading_order(documents))
        if len(problems) > _MOST_PROBLEMS:
            problems[_MOST_PROBLEMS:] = [Problem(documents[0].name, "more", fix="mend these first")]
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


def _relocated(value: Any, beside: str, folder: Path, key: Any = None) -> Any:
    """Values whose files, named from the folder ``beside``, are as seen from ``folder``."""
    if isinstance(value, dict):
        return {name: _relocated(each, beside, folder, name) for name, each in value.items()}
    if isinstance(value, list):
        return [_relocated(each, beside, folder) for each in value]
    if key not in _FILES or not isinstance(value, str) or not value or os.path.isabs(value):
        return value
    near = os.path.normpath(f"{beside}/{value}").replace(os.sep, "/")
    is_name = (ROBOTS / f"{value}.yaml").is_file() or not os.path.exists(folder / near)
    return value if key == "robot" and is_name else near


def _reading_order(documents: Sequence[Document]) -> Callable[[Problem], tuple[int, int]]:
    """Sort key of problems: file by file as given, then line by line."""
    names = [re.escape(each.name) for each in documents]

    def order(problem: Problem) -> tuple[int, int]:
        for number, name in enumerate(names):
            if match := re.match(rf"{name}(?::(\d+))?(?:, |$)", problem.where):
                return number, int(match[1] or 0)
        return len(names), 0

    return order


def _data_set(
    own: Any,
    shared: Mapping[str, Any],
    documents: Sequence[Document],
    context: Mapping[str, Any],
    contradictions: Contradictions,
) -> tuple[dict[str, dict[str, Any]], list[Problem]]:
    """Full settings of a data set, and of those its series stands for, by name."""
    name = context["dataset"]

    def place(path: KeyPath) -> str:
        """Where a key was given last, else where the section was that it would stand in."""
        for length in range(len(path), -1, -1):
            for base in (("datasets", name), ()):
                for document in reversed(documents):
                    if base + path[:length] and document.gives(base + path[:length]):
                        return document.place(base + path)
        raise AssertionError(path)  # the data set itself is given

    content = overlay(shared, own, _MAPPINGS) if isinstance(own, Mapping) else own
    try:
        whole = Configuration.model_validate({"datasets": {name: content}}, context=context)
    except ValidationError as error:
        return {}, [*problems_of(error, lambda path: place(path[2:]))]
    full, problems = whole.datasets[name].model_dump(by_alias=True), []
    if own.get("gates") and any(each["datasets"] for each in full["gates"]):
        what = "names data sets inside of a data set, which its gates are about alone"
        problems.append(Problem(place(("gates",)), what, fix="leave datasets out of the gate"))
    full["gates"] = [each for each in full["gates"] if name in (each["datasets"] or [name])]
    resolved = series.expanded(name, full)
    for each, settings in resolved.items():
        if each != name and each in context["datasets"]:
            what = f"its line {each} has the name of another data set"
            problems.append(Problem(place(("series",)), what, "another name"))
        path = settings["measurements"]["file"]["path"]
        lines = [line.get("path") for line in own.get("series") or ()]

        def of_line(keys: KeyPath, path: str = path, lines: list[Any] = lines) -> str:
            is_line = path in lines and keys == _IDENTITY[1]
            return place(("series", lines.index(path), "path") if is_line else keys)

        problems += contradictions(settings, of_line, context["folder"])
    return resolved, problems


def problems_of(error: ValidationError, place: Place) -> Iterator[Problem]:
    """What pydantic has against settings, with the key that is nearest to an unknown one."""
    for each in error.errors(include_url=False)[: _MOST_PROBLEMS + 1]:
        more = each.get("ctx", {})
        path = (*each["loc"], *more.get("keys", ()))
        # Kinds of gates and of values, and keys that are values, are no steps of the file.
        path = tuple(step for step in path if not (isinstance(step, str) and step[:1] == "["))
        kind, value, message = each["type"], each["input"], each["msg"]
        message = f"{shown(value)} {message.removeprefix('Input ')}".partition(" or instance of ")[
            0
        ]
        if kind == "missing":
            yield Problem(place(path[:-1]), f"has no {path[-1]}")
        elif kind == "extra_forbidden":
            yield Problem(place(path), f"unknown key {path[-1]!r}", fix=_meant(path))
        elif kind == "refused":
            yield Problem(place(path), more["what"], fix=more["fix"])
        elif kind == "literal_error":
            words = re.findall(r"'([^']*)'", more["expected"])
            yield Problem(place(path), message, fix=did_you_mean(value, words))
        else:
            yield Problem(place(path), message)


def _meant(path: KeyPath) -> str:
    """What to write instead of an unknown key of the settings."""
    path = path[2:] if path[0] == "datasets" else path
    steps, known = [str(step) for step in path if not isinstance(step, int)], keys()
    section = ".".join(steps[:-1])
    there = [each.rpartition(".")[2] for each in known if each.rpartition(".")[0] == section]
    homes = [each for each in known if each.rpartition(".")[2] == steps[-1]]
    return (
        did_you_mean(steps[-1], there)
        or (homes and f"it belongs at {' or '.join(homes[:3])}")
        or f"known: {', '.join(there)}"
    )


def _given_twice(documents: Sequence[Document]) -> Iterator[Problem]:
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

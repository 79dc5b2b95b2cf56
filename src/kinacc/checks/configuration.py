"""Read configuration files: merge, complete every data set, check everything at once."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from kinacc.config import series
from kinacc.config.edit import with_added
from kinacc.config.error_models import ALWAYS, ERROR_MODELS, asked_for, loaded
from kinacc.config.parameter_rules import rules
from kinacc.config.problems import MOST_PROBLEMS, by_line, problems_of
from kinacc.config.reading import KeyPath, dotted, paths_of, read
from kinacc.config.records import Settings
from kinacc.config.settings import SHIPPED, Configuration
from kinacc.config.values import overlay
from kinacc.errors import InputError, Problem, input_error, refuse
from kinacc.kinematics import robot as robots
from kinacc.tables.atomic import write_whole

COMMAND_LINE = "command line"
_MOST_DATASETS = 5_000
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
    merged, places, problems = _merged(paths, overrides or {}, Path(folder), source)
    shared = {key: value for key, value in merged.items() if key != "datasets"}
    datasets = merged.get("datasets")
    resolved: dict[str, dict[str, Any]] = {}

    def place(path: KeyPath) -> str:
        """Where a key of a data set was given last, else the section that it would stand in."""
        name, keys = path[:2], path[2:]
        return next(
            f"{places[start + keys[:length]]}, {dotted(start + keys)}"
            for length in range(len(keys), -1, -1)
            for start in (name, ())
            if start + keys[:length] in places
        )

    if isinstance(datasets, Mapping) and 0 < len(datasets) <= _MOST_DATASETS:
        whole = {
            name: overlay(shared, item, _MAPPINGS) if isinstance(item, Mapping) else item
            for name, item in datasets.items()
        }
        context = {"folder": folder}
        try:
            valid = Configuration.model_validate({"datasets": whole}, context=context).datasets
        except ValidationError as error:
            problems += problems_of(error, place)
            valid = {}
        for name, settings in valid.items():
            full, here = settings.model_dump(by_alias=True), ("datasets", name)
            for keys, *text in _of_the_arm(full, Path(folder)):
                problems.append(Problem(place((*here, *keys)), *text))
            lines = series.expanded(name, full)
            if repeated := [line for line in lines if line != name and line in datasets]:
                message = f"its line {repeated[0]} has the name of another data set"
                problems.append(Problem(place((*here, "series")), message, "another name"))
            resolved |= lines
    elif merged or not problems:
        message = "is no mapping of data sets by name" if datasets else "no data set is given"
        allowed = f"datasets: with a section for each of at most {_MOST_DATASETS}"
        where = places.get(("datasets",), str([*paths, source][0]))
        problems.append(Problem(where, message, allowed))
    problems = sorted(dict.fromkeys(problems), key=by_line)[:MOST_PROBLEMS]
    refuse(problems, f"{len(problems)} problems in the configuration" if problems[1:] else "")
    return resolved


def add_to(file: str, path: Sequence[str], value: Any) -> None:
    """Join a value to what a configuration file has at a path of keys, see :func:`with_added`."""
    place = Path(os.path.realpath(file))
    text = place.read_bytes().decode("utf-8")  # as bytes: line ends stay
    mode = place.stat().st_mode
    write_whole(place, with_added(text, path, value, file).encode("utf-8"), on_disk=True)
    place.chmod(mode & 0o7777)


def _merged(
    paths: Sequence[Path | str], overrides: Mapping[str, Any], folder: Path, source: str
) -> tuple[dict[str, Any], dict[KeyPath, str], list[Problem]]:
    """What files and ``overrides`` hold, where each key was given last, and problems of files."""
    contents: list[dict[str, Any]] = []
    problems: list[Problem] = []
    places: dict[KeyPath, str] = {}
    for path in paths:
        document = read(path)
        beside = os.path.relpath(Path(path).absolute().parent, folder)
        contents.append(_relocated(document.data, beside, folder))
        problems += document.problems
        for keys_ in document.lines:
            if keys_[2:] in _IDENTITY and keys_ in places:
                message = f"data set {keys_[1]!r} has its measurements given in two files"
                fix = "give the second data set a name of its own"
                allowed = f"once; first in {places[keys_]}"
                problems.append(Problem(document.place(keys_), message, allowed, fix))
        places |= {keys_: f"{path}:{line}" for keys_, line in document.lines.items()}
    if overrides:
        contents.append({**overrides})
        places |= dict.fromkeys(paths_of(overrides), source)
    if not contents:
        raise input_error("configuration", "no file given", fix="give config.yaml")
    return reduce(overlay, contents), places, problems


def _relocated(value: Any, beside: str, folder: Path, key: Any = None) -> Any:
    """Values whose files, named from the folder ``beside``, are as seen from ``folder``."""
    if isinstance(value, dict):
        return {name: _relocated(item, beside, folder, name) for name, item in value.items()}
    if isinstance(value, list):
        return [_relocated(item, beside, folder) for item in value]
    if key not in _FILES or not isinstance(value, str) or not value or os.path.isabs(value):
        return value
    near = os.path.normpath(f"{beside}/{value}").replace(os.sep, "/")
    is_name = value in SHIPPED or not os.path.exists(folder / near)
    return value if key == "robot" and is_name else near


def _of_the_arm(full: Settings, folder: Path) -> Iterator[tuple[Any, ...]]:
    """Keys, fault and what is allowed of settings of joints that the robot does not have."""
    robot, calibration = full["robot"], full["calibration"]
    try:
        arm = robots.load(robot if robot in SHIPPED else folder / robot)
    except InputError:  # faults of a robot file are its reader's
        return
    joints = arm.dh.joints
    hayati = calibration["dh"]["hayati_joints"]
    if hayati != "auto" and max(hayati, default=0) > joints:
        message = f"{robot} has no joint {max(hayati)}"
        yield ("calibration", "dh", "hayati_joints"), message, f"1 to {joints}"
    for kind in asked_for(calibration):
        if kind not in ALWAYS:
            for keys, *text in loaded(ERROR_MODELS[kind].estimator).contradictions(
                calibration, arm
            ):
                yield ("calibration", kind, *keys), *text
    for rule in rules(calibration["dh"]["parameters"]):
        if rule.joint is not None and not 1 <= rule.joint <= joints:
            message = f"there is no joint {rule.joint}"
            yield ("calibration", "dh", "parameters", rule.name), message, f"1 to {joints}"
    pairs = calibration["vec"]["joint_range"]
    if isinstance(pairs, list) and len(pairs) != joints:
        message = f"{len(pairs)} pairs for the {joints} joints of {robot}"
        yield ("calibration", "vec", "joint_range"), message, "one per joint"

"""A measured file added to the series of a data set, as one more line of its configuration."""

from __future__ import annotations

import datetime
import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kinacc.calibration import delivered
from kinacc.checks.contradictions import load
from kinacc.config.edit import flow, with_added
from kinacc.config.reading import read
from kinacc.config.series import FLAGS, MOVED, SAME, day_of
from kinacc.deployment.shared_readings import known_rows
from kinacc.errors import InputError, Problem, first_few, gathered, refuse
from kinacc.kinematics import robot
from kinacc.measurements import files, times
from kinacc.measurements.folds import split
from kinacc.measurements.layout import Layout
from kinacc.measurements.reader import read as read_measured
from kinacc.tables.atomic import write_whole
from kinacc.tables.columns import Columns

_MARK = "\ufeff"  # at the begin of a file by some editors


@dataclass(frozen=True)
class Added:
    """Lines ``written`` to the series of a data set in a configuration file."""

    config: str
    dataset: str
    written: tuple[str, ...]


def add(
    path: str,
    config: str,
    dataset: str | None = None,
    date: str | None = None,
    moved: Mapping[str, str | None] | None = None,
    first_date: str | None = None,
) -> Added:
    """Add a measured file to the series of a data set; one file becomes a series of two.

    Parameters
    ----------
    path, config
        The measured file and the configuration file.
    dataset
        Name of the data set; needed where there are several.
    date
        Day of the file, after that of the newest line; of its own times where not given.
    moved
        ``base`` and ``tool``: ``same`` or ``moved`` since the newest line.
    first_date
        Day of the file that is there, where the data set is no series yet.

    Raises
    ------
    InputError
        Listing all that is missing, where the settings cannot read the file, it has other
        targets or only known readings, or the text cannot be changed safely.
    """
    full = load([config])
    name = _named(full, dataset, config)
    settings = full[name]
    lines = settings.get("series", ())
    known = [_path(full[line["name"]]) for line in lines] or [_path(settings)]
    problems: list[Problem] = []
    flags = {flag: (moved or {}).get(flag) for flag in FLAGS}
    for flag, how in FLAGS.items():
        if flags[flag] not in (SAME, MOVED):
            what = f"is not given: whether {how} as in {known[-1]}"
            problems.append(Problem(f"--{flag}", what, f"{SAME}, {MOVED}"))
    day = _day("--date", date, path, settings, problems)
    last = lines[-1]["date"] if lines else None
    if last is None:
        last = _day("--first-date", first_date, known[-1], settings, problems)
    with gathered(problems):
        _require_alike(path, known, settings, flags["tool"])
    if day and last and day <= last:
        what = f"{day} is not after {last}, the day of {known[-1]}"
        problems.append(Problem("--date", what, "a later day; write earlier lines by hand"))
    refuse(problems, f"{path} was not added to {config}")
    new: list[dict[str, Any]] = [{"path": _beside(config, path), "date": day, **flags}]
    if not lines:
        written = read(config)[0].data["datasets"][name].get("measurements") or {}
        first = (written.get("file") or {}).get("path") or _beside(config, known[0])
        new.insert(0, {"path": first, "date": last})
    for line in new:
        line["date"] = datetime.date.fromisoformat(line["date"])
    _write(Path(os.path.realpath(config)), config, ("datasets", name), new, not lines)
    return Added(config, name, tuple(flow(line) for line in new))


def _write(place: Path, config: str, where: Sequence[str], lines: list, is_first: bool) -> None:
    """Put lines into the text of a configuration; links and modes stay."""
    text = place.read_bytes().decode("utf-8")  # as bytes: line ends stay
    only = (*where, "measurements", "file", "path") if is_first else ()
    changed = with_added(text.removeprefix(_MARK), (*where, "series"), lines, config, only)
    mode = place.stat().st_mode
    write_whole(place, (_MARK * text.startswith(_MARK) + changed).encode("utf-8"), on_disk=True)
    place.chmod(mode & 0o7777)


def _named(full: Mapping[str, Mapping], dataset: str | None, config: str) -> str:
    """The measured data set that is meant."""
    names = [
        name
        for name, settings in full.items()
        if settings["measurements"]["source"] == "file" and "line_of" not in settings
    ]
    if dataset in names or (dataset is None and len(names) == 1):
        return dataset or names[0]
    what = f"{dataset!r} is no measured data set of {config}" if dataset else "is not given"
    raise InputError(Problem("--dataset", what, ", ".join(names)))


def _path(settings: Mapping[str, Any]) -> str:
    return settings["measurements"]["file"]["path"]


def _beside(config: str, path: str) -> str:
    """A path as seen from the folder of a configuration file."""
    if os.path.isabs(path):
        return path
    return os.path.relpath(path, Path(config).absolute().parent).replace(os.sep, "/")


def _day(
    option: str, given: str | None, path: str, settings: Mapping, problems: list[Problem]
) -> str | None:
    """A day as given, or of the times of the file."""
    allowed = "a day as 2026-06-02"
    if given is not None:
        if day_of(given) is None:
            problems.append(Problem(option, f"{given!r} is no day", allowed))
        return day_of(given)
    try:
        days = times.days(files.load(path, Layout.of(settings["measurements"]["file"])))
    except InputError:
        days = []
    if len(days) != 1:
        problems.append(Problem(option, f"is not given: the day of {path}", allowed))
        return None
    return days[0]


def _require_alike(path: str, known: Sequence[str], settings: Mapping, tool: str | None) -> None:
    """InputError for a file that is no new line: unreadable, known readings, other targets."""
    arm = robot.load(settings["robot"])

    def measured(name: str) -> Columns:
        file = {**settings["measurements"]["file"], "path": name}
        measurements = {**settings["measurements"], "file": file}
        with warnings.catch_warnings(action="ignore"):  # printed when it is calibrated
            columns = read_measured(file, arm).columns
            return split(columns, {**settings, "measurements": measurements})

    new = measured(path)
    delivered.require_enough_rows({"measurements": new}, arm, settings["calibration"])
    for name in known:
        old = measured(name)
        if known_rows(new, old).all():
            raise InputError(Problem(path, f"holds the readings of {name}", "new readings"))
    one, two = (sorted({*table["target"].tolist()}) for table in (new, old))
    if one != two and (tool != MOVED or len(one) != len(two)):
        fix = "name them in measurements.file.targets or columns"
        allowed = f"{first_few(two)}, as {known[-1]}"
        raise InputError(Problem(path, f"has target {first_few(one)}", allowed, fix))

"""A measured file added to the series of a data set, as one more line of its configuration."""

from __future__ import annotations

import datetime
import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kinacc.checks.configuration import add_to, load
from kinacc.config.edit import flow
from kinacc.config.records import Settings
from kinacc.config.series import MOVED
from kinacc.deployment.shared_readings import known_rows
from kinacc.errors import first_few, input_error
from kinacc.kinematics import robot
from kinacc.measurements.reader import read as read_measured
from kinacc.tables.columns import Columns


@dataclass(frozen=True)
class Added:
    """Lines ``written`` to the series of a data set in a configuration file."""

    config: str
    dataset: str
    written: tuple[str, ...]


def add(
    path: str,
    config: str,
    base: str,
    tool: str,
    date: datetime.date,
    dataset: str | None = None,
    first_date: datetime.date | None = None,
) -> Added:
    """Add a measured file to the series of a data set; one file becomes a series of two.

    Parameters
    ----------
    path, config
        The measured file and the configuration file.
    base, tool
        ``same`` or ``moved`` since the newest line.
    date
        Day of the file, after that of the newest line.
    dataset
        Name of the data set; needed where there are several.
    first_date
        Day of the file that is there, where the data set is no series yet.

    Raises
    ------
    InputError
        Where the settings cannot read the file, its day is not the newest, it has other targets or
        only known readings, or the text cannot be changed safely.
    """
    full = load([config])
    names = [
        name
        for name, settings in full.items()
        if settings["measurements"]["source"] == "file" and "line_of" not in settings
    ]
    name = dataset or (names[0] if len(names) == 1 else "")
    if name not in names:
        raise input_error("--dataset", f"{name!r} is no measured data set", ", ".join(names))
    settings = full[name]
    lines = settings.get("series", ())
    known = [full[line["name"]]["measurements"]["file"]["path"] for line in lines]
    known = known or [settings["measurements"]["file"]["path"]]
    last = datetime.date.fromisoformat(lines[-1]["date"]) if lines else first_date
    if last is None:
        raise input_error("--first-date", "is not given", f"the day of {known[-1]}")
    if date <= last:
        message = f"{date} is not after {last}, the day of {known[-1]}"
        raise input_error("--date", message, "a later day; write earlier lines by hand")
    _require_alike(path, known, settings, tool)
    new: list[dict[str, Any]] = [
        {"path": _beside(config, path), "date": date, "base": base, "tool": tool}
    ]
    if not lines:
        new.insert(0, {"path": _beside(config, known[0]), "date": last})
    add_to(config, ("datasets", name, "series"), new)
    return Added(config, name, tuple(flow(line) for line in new))


def _beside(config: str, path: str) -> str:
    """A path as seen from the folder of a configuration file."""
    if os.path.isabs(path):
        return path
    return os.path.relpath(path, Path(config).absolute().parent).replace(os.sep, "/")


def _require_alike(path: str, known: Sequence[str], settings: Settings, tool: str) -> None:
    """InputError for a file that is no new line: unreadable, known readings, other targets."""
    arm, file = robot.load(settings["robot"]), settings["measurements"]["file"]

    def measured(name: str) -> Columns:
        with warnings.catch_warnings(action="ignore"):  # printed when it is calibrated
            return read_measured({**file, "path": name}, arm).columns

    new = measured(path)
    for name in known:
        old = measured(name)
        if known_rows(new, old).all():
            raise input_error(path, f"holds the readings of {name}", "new readings")
    targets, targets_before = (sorted({*table["target"].tolist()}) for table in (new, old))
    if targets != targets_before and (tool != MOVED or len(targets) != len(targets_before)):
        fix = "name them in measurements.file.targets or columns"
        allowed = f"{first_few(targets_before)}, as {known[-1]}"
        raise input_error(path, f"has target {first_few(targets)}", allowed, fix)

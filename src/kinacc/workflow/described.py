"""Settings of a data set whose results are there, from the configurations beside these."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from kinacc.checks.contradictions import load
from kinacc.config.schema import defaults
from kinacc.errors import InputError, Problem
from kinacc.workflow.data_sets import DataSets, read_data_sets

CONFIG = "config.yaml"
_OF_A_LINE = re.compile(r"-\d{4}-\d{2}-\d{2}$")
_FILES = 20  # beside results, looked through for a configuration


def beside(folder: Path) -> Iterator[tuple[Path, DataSets]]:
    """Configurations beside the folder of all results with the data set of a ``folder`` of them.

    That of a line of a series stands there by the name of the series.
    """
    series = _OF_A_LINE.sub("", folder.name).encode()
    for path in sorted((folder.parent / "..").glob("*.yaml"))[:_FILES]:
        with suppress(InputError, OSError):
            if path.name == CONFIG or series in path.read_bytes():
                plan = _planned(str(path), path.stat().st_mtime_ns)
                if folder.name in plan.settings:
                    yield path, plan


def calibration_settings(folder: Path, configs: Sequence[str] = ()) -> Mapping[str, Any]:
    """The section ``calibration`` by which the results in a folder were made.

    Parameters
    ----------
    folder
        Folder of a data set's results.
    configs
        Configuration files; without them, those beside the results.

    Returns
    -------
    Mapping
        The defaults where no configuration names the data set.
    """
    folder = folder.resolve()
    plans = [read_data_sets(configs)] if configs else [plan for _, plan in beside(folder)]
    known = [plan.settings[folder.name] for plan in plans if folder.name in plan.settings]
    return [*known, defaults()][0]["calibration"]


@cache
def _planned(path: str, changed_ns: int) -> DataSets:
    return read_data_sets([path])


def like_those_of(folder: Path, readings: Path) -> dict[str, Any]:
    """Settings by which a file of ``readings`` is read as those of the results in ``folder`` were.

    Nothing is left out of it and nothing held out. Raises InputError where the configuration of the
    results is not found, several are, or it names more than one file.
    """
    folder = folder.resolve()
    candidates: dict[str, dict[str, Any]] = {}
    for path, _ in beside(folder):
        settings = _of_file(load([path])[folder.name], readings)
        if settings is not None and settings not in candidates.values():
            candidates[path.name] = settings
    first = next(iter(candidates.values()), None)
    if (
        first is not None
        and len(candidates) == 1
        and not first["measurements"]["file"]["joints"]["path"]
    ):
        return first
    message = "is in a form that is not known: no configuration beside the results says how "
    message += f"the readings of {folder.name} were read"
    if len(candidates) > 1:
        message = f"could be read in several ways: {', '.join(candidates)} describe {folder.name}"
    elif first is not None:
        message = f"has no joints of its own: those of {folder.name} stand in a second file"
    fix = f"`kinacc init {readings}` writes a .yaml that describes it: give that in its place"
    raise InputError(Problem(str(readings), message, fix=fix))


def _of_file(settings: Mapping[str, Any], readings: Path) -> dict[str, Any] | None:
    """The settings of a data set with another file; None where its poses are from none."""
    measurements = settings["measurements"]
    if measurements["source"] != "file":
        return None
    file = {**measurements["file"], "path": str(readings), "source": None, "exclude": []}
    return {**settings, "measurements": {**measurements, "folds": None, "file": file}}

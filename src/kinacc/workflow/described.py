"""Configurations beside results: by which one they were made, and what has changed since."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from kinacc.checks.configuration import load
from kinacc.config.schema import defaults
from kinacc.errors import InputError, first_few, input_error
from kinacc.tables import store, sums
from kinacc.workflow.code import config_hash
from kinacc.workflow.data_sets import CALIBRATION, DataSets, read_data_sets

CONFIG = "config.yaml"
_OF_A_LINE = re.compile(r"-\d{4}-\d{2}-\d{2}$")
# Tables of rules that depend on whole sections of the settings, with these.
_MADE_WITH = {
    "summary": CALIBRATION,
    "assessment_points": ("robot", "evaluation"),
    "study": ("seed", "study"),
}


def beside(folder: Path) -> list[tuple[Path, DataSets]]:
    """Configurations beside the folder of all results with the data set of a ``folder`` of them.

    Those by which its calibration was made come first. That of a line of a series stands there by
    the name of the series.
    """
    series, results = _OF_A_LINE.sub("", folder.name).encode(), []
    for path in sorted((folder.parent / "..").glob("*.yaml")):
        with suppress(InputError, OSError):
            if path.name == CONFIG or series in path.read_bytes():
                data = _planned(str(path), path.stat().st_mtime_ns)
                if folder.name in data.settings:
                    results.append((path, data))
    return sorted(results, key=lambda item: _is_other(folder, item[1]))


@cache
def _planned(path: str, changed_ns: int) -> DataSets:
    return read_data_sets([path])


def _is_other(folder: Path, data: DataSets) -> bool:
    """Whether the calibration in a folder was made with other settings."""
    return "summary.parquet" in made_with_other_settings(folder, data)


def made_with_other_settings(folder: Path, data: DataSets) -> list[str]:
    """Names of tables in a results folder whose settings are not those of its data set now.

    An empty list where the configuration does not name the data set.
    """
    if folder.name not in data.settings:
        return []
    paths = [(folder / f"{name}.parquet", keys) for name, keys in _MADE_WITH.items()]
    return [
        path.name
        for path, keys in paths
        if path.is_file()
        and store.read_metadata(path).get("config_hash")
        != config_hash(data.chosen(folder.name, *keys))
    ]


def calibration_settings(folder: Path) -> Mapping[str, Any]:
    """The section ``calibration`` by which the results in a folder were made.

    Parameters
    ----------
    folder
        Folder of a data set's results.

    Returns
    -------
    Mapping
        Of a configuration beside the results; the defaults where none names the data set.
    """
    folder = folder.resolve()
    known = [plan.settings[folder.name] for _, plan in beside(folder)]
    return [*known, defaults()][0]["calibration"]


def like_those_of(folder: Path, readings: Path) -> dict[str, Any]:
    """Settings by which a file of ``readings`` is read as those of the results in ``folder`` were.

    Nothing is left out of it and nothing held out. Raises InputError where no configuration beside
    the results reads one file.
    """
    folder = folder.resolve()
    for path, _ in beside(folder):
        settings = load([path])[folder.name]
        measurements = settings["measurements"]
        file = {**measurements["file"], "path": str(readings), "source": None, "exclude": []}
        if measurements["source"] == "file" and not file["joints"]["path"]:
            return {**settings, "measurements": {**measurements, "folds": None, "file": file}}
    message = f"no configuration beside the results says how a file of {folder.name} is read"
    fix = f"kinacc init {readings}, and give the .yaml that it writes; or keep the results in "
    fix += "results/NAME beside the .yaml of data set NAME"
    raise input_error(str(readings), message, fix=fix)


def outdated_reason(folder: Path | str) -> str:
    """Why the calibration in a results folder is outdated, and the command that makes it anew.

    Measured files, robot files and tables are held to the digests that the stages left, settings
    to those of the configurations beside the results, where there are any.

    Parameters
    ----------
    folder
        Results folder of a data set.

    Returns
    -------
    str
        One line; empty where the calibration is not outdated, or cannot be read.
    """
    folder = Path(folder).resolve()
    try:
        changed = sums.changed_since(folder)
        known = [(os.path.relpath(path), _is_other(folder, data)) for path, data in beside(folder)]
    except (InputError, OSError):
        return ""  # whoever reads the results reports what is wrong with them
    if changed:
        reason = f"changed since the calibration: {first_few(changed, 3)}"
        paths = [path for path, _ in known]
    elif paths := [path for path, is_other in known if is_other]:
        made_by = [path for path, is_other in known if not is_other]
        by = f" (made with {made_by[0]})" if made_by else ""
        reason = f"{paths[0]} has other settings than the calibration{by}"
    else:
        return ""
    return f"{reason}; run {shlex.join(['kinacc', 'calibrate', *paths[:1]])}"

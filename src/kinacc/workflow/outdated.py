"""Whether results belong to the files and settings that are there now."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

from kinacc.errors import InputError, first_few
from kinacc.tables import store, sums
from kinacc.workflow.code import config_hash
from kinacc.workflow.data_sets import CALIBRATION, DataSets
from kinacc.workflow.described import beside

# Tables of rules that depend on whole sections of the settings, with these.
_MADE_WITH = {
    "summary": CALIBRATION,
    "assessment_points": ("robot", "evaluation"),
    "study": ("seed", "study"),
}


def made_with_other_settings(folder: Path, data: DataSets) -> list[str]:
    """Names of tables in a results folder whose settings are not those of its data set now.

    None where the configuration does not name the data set.
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
        of_results: list[str] = []
        others: list[str] = []
        for path, data in beside(folder):
            is_other = "summary.parquet" in made_with_other_settings(folder, data)
            (others if is_other else of_results).append(os.path.relpath(path))
    except (InputError, OSError):
        return ""  # whoever reads the results reports what is wrong with them
    if changed:
        again = shlex.join(["kinacc", "calibrate", *(of_results or others)[:1]])
        return f"changed since the calibration: {first_few(changed, 3)}; run {again}"
    if not others:
        return ""
    again = shlex.join(["kinacc", "calibrate", others[0]])
    if of_results:
        origin = f"made with the settings of {of_results[0]}"
        return (
            f"{origin}; {others[0]} has other settings for {folder.name}; to use these run {again}"
        )
    return f"settings in {others[0]} changed since the calibration; run {again}"

"""Whether results belong to the files and settings that are there now."""

from __future__ import annotations

from pathlib import Path

from kinacc.errors import InputError, first_few
from kinacc.tables import store, sums
from kinacc.workflow.code import config_hash
from kinacc.workflow.data_sets import DataSets
from kinacc.workflow.described import beside

# What a calibration depends on, and what the rule `summary` hands to its script.
CALIBRATION = ("seed", "robot", "measurements", "calibration", "tolerance")
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
    """Why the calibration in a results folder is outdated, in one line; empty where it is not.

    Measured files, robot files and tables are held to the digests that the stages left, settings
    to those of a configuration beside the results, if there is one.
    """
    folder = Path(folder).resolve()
    try:
        changed = sums.changed_since(folder)
        if changed:
            return f"changed since the calibration: {first_few(changed, 3)}"
        for path, data in beside(folder.parent, folder.name):
            if "summary.parquet" in made_with_other_settings(folder, data):
                return f"settings in {path.name} changed since the calibration"
    except (InputError, OSError):
        return ""  # whoever reads the results reports what is wrong with them
    return ""

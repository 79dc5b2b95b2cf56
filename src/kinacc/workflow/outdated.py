"""Whether results belong to the files and settings that are there now."""

from __future__ import annotations

from pathlib import Path

from kinacc.errors import InputError, first_few
from kinacc.tables import store, sums
from kinacc.workflow.code import config_hash
from kinacc.workflow.described import beside

# What a calibration depends on, and what the rule `summary` hands to its script.
CALIBRATION = ("seed", "robot", "measurements", "calibration", "tolerance")


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
        made_by = store.read_metadata(folder / "summary.parquet").get("config_hash")
        for path, data in beside(folder.parent, folder.name):
            if folder.name in data.settings:
                now = config_hash(data.chosen(folder.name, *CALIBRATION))
                if now != made_by:
                    return f"settings in {path.name} changed since the calibration"
    except (InputError, OSError):
        return ""  # whoever reads the results reports what is wrong with them
    return ""

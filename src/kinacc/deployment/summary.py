"""Sum up what the calibration of a data set is worth."""

from __future__ import annotations

from collections.abc import Mapping

from kinacc.calibration import summary
from kinacc.deployment import applicability, folder
from kinacc.kinematics import robot
from kinacc.tables.columns import Columns
from kinacc.tables.contract import columns_of


def run(inputs: Mapping, settings: Mapping) -> dict[str, Columns]:
    """``summary``: the facts of a half page, one a row."""
    arm = robot.of_text(str(inputs["robot"]["description"][0]), "robot.parquet")
    selected = folder.calibration(inputs, arm)
    share = applicability.share_of_box(selected, *summary.covered(inputs["measurements"], arm))
    found = summary.facts(inputs, arm, share)
    found += summary.of_tolerance(settings.get("tolerance"))  # left out where none is set
    return {"summary": columns_of("summary", found)}

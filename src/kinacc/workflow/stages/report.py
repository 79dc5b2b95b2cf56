"""Write the page that says what a data set's results are worth."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from kinacc.campaign import folder, of_calibration, report
from kinacc.campaign.of_calibration import Assessed
from kinacc.kinematics import robot
from kinacc.report import campaign, dataset
from kinacc.report.page import Page, Section
from kinacc.workflow.first_screen import first_screen


def run(inputs: Mapping, settings: Mapping) -> Page:
    """The page on the tables that are there, and on the campaign of their calibration.

    ``settings``: ``dataset``; ``folder`` where the results are not in their usual place, and
    ``outdated`` tables that are left out because they were made from others.
    """
    name = settings["dataset"]
    files = {role: each for role, each in inputs.items() if isinstance(each, Path)}
    tables = {role: each for role, each in inputs.items() if role not in files}
    campaigns = [each.parent for role, each in files.items() if role.startswith("campaign_")]
    bound = of_calibration.sought(name, tables, campaigns)
    place = Path(settings.get("folder", f"results/{name}"))
    arm = robot.of_text(str(tables["robot"]["description"][0]), "robot.parquet")
    outdated = settings.get("outdated", ())
    reason = settings.get("reason", "")
    first, found = first_screen(place, name, tables, bound, outdated, reason)
    section = _campaign(bound.assessed) if bound.assessed else None
    return dataset.page(first, tables, arm, found.facts, section)


def _campaign(assessed: Assessed) -> Section:
    state, tables = report.tables(folder.open_(assessed.place))
    return campaign.section(state, tables, "campaign")

"""The first screen of a data set's report, by the tables and the campaign that are there."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

from kinacc.campaign.of_calibration import Sought
from kinacc.deployment.history_words import first_words
from kinacc.kinematics import robot
from kinacc.report.campaign_answers import answers
from kinacc.report.first_screen import Answers, remedies, screen
from kinacc.report.page import FirstScreen
from kinacc.workflow.answer import Tables, Told, told


def first_screen(
    folder: Path, name: str, tables: Tables, bound: Sought, outdated: Sequence[str]
) -> tuple[FirstScreen, Told]:
    """The first screen of the results in ``folder``, and what else there is to tell of them.

    ``outdated`` tables were made from others than are there, and are not among ``tables``.
    """
    found = told(folder, tables, bound, False, f"check_{name}", f"exported_{name}")
    said = Answers(
        claims=found.claims,
        other=found.other,
        largest=found.largest,
        campaign=answers(bound.assessed.state) if bound.assessed else (),
        following=found.following,
        outdated=outdated,
        more=shlex.join(["kinacc", "fitted", str(folder), "--all"]),
        history=first_words(tables["history"]) if "history" in tables else "",
    )
    arm = robot.of_text(str(tables["robot"]["description"][0]), "robot.parquet")
    to_do = remedies(tables.get("data_check"))
    return screen(name, arm.name, found.facts, to_do, said), found

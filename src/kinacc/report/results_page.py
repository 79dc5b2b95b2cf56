"""The page of a data set's results, by the tables and the campaign that are there."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

from kinacc.calibration import summary
from kinacc.calibration.summary import Fact, Tolerance, of
from kinacc.campaign import folder as campaigns
from kinacc.campaign import of_calibration, report, tolerance
from kinacc.campaign.of_calibration import Assessed, Sought
from kinacc.deployment.history_words import first_words
from kinacc.kinematics import robot
from kinacc.report import campaign, dataset
from kinacc.report.answer import Tables, Told, told
from kinacc.report.campaign_answers import answers
from kinacc.report.first_screen import Answers, remedies, screen
from kinacc.report.page import FirstScreen, Page, Section


def first_screen(
    folder: Path,
    name: str,
    tables: Tables,
    bound: Sought,
    outdated: Sequence[str],
    reason: str = "",
) -> tuple[FirstScreen, Told]:
    """The first screen of the results in ``folder``, and what else there is to tell of them.

    ``outdated`` tables were made from others than are there, and are not among ``tables``.
    """
    found = told(folder, tables, bound, False, f"check_{name}", f"exported_{name}")
    stated = summary.tolerance(found.facts)
    said = Answers(
        claims=found.claims,
        other=found.other,
        largest=found.largest,
        campaign=answers(bound.assessed.state, stated) if bound.assessed else (),
        following=found.following,
        outdated=outdated,
        reason=reason,
        more=shlex.join(["kinacc", "fitted", str(folder), "--all"]),
        tolerance=_kept(stated, found.facts, bound),
        history=first_words(tables["history"]) if "history" in tables else "",
    )
    arm = robot.of_text(str(tables["robot"]["description"][0]), "robot.parquet")
    to_do = remedies(tables.get("data_check"))
    return screen(name, arm.name, found.facts, to_do, said), found


def _kept(stated: Tolerance | None, facts: Sequence[Fact], bound: Sought) -> str:
    """Whether the tolerance of the configuration is kept; empty where its campaign says so."""
    if stated is None or (stated.of == tolerance.BOUND and bound.assessed):
        return ""
    if stated.of == tolerance.BOUND:
        judged = tolerance.by_bound(stated.mm, None, False)
    else:
        chosen = of(facts, "selection").items()
        best = next(model for model, known in chosen if known["selected"].value)
        known = of(facts, "held_out_error").get(best, {})
        judged = tolerance.by_held_out(stated, {name: each.value for name, each in known.items()})
    return tolerance.in_words(stated, tolerance.OF_CONFIGURATION, judged)


def run(inputs: Mapping, settings: Mapping) -> Page:
    """The page on the tables that are there, and on the campaign of their calibration.

    ``settings``: ``dataset``; ``folder`` where the results are not in their usual place, and
    ``outdated`` tables that are left out because they were made from others.
    """
    name = settings["dataset"]
    files = {role: each for role, each in inputs.items() if isinstance(each, Path)}
    tables = {role: each for role, each in inputs.items() if role not in files}
    places = [each.parent for role, each in files.items() if role.startswith("campaign_")]
    bound = of_calibration.sought(name, tables, places)
    place = Path(settings.get("folder", f"results/{name}"))
    arm = robot.of_text(str(tables["robot"]["description"][0]), "robot.parquet")
    outdated = settings.get("outdated", ())
    reason = settings.get("reason", "")
    first, found = first_screen(place, name, tables, bound, outdated, reason)
    section = _campaign(bound.assessed) if bound.assessed else None
    return dataset.page(first, tables, arm, found.facts, section)


def _campaign(assessed: Assessed) -> Section:
    state, tables = report.tables(campaigns.open_(assessed.place))
    return campaign.section(state, tables, "campaign")

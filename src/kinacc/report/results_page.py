"""The page of a data set's results, by the tables and the campaign that are there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from kinacc.calibration.summary import LARGE_SHARE
from kinacc.campaign import folder as campaigns
from kinacc.campaign import of_calibration, report
from kinacc.kinematics import robot
from kinacc.report import campaign, dataset, terminal
from kinacc.report.page import FirstScreen, Page, Table, Text
from kinacc.report.summary import CalibrationSummary, summarise


def first_screen(summary: CalibrationSummary, left_out: Sequence[str] = ()) -> FirstScreen:
    """The answer, the errors before and after, and what is open.

    ``left_out``: tables made from others than those now there.
    """
    position, turned = summary.position_errors(), summary.orientation_errors()
    units = ["mm", "mrad"] if turned else ["mm"]
    statistics = ("mean", f"{LARGE_SHARE:.0%}", "largest")
    heads = ("model", *(f"{name}, {unit}" for unit in units for name in statistics))
    rows = []
    for model, errors in position.items():
        parts = [errors, turned.get(model)] if turned else [errors]
        sizes = [(part.mean, part.quantile_99, part.largest) if part else () for part in parts]
        cells = [terminal.size(each) for three in sizes for each in three]
        rows.append((summary.label(model), *cells, *[""] * (len(heads) - 1 - len(cells))))
    where = "held-out" if summary.is_held_out else "fitted"
    count = terminal.counted(summary.best.n, "reading")
    table = Table(
        f"Errors at the same {count} ({where}) for every model",
        heads,
        tuple(rows),
        numeric=frozenset(range(1, len(heads))),
        marked={list(position).index(summary.selected): "selected"},
    )
    notes = [(topic, texts) for topic, texts in terminal.notes(summary, None).items()]
    if left_out:
        made = f"{', '.join(left_out)}: made from other tables than those here, so not shown"
        notes.append(("Left out", [made, "kinacc check-results names the command to run."]))
    steps: list[Text] = []
    for step in summary.next_steps:
        steps += [Text(f"{step.purpose}:"), Text(step.command, code=True)]
    return FirstScreen(
        summary.name,
        terminal.about(summary),
        _badge(summary),
        answers=tuple(terminal.headline(summary)),
        tables=(table,),
        notes=(
            ("Next", tuple(steps)),
            *((topic, tuple(Text(each) for each in texts)) for topic, texts in notes),
        ),
    )


def _badge(summary: CalibrationSummary) -> tuple[str, bool]:
    """The result of the data check in two or three words, and whether it is a warning."""
    if summary.synthetic:
        return "SYNTHETIC ARM", False
    if not summary.checked:
        return "DATA: not checked", True
    count = sum(each.is_open for each in summary.findings)
    return (
        (f"DATA: {terminal.counted(count, 'problem')}", True)
        if count
        else ("DATA: no open problem", False)
    )


def run(inputs: Mapping, settings: Mapping) -> Page:
    """The page on the tables that are there, and on the campaign of their calibration.

    ``settings``: ``dataset``; ``folder`` where the results are not in their usual place,
    ``outdated`` tables that are left out, and ``reason``, why all results are outdated.
    """
    name = settings["dataset"]
    files = {role: each for role, each in inputs.items() if isinstance(each, Path)}
    tables = {role: each for role, each in inputs.items() if role not in files}
    places = [each.parent for role, each in files.items() if role.startswith("campaign_")]
    place = Path(settings.get("folder", f"results/{name}"))
    summary = summarise(place, tables, places, settings.get("reason", ""))
    arm = robot.of_text(str(tables["robot"]["description"][0]), "robot.parquet")
    assessed = of_calibration.sought(name, tables, places).assessed
    section = None
    if assessed is not None:
        state, found = report.tables(campaigns.open_(assessed.place))
        section = campaign.section(state, found, "campaign")
    first = first_screen(summary, settings.get("outdated", ()))
    return dataset.page(first, tables, arm, summary, section)

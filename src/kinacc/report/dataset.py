"""The page of a data set: the answer, then the evidence, a section a subject."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from kinacc.artifacts.allowed import FINDING_LEVELS, LEFT_OUT
from kinacc.artifacts.columns import Columns
from kinacc.calibration.summary import Fact
from kinacc.kinematics.robot import Robot
from kinacc.report import first_screen, residuals
from kinacc.report.first_screen import Answers
from kinacc.report.page import Page


def page(
    name: str, tables: Mapping[str, Columns], robot: Robot, facts: Sequence[Fact], answers: Answers
) -> Page:
    """The page on the tables of a data set."""
    return Page(
        first_screen.screen(name, robot.name, facts, _remedies(tables.get("data_check")), answers),
        (residuals.section(tables, robot),),
    )


def _remedies(found: Columns | None) -> list[str]:
    """What to do about findings of the data check that nobody accepted."""
    if found is None:
        return []
    columns = (found[name] for name in ("level", "lines", "fix", "accepted"))
    return [
        ": ".join(str(each) for each in (lines, fix) if each)
        for level, lines, fix, accepted in zip(*columns, strict=True)
        if level not in (FINDING_LEVELS[-1], LEFT_OUT) and fix and not accepted
    ]

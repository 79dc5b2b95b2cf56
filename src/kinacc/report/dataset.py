"""The page of a data set: the answer, then the evidence, a section a subject."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from kinacc.kinematics.robot import Robot
from kinacc.report import (
    accuracy_map,
    data_check,
    histories,
    identifiability,
    paper,
    parameters,
    residuals,
    robot_history,
    selection,
    study,
    terminal,
)
from kinacc.report.page import FirstScreen, Page, Part, Section
from kinacc.report.summary import CalibrationSummary
from kinacc.tables.columns import Columns

# In the order of the page: what a section reads, and how it is made.
_OF_THE_FIT: tuple[tuple[str, Callable[..., Part]], ...] = (
    ("history", robot_history.section),
    ("pose_errors", residuals.section),
    ("accuracy_map", accuracy_map.section),
    ("measurements", data_check.section),
    ("dh_covariance", identifiability.section),
    ("dh_model", parameters.section),
)
_OF_THE_STUDY: tuple[tuple[str, Callable[..., Part]], ...] = (
    ("study_summary", study.section),
    ("histories", histories.section),
    ("claims", paper.tables_section),
    ("claims", paper.claims_section),
)


def page(
    first: FirstScreen,
    tables: Mapping[str, Columns],
    robot: Robot,
    summary: CalibrationSummary,
    campaign: Section | None,
) -> Page:
    """The page on the tables of a data set; each section where there is what it reads."""
    return Page(
        first,
        (
            *(make(tables, robot) for needed, make in _OF_THE_FIT if needed in tables),
            selection.section(tables, terminal.selection(summary)),
            *([campaign] if campaign else []),
            *(make(tables, robot) for needed, make in _OF_THE_STUDY if needed in tables),
        ),
    )

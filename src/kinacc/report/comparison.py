"""Two calibrations of one arm on a page: what moved, where, and by how much more than chance."""

from __future__ import annotations

import numpy as np

from kinacc.config.error_models import model_name
from kinacc.deployment import compare
from kinacc.deployment.compare import Difference
from kinacc.deployment.record import FLANGE, Calibration
from kinacc.kinematics.model import JointState
from kinacc.report import comparison_sections
from kinacc.report.comparison_lines import NEXT, lines
from kinacc.report.comparison_sections import SHIFTS, Case
from kinacc.report.page import FirstScreen, Page, Table, Text


def comparison_page(found: Difference, first: Calibration, q_rad: np.ndarray) -> Page:
    """The page of a comparison at reported joints ``q_rad`` (n, k), rad and mm, all given to it.

    ``first``: the first of the two calibrations.
    """
    q_rad = q_rad[found.covered]
    slides = first.robot.dh.prismatic
    case = Case(
        found,
        1 + np.flatnonzero(found.covered),
        np.where(slides, q_rad, np.rad2deg(q_rad)),
        slides,
        first.pose(JointState(first.robot.dh_joints(q_rad)), "base", FLANGE).position_mm,
    )
    robots = ", ".join(dict.fromkeys(found.robots))
    valid = "for these poses of the flange in the robot's base, as modelled; no readings"
    notes = {"VALID": valid, "NEXT": NEXT[found.verdict]}
    screen = FirstScreen(
        "{1} against {0}".format(*found.names),
        f"{robots}, {model_name(found.model)} model; {len(q_rad)} poses of the flange",
        (found.verdict.upper(), found.verdict not in (compare.SAME_READINGS, compare.UNPROVEN)),
        tuple(map(_sentence, lines(found))),
        () if found.verdict == compare.NOT_COMPARABLE else (_table(case),),
        tuple((name, (Text(_sentence(line)),)) for name, line in notes.items()),
    )
    parts = [comparison_sections.moved(case), comparison_sections.where(case)]
    if found.parameters is not None and len(found.parameters):
        parts.append(comparison_sections.parameters(found, found.parameters))
    made = {"first": found.names[0], "second": found.names[1], "model": found.model}
    return Page(screen, tuple(parts), {**made, "poses": str(len(q_rad))})


def _table(case: Case) -> Table:
    rows = []
    for key, shift in case.shifts.items():
        sizes = shift.rms_mm, shift.chance_mm, float(shift.position_mm.max())
        turns = 1e3 * shift.rms_rad, 1e3 * shift.chance_rad
        shown = (f"{each:.3f}" if np.isfinite(each) else "–" for each in (*sizes, *turns))
        rows.append((SHIFTS[key][0], *shown))
    heads = ("", "rms mm", "by chance mm", "largest mm", "rms mrad", "by chance mrad")
    caption = "How far the poses of {1} are from those of {0}".format(*case.found.names)
    return Table(caption, heads, tuple(rows), numeric=frozenset(range(1, 6)))


def _sentence(line: str) -> str:
    """A line with a capital at its begin and a stop at its end."""
    return f"{line[:1].upper()}{line[1:]}."

"""The section on a robot's history, and its sentence on the first screen."""

from __future__ import annotations

from made_up_history import history
from parsed import read

from kinacc.kinematics import robot
from kinacc.report import study_sections
from kinacc.report.history_lines import sentence

ARM = robot.load("mh180")


def section_of(table):
    return study_sections.history({"history": table}, ARM)


def test_every_line_has_a_row_with_its_verdict_first():
    found = section_of(history(6, changed=3, open_=4))
    (table,) = read(found).tables
    assert [row[:3] for row in table.rows[2:5]] == [
        ("2026-03-16", "holds", "–"),
        ("2026-04-15", "recalibrate", "4"),
        ("2026-05-15", "cannot be told", "–"),
    ]
    assert table.marked == {4: "too few poses"}


def test_the_first_screen_says_what_the_last_line_says():
    assert sentence(history(4, changed=3)) == (
        "recalibrate: 0.30 mm beyond chance, joint 4, since the calibration of 2026-01-15"
    )
    assert sentence(history(3)).startswith("the last calibration still holds")

"""The section on the study: what is stated beside the largest error, and how often too small."""

from __future__ import annotations

import made_up_study as made_up
from parsed import read

from kinacc.kinematics import robot
from kinacc.report import study_sections
from kinacc.report.page import Part

ARM = robot.load("mh180")


def section_of(measured: bool = False, **stated) -> Part:
    return study_sections.study({**made_up.points(measured), **made_up.study(**stated)}, ARM)


def test_the_true_error_of_a_synthetic_arm_is_called_known():
    section = section_of()
    assert "known exactly" in read(section).population
    assert "0.500 mm" in read(section).shows
    assert "true largest error" in read(section).captions[0]


def test_errors_of_measured_poses_are_only_taken_as_true():
    section = section_of(measured=True)
    assert "contain the instrument's noise" in read(section).population
    assert "taken as true" in read(section).captions[0]
    assert "true largest error" not in read(section).captions[0]


def test_each_method_has_its_error_and_how_often_it_is_too_small():
    (table,) = read(section_of()).tables
    assert table.rows[0] == (*("maximum", "0.05", "0.650", "0.400", "0.900", "+0.150", "1 of 4"),)
    assert table.rows[2][-2:] == ("-0.075", "3 of 4")

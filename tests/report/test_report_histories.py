"""The section on model invalidation: what became of each bound, and what was read again."""

from __future__ import annotations

import made_up_study as made_up
import numpy as np
from parsed import Shown, read

from kinacc.kinematics import robot
from kinacc.report import study_sections
from kinacc.report.page import Part

ARM = robot.load("mh180")


def section_of(**changed) -> Part:
    return study_sections.histories({**made_up.points(), **made_up.histories(**changed)}, ARM)


def tables_of(section: Part) -> tuple[Shown, ...]:
    return read(section).tables


def test_what_became_of_every_bound_stands_in_a_table():
    outcomes = tables_of(section_of())[0]
    assert outcomes.rows == (
        ("Fig. 5: the bound is rejected", "7", "0.400", "0.6", "0.900", "rejected", "3", "2"),
        (
            "Fig. 6: the bound is not rejected",
            "7",
            "0.600",
            "0.6",
            "0.500",
            "not rejected",
            "3",
            "2",
        ),
    )
    assert not outcomes.marked


def test_an_example_that_only_comes_near_to_its_rule_says_so():
    outcomes = tables_of(section_of(rule_met=np.zeros(10)))[0]
    assert outcomes.marked[0].startswith("the nearest there is: first")

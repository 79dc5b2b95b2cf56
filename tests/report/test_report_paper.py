"""The sections on the paper: its tables beside what is recomputed, and its claims by verdict."""

from __future__ import annotations

import numpy as np
from parsed import Shown, read

from kinacc.kinematics import robot
from kinacc.report import study_sections
from kinacc.study.claims import all_claims

ARM = robot.load("mh180")


def claims(**verdicts: str) -> dict[str, dict[str, np.ndarray]]:
    """Every claim as its paper has it, and a tenth more here; ``verdicts`` by claim."""
    every = all_claims()
    text = {
        "claim": [each.id for each in every],
        "statement": [each.statement for each in every],
        "statistic": [each.statistic for each in every],
        "verdict": [verdicts.get(each.id, "agrees") for each in every],
    }
    number = {
        "paper": [each.paper for each in every],
        "reproduced": [each.paper + 0.1 for each in every],
        "tolerance": [each.tolerance for each in every],
        "share": [np.nan for _ in every],
        "used_to_choose": [each.used_to_choose for each in every],
    }
    columns = {name: np.array(values, dtype=object) for name, values in text.items()}
    return {"claims": columns | {name: np.array(values) for name, values in number.items()}}


def tables_of(section) -> tuple[Shown, ...]:
    return read(section).tables


def test_every_number_of_the_papers_tables_stands_beside_the_one_here():
    one, two, three = tables_of(study_sections.paper_tables(claims(), ARM))
    assert one.rows[0] == (*("position, mm", "0.705", "0.805", "1.635", "1.735", "1.731", "1.831"),)
    assert three.rows[1][:3] == ("orientation, mrad", "1.336", "1.436")
    assert len(two.rows) == 6
    assert two.rows[3] == (
        *("4", "-3.142", "-3.042", "-1226.154", "-1226.054", "0.029", "0.129", "-1.571", "-1.471"),
    )
    assert len(one.heads) == len(one.rows[0])
    assert len(two.heads) == len(two.rows[0])


def test_a_number_that_differs_is_named_at_its_row():
    verdicts = {"table1_position_max": "differs", "table2_a_3": "differs"}
    one, two, three = tables_of(study_sections.paper_tables(claims(**verdicts), ARM))
    assert one.marked == {0: "largest differs"}
    assert two.marked == {2: "a differs"}
    assert not three.marked


def test_what_only_a_pair_of_joints_can_show_is_not_said_to_differ():
    verdicts = {"table2_d_2": "not comparable", "table2_d_3": "not comparable"}
    _, two, _ = tables_of(study_sections.paper_tables(claims(**verdicts), ARM))
    assert not two.marked
    assert "the paper has -0.964 mm, here it is -0.864 mm" in two.caption


def test_claims_that_differ_come_first_and_are_open():
    verdicts = {"fig5_rejected": "differs", "table2_d_2": "not comparable"}
    section = study_sections.claims(claims(**verdicts), ARM)
    differ, uncompared, agree, chose = tables_of(section)
    assert [row[5] for row in differ.rows] == ["fig5_rejected"]
    assert not differ.folded
    assert (uncompared.folded, agree.folded) == (True, True)
    tables = (differ, uncompared, agree, chose)
    assert [len(each.rows) for each in tables] == [1, 1, len(all_claims()) - 9, 7]
    assert "63 agrees, 1 differs, 1 not comparable" in read(section).shows

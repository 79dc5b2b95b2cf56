"""Sections on study, map, history and paper: numbers beside the truth that was planted."""

from __future__ import annotations

from itertools import product

import made_up_study as made_up
import numpy as np
import pandas as pd
import pytest
from bokeh.models import ColumnDataSource
from made_up_history import history
from parsed import read

from kinacc.kinematics import robot
from kinacc.report import study_sections
from kinacc.study.claims import all_claims

ARM = robot.load("mh180")
UNREACHED, LARGEST = 5, 9


@pytest.mark.parametrize("measured", [False, True])
def test_errors_of_measured_poses_are_only_taken_as_true(measured):
    tables = {**made_up.points(measured), **made_up.study()}
    found = read(study_sections.study(tables))
    assert "0.500 mm" in found.text
    assert ("known exactly" in found.text) != measured
    assert ("true largest error" in found.captions[0]) != measured
    rows = found.tables[0].rows
    assert rows[0] == (*("maximum", "0.05", "0.650", "0.400", "0.900", "+0.150", "1 of 4"),)
    assert rows[2][-2:] == ("-0.075", "3 of 4")


@pytest.mark.parametrize("met", [0, 1])
def test_results_of_every_bound_stand_in_a_table(met):
    tables = {**made_up.points(), **made_up.histories(rule_met=np.full(10, met))}
    outcomes = read(study_sections.histories(tables)).tables[0]
    assert [row[1:] for row in outcomes.rows] == [
        ("7", "0.400", "0.6", "0.900", "rejected", "3", "2"),
        ("7", "0.600", "0.6", "0.500", "not rejected", "3", "2"),
    ]
    assert len(outcomes.marked) == (0 if met else 2)


def accuracy_map() -> dict:
    """Two slices; row 5 is not reached, row 9 has the largest position difference."""
    places = list(product((0.0, 30.0), (1200.0, 1250.0, 1300.0), (0.0, 50.0)))
    table = pd.DataFrame(places, columns=["slice_deg", "radius_mm", "height_mm"])
    table["position_max_mm"] = 0.1 + 0.01 * table.index
    table.loc[LARGEST, "position_max_mm"] = 0.9
    table = table.assign(orientation_max_mrad=2.0 - 0.1 * table.index, solutions=18, wanted=18,
                         worst_branch="X+ Y- Z0, front-up-flip", extrapolating=0,
                         **{f"q{n}": np.deg2rad(10.0 * n) for n in range(1, 7)})  # fmt: skip
    numbers = ["position_max_mm", "orientation_max_mrad", *(f"q{n}" for n in range(1, 7))]
    table.loc[UNREACHED, numbers] = np.nan
    table.loc[UNREACHED, ["solutions", "extrapolating", "worst_branch"]] = 0, 4, None
    return {"accuracy_map": dict(table)}


def test_the_largest_cell_of_the_map_has_its_joints_and_unreached_cells_are_counted():
    section = study_sections.accuracy_map(accuracy_map(), ARM)
    found = read(section)
    assert len(found.tables[0].rows) == 10
    first = found.tables[0].rows[0]
    assert (first[1:5], first[-1]) == (
        ("1250", "50", "0.900", "1.100"), "10.0, 20.0, 30.0, 40.0, 50.0, 60.0",
    )  # fmt: skip
    assert "no pose reached (1 of 12 cells, in 1 of them only at joints" in found.captions[0]
    (source,) = section.charts["map"].select({"type": ColumnDataSource})
    assert source.data["position"][LARGEST] == pytest.approx(0.9)
    assert np.flatnonzero(np.isnan(source.data["position"])).tolist() == [UNREACHED]
    assert source.data["joints"][UNREACHED] == ""


def test_every_line_of_a_history_has_its_verdict():
    table = history(6, changed=3, open_=4)
    (shown,) = read(study_sections.history({"history": table})).tables
    assert [row[1:3] for row in shown.rows[2:5]] == [
        ("holds", "–"), ("recalibrate", "4"), ("cannot be told", "–"),
    ]  # fmt: skip
    assert shown.marked == {4: "too few poses"}


def claims(**verdicts: str) -> dict:
    """Every claim as its paper has it, and a tenth more here; ``verdicts`` by claim."""
    names = ["id", "statement", "statistic", "paper", "tolerance", "used_to_choose"]
    table = pd.DataFrame({name: [getattr(c, name) for c in all_claims()] for name in names})
    table["verdict"] = table["id"].map(verdicts).fillna("agrees")
    table = table.assign(reproduced=table["paper"] + 0.1, share=np.nan)
    return {"claims": dict(table.rename(columns={"id": "claim"}))}


def test_every_number_of_the_papers_tables_stands_beside_the_one_here():
    verdicts = {"table1_position_max": "differs", "table2_a_3": "differs",
                "table2_d_2": "not comparable", "table2_d_3": "not comparable"}  # fmt: skip
    one, two, three = read(study_sections.paper_tables(claims(**verdicts))).tables
    assert one.rows[0] == (*("position, mm", "0.705", "0.805", "1.635", "1.735", "1.731", "1.831"),)
    assert three.rows[1][:3] == ("orientation, mrad", "1.336", "1.436")
    assert two.rows[3] == (
        *("4", "-3.142", "-3.042", "-1226.154", "-1226.054", "0.029", "0.129", "-1.571", "-1.471"),
    )
    assert (one.marked, two.marked, three.marked) == ({0: "largest differs"}, {2: "a differs"}, {})
    assert "the paper has -0.964 mm, here it is -0.864 mm" in two.caption


def test_claims_that_differ_come_first_and_are_open():
    section = study_sections.claims(claims(fig5_rejected="differs", table2_d_2="not comparable"))
    found = read(section)
    differ, uncompared, agree, chose = found.tables
    assert [row[5] for row in differ.rows] == ["fig5_rejected"]
    assert [each.folded for each in (differ, uncompared, agree)] == [False, True, True]
    assert [len(each.rows) for each in (uncompared, agree, chose)] == [1, len(all_claims()) - 9, 7]

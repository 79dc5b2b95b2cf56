"""The section on the model that is selected: why, by how much, and which order."""

import numpy as np
from made_up_results import (
    everything,
    orders,
    pose_errors,
    selection,
    table,
)
from parsed import read

from kinacc.report import fit_sections

TRIED = (
    (np.nan, 0, -900.0, -40.0, 0),
    (np.nan, 2, -861.0, -1.0, 1),
    (np.nan, 4, -860.0, 0.0, 0),
    (0, 0, -700.0, -30.0, 0),
    (0, 4, -670.0, 0.0, 1),
)


def section(**tables):
    return of(everything() | tables)


def of(found):
    return fit_sections.selection(found, "VEC selected.")


def test_the_selected_model_is_marked_and_its_gain_stands_in_standard_errors():
    found = section()
    told = table(found, "Models at held-out poses")
    assert told.rows == (
        ("DH", "–", "0.400", "0.410", "–", "–", "–"),
        ("VEC", "2", "0.300", "0.310", "+0.0500", "0.0100", "+5.0"),
    )
    assert told.marked == {1: "selected"}
    assert read(found).population.startswith("position errors at 40 configurations")


def test_nothing_held_out_says_that_there_is_nothing_to_judge_by():
    found = section(
        model_selection=selection(np.nan, np.nan, "dh"), pose_errors=pose_errors("train")
    )
    assert read(found).population.startswith("no pose was held out")
    assert table(found, "Models at held-out poses").rows[1][2:] == ("–",) * 5


def test_orders_that_were_tried_show_the_chosen_one_and_what_it_was_chosen_by():
    found = section(vec_orders=orders(*TRIED))
    tried = table(found, "Orders tried")
    assert tried.rows[1] == ("2", "0.3", "0.4", "0.7", "-1.0")
    assert tried.marked == {1: "← chosen"}
    chosen = table(found, "Orders chosen")
    assert [row[:2] for row in chosen.rows] == [("all, delivered", "2"), ("without fold 0", "4")]

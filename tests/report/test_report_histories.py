"""The section on model invalidation: what became of each bound, and what was read again."""

from __future__ import annotations

import made_up_study as made_up
import numpy as np
from parsed import Shown, as_page, read

from kinacc.kinematics import robot
from kinacc.report import histories
from kinacc.report.page import Part, Picture

ARM = robot.load("mh180")


def section_of(**changed) -> Part:
    return histories.section({**made_up.points(), **made_up.histories(**changed)}, ARM)


def tables_of(section: Part) -> tuple[Shown, ...]:
    return read(section).tables


def pictures_of(section: Part) -> tuple[Picture, ...]:
    return section.pictures


def data_of(picture: Picture) -> dict[str, np.ndarray]:
    (data,) = {each.data_source for each in picture.plot.renderers if each.data_source.name}
    return data.data


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


def test_points_read_again_are_listed_with_whether_they_are_beyond_the_bound():
    rejected, kept = tables_of(section_of())[1:]
    assert rejected.rows == (("1", "2", "3", "0.600", "0.500", "yes"),)
    assert [row[5] for row in kept.rows] == ["no: noise alone"] * 2


def test_a_button_shows_the_last_reading_of_its_point_in_its_own_example():
    section = section_of()
    data = data_of(pictures_of(section)[0])
    for number, table in enumerate(tables_of(section)[1:]):
        for row, pick, choices in zip(table.rows, table.picks, table.choices, strict=True):
            assert data["example"][pick] == number
            assert data["point"][pick] == int(row[0])
            assert data["repeat"][pick] == int(row[2])
            labels = [option.label for option in pictures_of(section)[0].controls[0].options]
            assert choices == (("Example", labels[number]),)


def test_both_pictures_change_with_the_example_and_the_selection():
    errors, probability = pictures_of(section_of())
    assert data_of(errors) is data_of(probability)
    named = {
        each for picture in (errors, probability) for each in picture.plot.references() if each.name
    }
    assert [each.name for each in named].count("history-example") == 1
    assert errors.plot.x_range is probability.plot.x_range


def test_rows_in_any_order_make_the_same_pictures():
    turned = np.arange(10)[::-1]
    table = made_up.histories()["histories"]
    changed = {name: values[turned] for name, values in table.items()}
    first, other = section_of(), section_of(**changed)
    assert tables_of(first)[0] == tables_of(other)[0]
    assert data_of(pictures_of(first)[0])["iteration"].tolist() == [1, 2, 3, 4, 5] * 2
    assert data_of(pictures_of(other)[0])["iteration"].tolist() == [1, 2, 3, 4, 5] * 2


def test_the_page_is_the_same_twice_and_takes_no_markup_from_a_table():
    one, other = (as_page(section_of(rule_met=np.zeros(10))) for _ in range(2))
    assert one == other
    assert "<b>simulation</b>" not in one

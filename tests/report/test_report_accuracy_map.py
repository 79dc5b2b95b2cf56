"""The section on the accuracy map: which cells it shows, marks and lists, and in which words."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from parsed import as_page as page
from parsed import read

from kinacc.kinematics import robot
from kinacc.report import accuracy_map, map_cells
from kinacc.report.page import Picture

ARM = robot.load("mh180")
UNREACHED = 5
LARGEST = 9


def made_up(radii: int = 3, heights: int = 2, **changed) -> dict[str, np.ndarray]:
    """Two slices; row 5 is not reached, row 9 has the largest position difference."""
    places = list(product((0.0, 30.0), range(radii), range(heights)))
    count = len(places)
    slices, radius, height = (np.array(each, dtype=float) for each in zip(*places, strict=True))
    position = 0.1 + 0.01 * np.arange(count)
    position[LARGEST] = 0.9
    table = {
        "slice_deg": slices,
        "radius_mm": 1200 + 50 * radius,
        "height_mm": 50 * height,
        "position_max_mm": position,
        "orientation_max_mrad": 2.0 - 0.1 * np.arange(count),
        "worst_branch": np.array(["X+ Y- Z0, front-up-flip"] * count, dtype=object),
        "orientation_worst_branch": np.array(["X0 Y0 Z0, front-up-noflip"] * count, dtype=object),
        "solutions": np.full(count, 18),
        "wanted": np.full(count, 18),
        "extrapolating": np.zeros(count, dtype=int),
        **{f"q{joint}": np.full(count, np.deg2rad(10.0 * joint)) for joint in range(1, 7)},
    }
    unreached(table, [UNREACHED])
    return table | changed


def unreached(table: dict[str, np.ndarray], rows: list[int]) -> None:
    for name in ("position_max_mm", "orientation_max_mrad", *(f"q{n}" for n in range(1, 7))):
        table[name][rows] = np.nan
    for name in ("worst_branch", "orientation_worst_branch"):
        table[name][rows] = None
    table["solutions"][rows] = 0


def section_of(table: dict[str, np.ndarray]):
    return accuracy_map.section({"accuracy_map": table}, ARM)


def listed_in(section):
    (found,) = read(section).tables
    return found


def caption_of(section) -> str:
    return read(section).captions["map"].replace("\n", " ")


def data_of(picture: Picture) -> dict[str, np.ndarray]:
    (source,) = {each.data_source for each in picture.plot.renderers}
    return source.data


def test_the_cell_of_the_largest_difference_stands_first_with_the_joints_to_drive_to():
    section = section_of(made_up())
    listed = listed_in(section)
    assert len(listed.rows) == 10
    assert listed.rows[0][1:5] == ("1250", "50", "0.900", "1.100")
    assert "10.0,\u00a020.0,\u00a030.0" in listed.rows[0][-1]
    assert data_of(section.pictures[0])["position"][listed.picks[0]] == pytest.approx(0.9)
    assert listed.choices[0] == (("Slice", listed.rows[0][0]), ("Quantity", "position"))


def test_a_button_chooses_what_the_controls_of_the_picture_have():
    section = section_of(made_up())
    labels = {
        control.label: {option.label for option in control.options}
        for control in section.pictures[0].controls
    }
    for chosen in listed_in(section).choices:
        assert all(option in labels[control] for control, option in chosen)


def test_controls_set_only_what_is_in_the_picture():
    picture = section_of(made_up()).pictures[0]
    there = {each.name: each for each in picture.plot.references() if each.name}
    for control in picture.controls:
        for option in control.options:
            for model, name, _ in option.sets:
                assert hasattr(there[model], name)


def test_it_is_said_to_be_about_models_and_not_about_the_robot():
    section = section_of(made_up())
    assert "nothing is an error of the robot itself" in read(section).population
    assert "12 cells" in read(section).population
    assert "no bound" in read(section).judged


def test_cells_that_no_pose_reaches_are_told_apart_from_cells_without_difference():
    table = made_up()
    table["extrapolating"][UNREACHED] = 4
    picture = section_of(table).pictures[0]
    assert "no pose reached (1 of 12 cells, in 1 of them only at joints beyond" in caption_of(
        section_of(table)
    )
    data = data_of(picture)
    assert np.flatnonzero(data["some"] == 0).tolist() == [UNREACHED]
    looks = [getattr(each.glyph, "hatch_pattern", None) for each in picture.plot.renderers]
    assert looks.count("/") == 1


def test_the_largest_of_every_slice_is_marked_and_an_unreached_slice_has_none():
    table = made_up()
    data = data_of(section_of(table).pictures[0])
    assert np.flatnonzero(data["top_position"]).tolist() == [4, LARGEST]
    assert np.flatnonzero(data["top_orientation"]).tolist() == [0, 6]
    unreached(table, list(range(6)))
    data = data_of(section_of(table).pictures[0])
    assert np.flatnonzero(data["top_position"]).tolist() == [LARGEST]


def test_poses_that_are_only_partly_reached_are_said_to_be():
    table = made_up()
    assert "white dot" not in caption_of(section_of(table))
    table["solutions"][0] = 9
    picture = section_of(table).pictures[0]
    assert "white dot" in caption_of(section_of(table))
    assert data_of(picture)["reached"][0] == pytest.approx(50.0)


def test_a_space_out_of_reach_is_said_to_be_and_nothing_is_listed():
    table = made_up()
    unreached(table, list(range(12)))
    section = section_of(table)
    assert "out of the robot's reach" in read(section).paragraphs[0]
    assert "no pose reached (12 of 12 cells)" in caption_of(section)


def test_a_single_cell_is_a_map():
    one = {name: values[:1] for name, values in made_up().items()}
    section = section_of(one)
    assert len(listed_in(section).rows) == 1
    assert data_of(section.pictures[0])["position"].tolist() == pytest.approx([0.1])


def test_a_map_made_before_joints_were_kept_is_shown_without_them():
    old = {name: values for name, values in made_up().items() if name[:1] != "q"}
    section = section_of(old)
    assert listed_in(section).rows[0][3] == "0.900"
    assert not [name for name in section.pictures[0].details if name[:1] == "q"]


def test_of_more_cells_than_can_be_drawn_the_largest_are_kept():
    table = made_up(radii=7, heights=5)
    drawn = map_cells.cells(table, most=30)
    assert drawn.merged
    assert len(drawn.farthest) <= 30
    position = table["position_max_mm"]
    for cell, row in enumerate(drawn.farthest):
        mine = position[drawn.of_row == cell]
        assert position[row] == np.nanmax(mine)
    assert np.bincount(drawn.of_row).sum() == len(position)
    assert np.isclose((drawn.wide_mm * drawn.high_mm).sum(), len(position) * 50.0 * 50.0)


def test_a_button_of_a_merged_cell_points_at_the_cell_it_is_in(monkeypatch):
    monkeypatch.setattr(map_cells.cells, "__defaults__", (4,))
    section = section_of(made_up())
    picture, listed = section.pictures[0], listed_in(section)
    assert "drawn as one" in caption_of(section)
    assert data_of(picture)["position"][listed.picks[0]] == pytest.approx(0.9)


def test_text_of_a_table_cannot_become_part_of_the_page():
    table = made_up()
    table["worst_branch"][LARGEST] = "</script><script>alert('\"x')</script>"
    assert "<script>alert" not in page(section_of(table))


def test_the_same_map_makes_the_same_bytes_and_is_written_as_often_as_one_likes():
    section = section_of(made_up())
    assert page(section) == page(section) == page(section_of(made_up()))

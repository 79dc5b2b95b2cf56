"""The section on the accuracy map: which cells it shows, marks and lists, and in which words."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from bokeh.models import ColumnDataSource
from parsed import read

from kinacc.kinematics import robot
from kinacc.report import study_sections

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
    return study_sections.accuracy_map({"accuracy_map": table}, ARM)


def listed_in(section):
    (found,) = read(section).tables
    return found


def cells_of(section) -> dict[str, np.ndarray]:
    """The data of the chart."""
    (source,) = section.charts["map"].select({"type": ColumnDataSource})
    return source.data


def test_the_cell_of_the_largest_difference_stands_first_with_the_joints_to_drive_to():
    section = section_of(made_up())
    listed = listed_in(section)
    assert len(listed.rows) == 10
    assert listed.rows[0][1:5] == ("1250", "50", "0.900", "1.100")
    assert listed.rows[0][-1] == "10.0, 20.0, 30.0, 40.0, 50.0, 60.0"
    assert cells_of(section)["position"][LARGEST] == pytest.approx(0.9)


def test_cells_that_no_pose_reaches_are_told_apart_from_cells_without_difference():
    table = made_up()
    table["extrapolating"][UNREACHED] = 4
    section = section_of(table)
    (caption,) = read(section).captions
    assert "no pose reached (1 of 12 cells, in 1 of them only at joints beyond" in caption
    cells = cells_of(section)
    assert np.flatnonzero(np.isnan(cells["position"])).tolist() == [UNREACHED]
    assert cells["joints"][UNREACHED] == ""

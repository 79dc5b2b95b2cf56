"""Workbooks, and reports of trackers that are no table of readings: turned into one, or asked."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command_line import call
from written_tables import (
    JOINTS,
    POINT_MM,
    Q_DEG,
    ROWS,
    XYZ,
    assert_is_truth,
    cells,
    file,
    lines,
    looked,
    reading,
    undecided,
    workbook,
)

from kinacc.errors import InputError

TABLE = [[*JOINTS, *XYZ], *np.hstack([Q_DEG, POINT_MM]).tolist()]


def test_a_sheet_that_is_not_there_is_answered_with_those_that_are(tmp_path):
    path = workbook(tmp_path, {"before": TABLE, "after": TABLE})
    assert_is_truth(reading(path, sheet="before"), atol=1e-9)
    with pytest.raises(InputError, match="before, after"):
        looked(path, sheet="between")


def test_a_sheet_of_a_few_points_beside_the_data_is_not_asked_about(tmp_path):
    path = workbook(tmp_path, {"base": [["X", "Y", "Z"], [1.0, 2.0, 3.0]], "data": TABLE})
    assert looked(path).section["sheet"] == "data"


@pytest.mark.parametrize("name", ["a.xls", "a.ods", "a.xlsx"])
def test_what_is_no_workbook_is_refused_with_what_to_do(name, tmp_path):
    path = tmp_path / name
    path.write_bytes(b"\xd0\xcf\x11\xe0 not a zip")
    with pytest.raises(InputError, match=r"\.xlsx or (export it as )?CSV"):
        looked(path)


def uncertain(folder, name):
    """A file with three uncertainties a row, under names with this one's letters."""
    names = [*JOINTS, *XYZ, *(name.format(axis) for axis in "XYZ")]
    return file(folder, lines([[*row, "0.02", "0.04", "0.06"] for row in cells()], names))


@pytest.mark.parametrize(
    ("name", "answers", "std_mm"),
    [("U({}) [mm]", {"sigma": "2"}, 0.02), ("Unc. {} [mm] (k = 2)", {}, 0.02),
     ("u({}) [mm]", {}, 0.04), ("Unc. {} [mm] (k = 2)", {"sigma": "none"}, np.nan)],
)  # fmt: skip
def test_uncertainties_are_so_many_standard_deviations_as_stated_or_answered(
    tmp_path, name, answers, std_mm
):
    found = reading(uncertain(tmp_path, name), **answers)
    np.testing.assert_allclose(found.columns["std_y_mm"], std_mm)


def test_what_uncertainties_are_is_asked_unless_it_stands_there(tmp_path):
    assert "--sigma 1 or --sigma 2 or --sigma none" in undecided(uncertain(tmp_path, "U({}) [mm]"))
    with pytest.raises(InputError, match=r"--sigma 1: not all of"):
        looked(uncertain(tmp_path, "Unc. {} [mm] (k = 2)"), sigma="1")


def test_a_report_with_a_row_per_axis_becomes_a_row_per_feature(tmp_path):
    """Features are named in their first rows; other controls and one without an axis are told."""
    rows = [
        ["" if axis != "X" else f"Point {number + 1}", axis, f"{value + 0.5:.3f}", f"{value:.3f}",
         "-0.500", *row[:6]]
        for number, row in enumerate(cells())
        for axis, value in zip(["X", "Y", "Z", "3D"], [*POINT_MM[number], 0.1], strict=True)
    ]  # fmt: skip
    del rows[5]
    names = ["Feature", "Axis", "Nominal [mm]", "Actual [mm]", "Deviation [mm]"]
    path = file(tmp_path, lines(rows, [*names, *JOINTS], "\t"))
    assert looked(path).section["columns"]["x"] == "Actual [mm] X"
    found = reading(path)
    assert_is_truth(found, np.arange(ROWS) != 1)
    assert found.columns["row"].tolist()[:2] == [2, 9]
    left_out = " ".join(found.left_out())
    assert "1 row holds no reading: line 6" in left_out
    assert "14 rows of other quantities" in left_out


def spherical(unit=np.pi / 180.0, horizon=False, clockwise=True):
    x, y, z = POINT_MM.T
    distance = np.sqrt(x**2 + y**2 + z**2)
    turn = np.arctan2(x, y) if clockwise else np.arctan2(y, x)
    up = np.arcsin(z / distance)
    vertical = up if horizon else np.pi / 2 - up
    return np.column_stack([np.mod(turn, 2 * np.pi) / unit, vertical / unit, distance / 1000.0])


def directions(folder, names, values):
    rows = [[*row[:6], *(f"{v:.8f}" for v in direction)]
            for row, direction in zip(cells(), values, strict=True)]  # fmt: skip
    return file(folder, lines(rows, [*JOINTS, *names], ";"))


SPHERICAL = {
    "letters": (["Az [deg]", "El [deg]", "R [m]"], spherical(horizon=True, clockwise=False)),
    "words": (["Azimuth [rad]", "Zenith [rad]", "Distance [m]"], spherical(1.0, clockwise=False)),
    "sizes": (["Hz [gon]", "V [gon]", "D [m]"], spherical(np.pi / 200, horizon=True)),
}


@pytest.mark.parametrize("case", SPHERICAL)
def test_two_angles_and_a_distance_become_a_point(case, tmp_path):
    path = directions(tmp_path, *SPHERICAL[case])
    assert looked(path).section["layout"] == "spherical"
    assert_is_truth(reading(path))


def test_angles_whose_unit_is_gon_in_one_language_and_degrees_in_another(tmp_path):
    path = directions(tmp_path, ["Hz [grad]", "V [grad]", "D [m]"], spherical(np.pi / 200))
    assert "--direction-unit deg or --direction-unit gon" in undecided(path)
    assert_is_truth(reading(path, direction_unit="gon"))


def test_a_vertical_angle_that_may_count_from_either_is_asked_about(tmp_path):
    values = spherical()
    values[:, 1] = np.linspace(20, 80, ROWS)
    path = directions(tmp_path, ["Hz [deg]", "V [deg]", "D [m]"], values)
    assert "--vertical zenith or --vertical horizon" in undecided(path)
    assert looked(path, vertical="horizon").section["directions"]["vertical"] == "horizon"


def test_the_way_horizontal_angles_count_is_found_by_trying(tmp_path):
    path = directions(tmp_path, ["Hz [deg]", "V [deg]", "D [m]"], spherical(clockwise=False))
    done = call("init", path, "--robot", "ur10", "--out", tmp_path, "--json", code=0)
    answer = json.loads(done.stdout)
    assert answer["file"]["directions"]["horizontal"] == "counterclockwise"
    assert answer["suspicions"] == []


def test_records_of_krl_under_the_names_of_their_poses(tmp_path):
    axes, frame = [f"A{n}" for n in range(1, 7)], [*"XYZ"]
    path = tmp_path / "points.txt"
    path.write_text("".join(
        f"P{row}={{E6AXIS: {', '.join(f'{a} {v:.6f}' for a, v in zip(axes, q, strict=True))}}} "
        f"MEAS={{FRAME: {', '.join(f'{a} {v:.6f}' for a, v in zip(frame, p, strict=True))}}}\n"
        for row, (q, p) in enumerate(zip(Q_DEG, POINT_MM, strict=True), 1)
    ))  # fmt: skip
    assert_is_truth(reading(path))

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


@pytest.mark.parametrize("name", ["a.xls", "a.ods", "a.xlsx"])
def test_what_is_no_workbook_is_refused_with_what_to_do(name, tmp_path):
    path = tmp_path / name
    path.write_bytes(b"\xd0\xcf\x11\xe0 not a zip")
    with pytest.raises(InputError, match=r"\.xlsx or (export it as )?CSV"):
        looked(path)


@pytest.mark.parametrize("name", ["U({})", "Unc. {} [mm] (k = 2)"])
def test_uncertainties_are_so_many_standard_deviations_as_stated_or_answered(name, tmp_path):
    unit = " [mm]" if "k" in name else ""
    names = [*JOINTS, *(f"{a}{unit}" for a in "XYZ"), *(name.format(axis) for axis in "xyz")]
    path = file(tmp_path, lines([[*row, "0.02", "0.04", "0.06"] for row in cells()], names))
    assert np.isnan(reading(path, sigma="none").columns["std_y_mm"]).all()
    if unit:
        np.testing.assert_allclose(reading(path).columns["std_y_mm"], 0.02)
        with pytest.raises(InputError, match=r"--sigma 1: not all of"):
            looked(path, sigma="1")
    else:
        assert "--sigma 1 or --sigma 2 or --sigma none" in undecided(path)
        np.testing.assert_allclose(reading(path, sigma="2").columns["std_y_mm"], 0.02)


def test_a_standard_uncertainty_as_metrologists_write_it_is_one_standard_deviation(tmp_path):
    names = [*JOINTS, *XYZ, *(f"u({axis}) [mm]" for axis in "XYZ")]
    path = file(tmp_path, lines([[*row, "0.02", "0.04", "0.06"] for row in cells()], names))
    assert looked(path).section["sigma"] == 1
    np.testing.assert_allclose(reading(path).columns["std_y_mm"], 0.04)


def report(names, axes=("X", "Y", "Z"), once=False):
    """Rows per feature and axis, names of the features in the first of them where ``once``."""
    return [
        ["" if place and once else names(number), axis, f"{value + 0.5:.3f}", f"{value:.3f}",
         "-0.500", *(f"{q:.3f}" for q in Q_DEG[number])]
        for number in range(ROWS)
        for place, axis in enumerate(axes)
        for value in [[*POINT_MM[number], 0.1][place]]
    ]  # fmt: skip


def test_a_report_with_a_row_per_axis_becomes_a_row_per_feature(tmp_path):
    names = ["Feature", "Axis", "Nominal [mm]", "Actual [mm]", "Deviation [mm]"]
    rows = report(lambda n: f"Point {n + 1}", once=True)
    path = file(tmp_path, lines(rows, [*names, *JOINTS], "\t"))
    assert looked(path).section["columns"]["x"] == "Actual [mm] X"
    assert_is_truth(reading(path))
    assert reading(path).columns["row"].tolist()[:2] == [2, 5]


def test_other_controls_are_told_and_a_feature_without_an_axis_is_no_reading(tmp_path):
    rows = report(lambda n: f"P{n}", ("X", "Y", "Z", "3D"))
    del rows[5]
    names = ["Name", "Control", "Nominal", "Meas", "Dev", *JOINTS]
    found = reading(file(tmp_path, lines(rows, names)))
    assert_is_truth(found, np.arange(ROWS) != 1)
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
    "words": (["Azimuth [deg]", "Zenith [deg]", "Distance [m]"], spherical(clockwise=False)),
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

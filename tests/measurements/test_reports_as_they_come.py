"""Workbooks, and reports of trackers that are no table of readings: turned into one, or asked."""

from __future__ import annotations

import datetime

import numpy as np
import pytest
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
    workbook,
)

from kinacc.errors import InputError
from kinacc.measurements.files import load
from kinacc.measurements.intake import text
from kinacc.measurements.intake.choices import Undecided

TABLE = [[*JOINTS, *XYZ], *np.hstack([Q_DEG, POINT_MM]).tolist()]


def undecided(path, **answers) -> str:
    with pytest.raises(Undecided) as caught:
        looked(path, **answers)
    return str(caught.value)


def test_a_workbook_with_a_title_is_read_from_the_sheet_that_holds_a_table(tmp_path):
    sheets = {"Cover": [["Survey of cell 3"], ["Date", datetime.date(2024, 3, 1)]]}
    sheets["Data"] = [["Survey of cell 3"], [], *TABLE]
    found = looked(workbook(tmp_path, sheets))
    assert found.section["sheet"] == "Data"
    assert any("sheet 'Data'" in words and "Cover" in words for words in found.notes)
    assert_is_truth(reading(tmp_path / "readings.xlsx"), atol=1e-9)
    assert reading(tmp_path / "readings.xlsx").columns["row"][0] == 4


def test_a_workbook_with_text_in_place_of_numbers(tmp_path):
    rows = [[f"{value:.3f}".replace(".", ",") for value in row] for row in TABLE[1:]]
    assert_is_truth(reading(workbook(tmp_path, {"Tabelle1": [TABLE[0], *rows]})))


def test_two_sheets_with_tables_are_asked_about(tmp_path):
    other = [TABLE[0], *[[value + 1.0 for value in row] for row in TABLE[1:]]]
    path = workbook(tmp_path, {"before": TABLE, "after": other})
    assert "--sheet before or --sheet after" in undecided(path)
    assert_is_truth(reading(path, sheet="before"), atol=1e-9)
    with pytest.raises(InputError, match="before, after"):
        looked(path, sheet="between")


@pytest.mark.parametrize("name", ["a.xls", "a.ods", "a.xlsx"])
def test_what_is_no_workbook_is_refused_with_what_to_do(name, tmp_path):
    path = tmp_path / name
    path.write_bytes(b"\xd0\xcf\x11\xe0 not a zip")
    with pytest.raises(InputError, match=r"\.xlsx or (export it as )?CSV"):
        looked(path)


HEAD = "// Exported from the instrument\n// Working Frame: CELL::BASE\n// Units: Millimeters\n"


def points(rows=(1, 2, 10), mark=", "):
    return [["CELL", "Poses", f"P{n}", *(f"{v:.4f}" for v in POINT_MM[n])] for n in rows]


@pytest.mark.parametrize("mark", [",", ", ", "\t", ";"])
def test_a_list_of_points_without_names_is_collection_group_point(mark, tmp_path):
    path = file(tmp_path, HEAD + lines(points(), None, mark))
    found = text.look(path)
    assert found.written.names == ("Collection", "Group", "Point", "X_mm", "Y_mm", "Z_mm")
    table = load(path, found.written)
    assert [cell.strip() for cell in table.columns["Point"]] == ["P1", "P2", "P10"]
    np.testing.assert_allclose([float(c) for c in table.columns["X_mm"]], POINT_MM[[1, 2, 10], 0])
    assert found.stated["length"] == "mm"


UNCERTAIN = [*(f"q{i}_deg" for i in range(1, 7)), *"XYZ", "Ux", "Uy", "Uz"]


def test_uncertainties_are_read_once_it_is_said_how_many_sigma_they_are(tmp_path):
    rows = [[*row, "0.02", "0.04", "0.06"] for row in cells()]
    path = file(tmp_path, lines(rows, UNCERTAIN))
    assert "--sigma 1 or --sigma 2 or --sigma none" in undecided(path)
    assert np.isnan(reading(path, sigma="none").columns["std_x_mm"]).all()
    for sigma in (1, 2):
        found = reading(path, sigma=str(sigma))
        np.testing.assert_allclose(found.columns["std_y_mm"], 0.04 / sigma)


@pytest.mark.parametrize("name", ["U{} (k=2) [mm]", "Unc. {} [mm] (k = 2)"])
def test_uncertainties_whose_names_say_k_are_so_many_standard_deviations(name, tmp_path):
    names = [*JOINTS, *XYZ, *(name.format(axis) for axis in "xyz")]
    path = file(tmp_path, lines([[*row, "0.02", "0.04", "0.06"] for row in cells()], names))
    found = reading(path)
    assert_is_truth(found)
    np.testing.assert_allclose(found.columns["std_y_mm"], 0.02)
    assert np.isnan(reading(path, sigma="none").columns["std_y_mm"]).all()
    with pytest.raises(InputError, match=r"--sigma 1: not all of"):
        looked(path, sigma="1")


def report(names, more=(), axes=("X", "Y", "Z"), once=False):
    """Rows per feature and axis, names of the features in the first of them where ``once``."""
    rows = []
    for number in range(ROWS):
        for place, axis in enumerate(axes):
            name = names(number) if place == 0 or not once else ""
            value = POINT_MM[number, place]
            row = [name, axis, f"{value + 0.5:.3f}", f"{value:.3f}", "-0.500", *more]
            rows.append([*row, *(f"{q:.3f}" for q in Q_DEG[number])])
    return rows


@pytest.mark.parametrize("once", [True, False])
@pytest.mark.parametrize(
    "names",
    [
        ["Name", "Control", "Nominal", "Measured", "Dev"],
        ["Feature", "Axis", "Nominal [mm]", "Actual [mm]", "Deviation [mm]"],
        ["Merkmal", "Achse", "Soll", "Ist", "Abw."],
    ],
)
def test_a_report_with_a_row_per_axis_becomes_a_row_per_feature(names, once, tmp_path):
    rows = report(lambda n: f"Point {n + 1}", once=once)
    path = file(tmp_path, lines(rows, [*names, *JOINTS], "\t"))
    found = looked(path)
    assert found.section["layout"] == "features"
    assert found.section["columns"]["x"] == f"{names[3]} X"
    assert_is_truth(reading(path))
    assert reading(path).columns["row"].tolist()[:2] == [2, 5]


def test_other_controls_of_a_report_are_told_and_tolerances_are_no_points(tmp_path):
    rows = []
    names = ["Name", "Control", "Nominal", "Meas", "Tol", "Dev", "Test"]
    for number in range(ROWS):
        for place, axis in enumerate(("X", "Y", "Z", "3D")):
            value = POINT_MM[number, place] if place < 3 else 0.1
            row = [f"p{number}", axis, f"{value:.2f}", f"{value:.3f}", "0.5", "0.003", "Pass"]
            rows.append([*row, *(f"{q:.3f}" for q in Q_DEG[number])])
    path = file(tmp_path, lines(rows, [*names, *JOINTS], ";"))
    assert_is_truth(reading(path))
    assert any("14 rows of other quantities" in words and "3D" in words
               for words in reading(path).left_out())  # fmt: skip


def test_a_feature_without_one_of_its_axes_is_no_reading(tmp_path):
    rows = report(lambda n: f"P{n}")
    del rows[4]
    path = file(tmp_path, lines(rows, ["Name", "Axis", "Nominal", "Measured", "Dev", *JOINTS]))
    found = reading(path)
    assert_is_truth(found, np.arange(ROWS) != 1)
    assert "1 row holds no reading: line 5" in " ".join(found.left_out())


def spherical(unit=np.pi / 180.0, horizon=False, clockwise=True):
    x, y, z = POINT_MM.T
    distance = np.sqrt(x**2 + y**2 + z**2)
    turn = np.arctan2(x, y) if clockwise else np.arctan2(y, x)
    up = np.arcsin(z / distance)
    vertical = up if horizon else np.pi / 2 - up
    return np.column_stack([np.mod(turn, 2 * np.pi) / unit, vertical / unit, distance / 1000.0])


def directions(folder, names, values, decimals=7):
    rows = [
        [*row[:6], *(f"{v:.{decimals}f}" for v in direction)]
        for row, direction in zip(cells(), values, strict=True)
    ]
    return file(folder, lines(rows, [*JOINTS, *names], ";"))


SPHERICAL = {
    "gon": (["Hz [gon]", "V [gon]", "D [m]"], spherical(np.pi / 200)),
    "degrees": (["Hz [deg]", "V [deg]", "D [m]"], spherical()),
    "German": (["Hz (°)", "V (°)", "Schrägstrecke (m)"], spherical()),
    "elevation": (["Hz [deg]", "Elevation [deg]", "Distance [m]"], spherical(horizon=True)),
    "letters": (
        ["Az [deg]", "El [deg]", "R [m]"],
        spherical(horizon=True, clockwise=False),
    ),
    "azimuth": (
        ["Azimuth [deg]", "Zenith [deg]", "Distance [m]"],
        spherical(clockwise=False),
    ),
}


@pytest.mark.parametrize("case", SPHERICAL)
def test_two_angles_and_a_distance_become_a_point(case, tmp_path):
    path = directions(tmp_path, *SPHERICAL[case])
    found = looked(path)
    assert found.section["layout"] == "spherical"
    assert_is_truth(reading(path))
    assert any("counted from the" in words for words in found.notes)


def test_angles_without_a_unit_are_asked_about(tmp_path):
    path = directions(tmp_path, ["Hz", "V", "D [m]"], spherical(np.pi / 200))
    if spherical(np.pi / 200)[:, 0].max() < 361:
        assert "--direction-unit deg or --direction-unit gon" in undecided(path)
    assert_is_truth(reading(path, direction_unit="gon"))


def test_a_unit_that_is_gon_in_one_language_and_degrees_in_another_is_asked_about(tmp_path):
    path = directions(tmp_path, ["Hz [grad]", "V [grad]", "D [m]"], spherical())
    assert "--direction-unit" in undecided(path)
    assert_is_truth(reading(path, direction_unit="deg"))


def test_a_vertical_angle_that_may_count_from_either_is_asked_about(tmp_path):
    values = spherical()
    values[:, 1] = np.linspace(20, 80, ROWS)
    path = directions(tmp_path, ["Hz [deg]", "V [deg]", "D [m]"], values)
    assert "--vertical zenith or --vertical horizon" in undecided(path)
    assert looked(path, vertical="horizon").section["directions"]["vertical"] == "horizon"


def test_the_way_horizontal_angles_count_is_found_by_trying(tmp_path):
    import json

    from click.testing import CliRunner

    from kinacc.cli.group import main

    names = ["Hz [deg]", "V [deg]", "D [m]"]
    path = directions(tmp_path, names, spherical(clockwise=False), 8)
    words = ["init", str(path), "--robot", "ur10", "--out", str(tmp_path), "--json"]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert told["file"]["directions"]["horizontal"] == "counterclockwise"
    assert told["suspicions"] == []
    assert any("found by trying" in words for words in told["told"])

"""Text files as trackers, spreadsheets and people write them: read right, asked about, refused."""

from __future__ import annotations

import re

import numpy as np
import pytest
from read_columns import Q_DEG, XYZ_MM
from written_tables import (
    JOINTS,
    NO_UNITS,
    POINT_MM,
    ROWS,
    XYZ,
    assert_is_truth,
    cells,
    file,
    lines,
    looked,
    reading,
    undecided,
)

from kinacc.errors import InputError

WRITTEN = {
    "blanks and names with units": lines(cells(), mark="   "),
    "decimal commas between blanks": lines(
        cells(decimal=","), NO_UNITS, "  "
    ),
    "a rule under the names": lines(
        [["---"] * 9, *cells()], NO_UNITS, "\t"
    ),
    "a mark at the end of the rows alone": lines([[*row, ""] for row in cells()], mark=";"),
    "names behind a hash": "# " + lines(cells(), (*Q_DEG, *"XYZ")),
    "units in the cells": lines(
        [
            [*(f"{c} °" for c in row[:6]), *(f"{c} mm" for c in row[6:])]
            for row in cells(decimal=",")
        ],
        NO_UNITS,
        ";",
    ),
    "a column of row numbers without a name": lines(
        [[number, *row] for number, row in enumerate(cells())], ["", *JOINTS, *XYZ]
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WRITTEN)
def test_a_file_is_read_whatever_parts_its_columns_and_digits(case, tmp_path):
    assert_is_truth(reading(file(tmp_path, WRITTEN[case])))


AMBIGUOUS = {
    "a comma before three digits": lambda cell: re.sub(r"\.\d+", "", cell) + ",125",
    "a point before three digits, or none": lambda cell: (
        re.sub(r"\.\d+", "", cell) + (".125" if "7" in cell else "")
    ),
}


@pytest.mark.parametrize("case", AMBIGUOUS)
def test_a_mark_that_may_be_one_of_thousands_is_asked_about(case, tmp_path):
    rows = [[str(round(float(c))) for c in row[:6]] for row in cells()]
    points = [[f"{v // 10:.0f}" for v in row] for row in np.abs(POINT_MM)]
    rows = [[*q, *map(AMBIGUOUS[case], p)] for q, p in zip(rows, points, strict=True)]
    path = file(tmp_path, lines(rows, mark=";"))
    assert "--decimal" in undecided(path)
    by_comma, by_point = (reading(path, decimal=mark).columns["x_mm"] for mark in ",.")
    assert (by_comma != by_point).any()


def test_a_thousand_where_all_others_have_none_is_asked_about(tmp_path):
    rows = cells(decimal=",")
    rows[3][6] = "2.500"
    path = file(tmp_path, lines(rows, mark=";"))
    assert "--thousands" in undecided(path)
    assert reading(path, thousands=".").columns["x_mm"][3] == 2500.0
    with pytest.raises(InputError, match=r"line 5: not a finite number: '2\.500'"):
        reading(path, thousands="none")


def test_statistics_and_remarks_between_the_rows_are_told_with_their_lines(tmp_path):
    rows = cells()
    rows.insert(4, ["# warm-up ended"])
    rows.insert(8, ["Mittelwert:", *["0.0"] * 8])
    rows.insert(9, [*JOINTS, *XYZ])
    rows += [["", *[""] * 8], ["Max", *[""] * 5, "1", "2", "3"], ["# tracker warm"]]
    rows += [["Checked by the night shift"]]
    found = reading(file(tmp_path, lines(rows, mark=";")))
    assert_is_truth(found)
    told = " ".join(found.left_out())
    assert "lines 6, 10-11, 20-22: not read" in told
    assert found.columns["row"].tolist()[4] == 7


@pytest.mark.parametrize(
    ("text", "value", "unit"), [("-9999", -9999.0, 1.0), ("9E9", 9e9, 1e-3), ("0.000", 0.0, 1e-3)]
)
def test_numbers_that_stand_for_no_reading_are_found_and_told(text, value, unit, tmp_path):
    away = np.round(np.add(POINT_MM, (4000, 0, 0)) * unit, 6)
    rows = [[*row[:6], *map(str, p)] for row, p in zip(cells(), away, strict=True)]
    for row in (1, 6, 9):
        rows[row][6:] = [text] * 3
    path = file(tmp_path, lines(rows, [*JOINTS, *"XYZ"], ";"))
    found = looked(path)
    assert found.section["no_reading"] == [value]
    assert found.section["length_unit"] == ("mm" if unit == 1.0 else "m")
    assert "3 rows hold no reading: lines 3, 8, 11" in reading(path).left_out()
    assert len(reading(path).columns["x_mm"]) == ROWS - 3


@pytest.mark.parametrize(
    ("reading_is", "answer"), [(["0", "0", "0"], "0"), (["100.000", "0.000", "9999"], "9999")]
)
def test_a_zero_among_points_around_it_and_a_nine_in_one_coordinate_are_asked_about(
    reading_is, answer, tmp_path
):
    near = POINT_MM - POINT_MM.mean(axis=0)
    rows = [[*row[:6], *map(str, np.round(p, 3))] for row, p in zip(cells(), near, strict=True)]
    rows[4][6:] = reading_is
    path = file(tmp_path, lines(rows, mark=";"))
    assert re.search("line 6.*--no-reading", undecided(path))
    assert len(reading(path, no_reading=answer).columns["row"]) == ROWS - 1
    assert len(reading(path, no_reading="none").columns["row"]) == ROWS


def test_joints_that_stand_for_the_rows_below_are_not_guessed(tmp_path):
    rows = [[*(row[:6] if number % 2 == 0 else [""] * 6), *row[6:]]
            for number, row in enumerate(cells())]  # fmt: skip
    path = file(tmp_path, lines(rows, mark=";"))
    with pytest.raises(InputError, match="empty beside 7 of 14 points"):
        reading(path)


def test_units_above_the_rows_count_where_the_names_have_none(tmp_path):
    names = [*JOINTS, *"XYZ"]
    metres = [[*row[:6], *(f"{v / 1000:.6f}" for v in p)]
              for row, p in zip(cells(), POINT_MM, strict=True)]  # fmt: skip
    path = file(tmp_path, "// Units: Meters\n" + lines(metres, names))
    assert looked(path).section["length_unit"] == "m"
    assert_is_truth(reading(path))


def test_a_file_without_names_is_read_by_the_names_given(tmp_path):
    path = file(tmp_path, lines(cells(), None))
    with pytest.raises(InputError, match="--names with 9 names"):
        looked(path)
    assert_is_truth(reading(path, names=",".join([*Q_DEG, *XYZ_MM])))

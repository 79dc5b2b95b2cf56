"""Numbers across versions: the comparison finds what differs, and the page says what is so."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import versions
from versions_page import lines

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "versions.md").read_text()
TABLE = {
    "joint": ([1, 2, 3], "1"),
    "verdict": (["agrees", "differs", None], ""),
    "d_mm": ([1225.0, 0.0, None], "mm"),
    "q_rad": ([0.5, -0.1, float("nan")], "rad"),
    "coefficient": ([5e-4, 0.2, 1e-9], "mm for delta, rad for eps"),
}
FIT = {
    "quantity": (["gap", "singular_value", *["undetermined_direction"] * 4], ""),
    "number": ([None, 1, 1, 1, 2, 2], "1"),
    "parameter": ([None, None, "j2.d_mm", "j3.d_mm", "j2.d_mm", "j3.d_mm"], ""),
    "value": ([4e5, 76.0, 1.0, 0.0, 0.0, 1.0], "see unit"),
    "unit": (["1", "mm per mm or mrad", "mm", "mm", "mm", "mm"], ""),
}


def write(folder: Path, name: str, columns: dict) -> None:
    fields = [
        pa.field(each, pa.array(values).type, metadata={"unit": unit})
        for each, (values, unit) in columns.items()
    ]
    arrays = [pa.array(values) for values, _ in columns.values()]
    (folder / "arm").mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.table(arrays, schema=pa.schema(fields)), folder / "arm" / f"{name}.parquet")


def changed(columns: dict, name: str, row: int, value: object) -> dict:
    values, unit = columns[name]
    return {**columns, name: ([*values[:row], value, *values[row + 1 :]], unit)}


@pytest.fixture
def two(tmp_path):
    """Results of two environments that are the same."""
    for folder in ("one", "other"):
        write(tmp_path / folder, "model", TABLE)
        write(tmp_path / folder, "dh_fit", FIT)
    return tmp_path / "one", tmp_path / "other"


def test_the_same_results_do_not_differ(two):
    assert all(each.allowed and each.size == 0.0 for each in versions.differences(*two))
    assert versions.main(["--compare", *map(str, two)]) == 0


@pytest.mark.parametrize(
    ("name", "row", "value"),
    [
        ("joint", 1, 4),
        ("verdict", 0, "differs"),
        ("verdict", 2, "agrees"),
        ("d_mm", 0, 1225.0 + 2e-9),
        ("d_mm", 2, 0.0),
        ("d_mm", 1, None),
        ("d_mm", 1, float("inf")),
        ("q_rad", 1, -0.1 + 2e-12),
        ("q_rad", 2, 0.0),
        ("coefficient", 1, 0.2 + 1e-9),
    ],
)
def test_what_another_version_changes_is_found_by_its_place(two, name, row, value, capsys):
    write(two[1], "model", changed(TABLE, name, row, value))
    assert versions.main(["--compare", *map(str, two)]) == 1
    assert f"arm/model.parquet: {name}: " in capsys.readouterr().out


@pytest.mark.parametrize(("name", "apart"), [("d_mm", 1e-11), ("q_rad", 1e-14)])
def test_rounding_is_told_by_its_unit_and_allowed(two, name, apart):
    write(two[1], "model", changed(TABLE, name, 0, TABLE[name][0][0] + apart))
    found = [each for each in versions.differences(*two) if each.size]
    assert [(each.unit, each.allowed) for each in found] == [(TABLE[name][1], True)]
    assert found[0].size == pytest.approx(apart, rel=0.1)


def test_tables_columns_and_rows_that_only_one_has_are_found(two):
    write(two[1], "more", TABLE)
    write(two[1], "model", {name: TABLE[name] for name in list(TABLE)[1:]})
    write(two[1], "dh_fit", {name: (v[:-1], unit) for name, (v, unit) in FIT.items()})
    places = {each.place for each in versions.differences(*two) if not each.allowed}
    assert places == {"arm/more.parquet", "arm/model.parquet", "arm/dh_fit.parquet"}


def test_another_basis_of_what_is_undetermined_is_the_same_and_another_span_is_not(two):
    turned = changed(changed(FIT, "value", 2, 0.6), "value", 3, 0.8)
    write(two[1], "dh_fit", turned)
    assert not all(each.allowed for each in versions.differences(*two))
    write(two[1], "dh_fit", changed(changed(turned, "value", 4, -0.8), "value", 5, 0.6))
    assert all(each.allowed for each in versions.differences(*two))


def test_a_wrong_number_in_a_real_table_is_found(tmp_path):
    folder = ROOT / "docs" / "claims"
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        for path in folder.glob("*.parquet"):
            table = pq.read_table(path)
            if name == "other" and path.name == "claim_shares.parquet":
                place = next(
                    i for i, field in enumerate(table.schema) if str(field.type) == "double"
                )
                values = table.column(place).to_pylist()
                row = next(i for i, value in enumerate(values) if value is not None)
                values[row] += 1e-3
                table = table.set_column(place, table.schema.field(place), pa.array(values))
            pq.write_table(table, tmp_path / name / path.name)
    found = [*versions.differences(tmp_path / "one", tmp_path / "other")]
    assert [each.allowed for each in found] == [False]


def test_the_page_has_the_oldest_versions_that_pyproject_states():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    bounds = versions.lower_bounds()
    assert set(bounds) == set(versions.MATTERS)
    for name, oldest in bounds.items():
        assert f"{name} {oldest}" in PAGE
    rows = dict(re.findall(r"^\| (oldest-3\.11) \| (.*?) \|$", PAGE, re.MULTILINE))
    tried = [cell.strip() for cell in rows["oldest-3.11"].split("|")][1 : 1 + len(bounds)]
    for name, version in zip(versions.MATTERS, tried, strict=True):
        assert version.split(".")[: bounds[name].count(".") + 1] == bounds[name].split(".")
    assert project["requires-python"] == ">=3.11,<3.14"
    for python in versions.PYTHONS:
        assert f"Python :: {python}" in "".join(project["classifiers"])
        assert f"| {python}." in PAGE


def test_the_page_has_the_tolerances_that_numbers_are_held_to():
    for unit, tolerance in versions.TOLERANCES.items():
        assert f"| {unit} | {tolerance.absolute:.0e}".replace("| 1 |", "| pure numbers |") in PAGE


def test_the_page_states_what_tests_hold_floats_to_beside_50_digits():
    assert "\n".join(lines()) in PAGE, "\n".join(lines())

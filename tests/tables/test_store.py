"""The tables: what is written comes back, the same bytes every time, all or nothing."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinacc.errors import InputError
from kinacc.tables import store
from kinacc.tables.atomic import replacing
from kinacc.tables.contract import PROVENANCE_KEYS, columns_of

PROVENANCE = {
    "kinacc_version": "0.1.0",
    "config_hash": "c",
    "seed": 7,
}


def points(joints: int = 6, rows: int = 3) -> dict:
    table = {"point": np.arange(rows)}
    table |= {f"q{j + 1}": np.linspace(-1, 1, rows) for j in range(joints)}
    table |= {f"s{j + 1}": np.array([-1, 0, 1])[:rows] for j in range(joints)}
    table |= {f"e{axis}_mm": np.full(rows, 0.1) for axis in "xyz"}
    table["true_error_mm"] = np.full(rows, 0.1 * np.sqrt(3))
    return table


def residuals(**changes) -> dict:
    table = {
        "comparison": ["dh_vs_vec", "dh_vs_vec"],
        "subset": ["train", "train"],
        "fold": [None, 1],
        "quantity": ["position", "orientation"],
        "unit": ["mm", "mrad"],
        "n": [10, 10],
        "mean": [0.4, 1.3],
        "max": [0.8, 2.8],
        "rms": [0.5, 1.5],
        "gamma99": [0.9, np.nan],
    }
    return table | changes


@pytest.mark.parametrize("joints", [4, 6, 7])
def test_round_trip_for_any_number_of_joints(tmp_path, joints):
    path = tmp_path / "a folder" / "assessment_points.parquet"
    table = points(joints)
    store.write(path, "assessment_points", table, PROVENANCE)
    back = store.read(path)
    assert set(back) == set(table)
    for name, values in table.items():
        np.testing.assert_array_equal(back[name], values)
    assert back["s1"].dtype == np.int8
    names = pq.read_schema(path).names
    assert names[1 : 1 + joints] == [f"q{j + 1}" for j in range(joints)]


def test_null_is_nan_for_numbers_and_none_for_text(tmp_path):
    path = tmp_path / "residuals.parquet"
    store.write(path, "residuals", residuals(), PROVENANCE)
    raw = pq.read_table(path)
    assert raw["fold"].to_pylist() == [None, 1]
    assert raw["gamma99"].to_pylist() == [0.9, None]
    back = store.read(path)
    assert np.isnan(back["fold"][0])
    assert back["fold"][1] == 1
    assert np.isnan(back["gamma99"][1])
    assert list(back["unit"]) == ["mm", "mrad"]


def test_metadata_is_exactly_the_provenance_and_digests_and_fields_carry_units(tmp_path):
    path = tmp_path / "residuals.parquet"
    store.write(path, "residuals", residuals(), PROVENANCE)
    schema = pq.read_schema(path)
    assert sorted(schema.metadata) == sorted(key.encode() for key in PROVENANCE_KEYS)
    assert store.read_metadata(path)["seed"] == "7"
    for field in schema:
        assert set(field.metadata) == {b"unit", b"meaning"}
        assert field.metadata[b"meaning"]


def test_same_columns_give_the_same_bytes(tmp_path):
    contents = []
    for number in range(2):
        path = tmp_path / f"{number}.parquet"
        store.write(path, "residuals", residuals(), PROVENANCE)
        contents.append(path.read_bytes())
    assert contents[0] == contents[1]


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"mean": [0.4, np.nan]}, ["mean", "row 1"]),
        ({"mean": [0.4, np.inf]}, ["mean", "infinite"]),
        ({"n": [10, 2.5]}, ["column n", "2.5"]),
        ({"unit": ["mm", None]}, ["unit", "row 1"]),
        ({"unit": ["mm", 3]}, ["column unit"]),
        ({"mean": ["a", 1.0]}, ["column mean"]),
        ({"surprise": [1, 2]}, ["surprise", "not in the contract"]),
        ({"n": [1, 2, 3]}, ["column mean", "different lengths"]),
    ],
)
def test_a_column_that_does_not_fit_is_named(tmp_path, changes, names):
    path = tmp_path / "residuals.parquet"
    with pytest.raises(InputError) as caught:
        store.write(path, "residuals", residuals(**changes), PROVENANCE)
    for name in names:
        assert name in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_every_problem_is_listed_at_once(tmp_path):
    table = residuals(mean=[np.nan, 1.0])
    del table["rms"], table["n"]
    with pytest.raises(InputError) as caught:
        store.write(tmp_path / "r.parquet", "residuals", table, {"seed": 1, "time": "now"})
    text = str(caught.value)
    for word in ("column rms", "column n", "column mean", "time", "config_hash"):
        assert word in text


def test_a_table_that_does_not_fit_leaves_what_was_there(tmp_path):
    path = tmp_path / "good.parquet"
    path.write_bytes(b"what was there")
    with pytest.raises(InputError):
        store.write_table(path, "residuals", pd.DataFrame(residuals(n=[0.5, 1])), PROVENANCE)
    assert path.read_bytes() == b"what was there"
    assert [path.name for path in tmp_path.iterdir()] == ["good.parquet"]


def test_a_frame_comes_back_as_it_was(tmp_path):
    frame = pd.DataFrame(residuals())
    store.write_table(tmp_path / "frame.parquet", "residuals", frame, PROVENANCE)
    store.write_table(tmp_path / "columns.parquet", "residuals", residuals(), PROVENANCE)
    same = [(tmp_path / f"{name}.parquet").read_bytes() for name in ("frame", "columns")]
    assert same[0] == same[1]
    back = store.read_table(tmp_path / "frame.parquet")
    pd.testing.assert_frame_equal(back, frame)
    store.write_table(tmp_path / "again.parquet", "residuals", back, PROVENANCE)
    assert (tmp_path / "again.parquet").read_bytes() == same[0]


def test_a_failure_while_writing_leaves_nothing_behind(tmp_path):
    paths = [tmp_path / "fig1.svg", tmp_path / "fig1.pdf"]

    def stopped_half_way():
        with replacing(paths) as temporary:
            temporary[0].write_text("half")
            raise RuntimeError("power cut")

    with pytest.raises(RuntimeError, match="power cut"):
        stopped_half_way()
    assert not list(tmp_path.iterdir())


def test_writers_of_one_number_on_two_machines_do_not_meet(tmp_path):
    """Containers number their processes alike, and share a folder of results."""
    path = tmp_path / "fig1.svg"
    with replacing([path]) as (slow,):
        slow.write_text("slow")
        with replacing([path]) as (quick,):
            quick.write_text("quick")
        assert path.read_text() == "quick"
    assert path.read_text() == "slow"


def test_unreadable_files_are_named(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        store.read(tmp_path / "absent.parquet")
    broken = tmp_path / "broken.parquet"
    broken.write_text("not parquet at all")
    with pytest.raises(InputError, match="not a readable Parquet file"):
        store.read(broken)
    with pytest.raises(InputError, match="not in the contract"):
        store.write(tmp_path / "x.parquet", "nonsense", {}, PROVENANCE)


NUMBERS = st.lists(
    st.one_of(st.none(), st.floats(allow_nan=False, allow_infinity=False)), min_size=1, max_size=40
)
TEXTS = st.lists(st.one_of(st.none(), st.text()), min_size=1, max_size=40)


@settings(max_examples=60, deadline=None)
@given(NUMBERS, TEXTS, st.data())
def test_any_numbers_and_texts_come_back(numbers, texts, data):
    count = min(len(numbers), len(texts))
    whole = data.draw(
        st.lists(st.one_of(st.none(), st.integers(1, 2**53)), min_size=count, max_size=count)
    )
    table = {
        "quantity": ["q"] * count,
        "number": whole,
        "parameter": texts[:count],
        "value": numbers[:count],
        "unit": ["mm"] * count,
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "vec_fit.parquet"
        store.write(path, "vec_fit", table, PROVENANCE)
        plain, back = pq.read_table(path), store.read(path)
    for name, values in table.items():
        assert plain[name].to_pylist() == values
        found = [None if each is None or each != each else each for each in back[name]]
        assert found == values


def test_tables_without_rows_keep_their_types(tmp_path):
    path = tmp_path / "residuals.parquet"
    store.write(path, "residuals", {name: [] for name in residuals()}, PROVENANCE)
    back = store.read(path)
    assert {name: len(values) for name, values in back.items()} == dict.fromkeys(residuals(), 0)
    assert (back["n"].dtype, back["mean"].dtype, back["fold"].dtype) == ("i8", "f8", "f8")


def test_a_table_of_many_row_groups_comes_back(tmp_path):
    path = tmp_path / "points.parquet"
    table = points(rows=3)
    store.write(path, "assessment_points", table, PROVENANCE)
    pq.write_table(pq.read_table(path), path, row_group_size=1)
    back = store.read(path)
    for name, values in table.items():
        np.testing.assert_array_equal(back[name], values)


@pytest.mark.parametrize("rows", [[("rank", None, None, 3, "1"), ("cost", 2, "x", None, "mm")], []])
def test_rows_become_the_columns_that_their_file_gives_back(rows, tmp_path):
    made = columns_of("vec_fit", rows)
    names = ("quantity", "number", "parameter", "value", "unit")
    by_name = columns_of("vec_fit", [dict(zip(names, row, strict=True)) for row in rows])
    store.write(tmp_path / "vec_fit.parquet", "vec_fit", made, PROVENANCE)
    back = store.read(tmp_path / "vec_fit.parquet")
    assert tuple(made) == tuple(back) == names
    for name, values in back.items():
        assert made[name].dtype == by_name[name].dtype == values.dtype
        np.testing.assert_array_equal(made[name], values)
        np.testing.assert_array_equal(by_name[name], values)

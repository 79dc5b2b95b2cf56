"""The tables: what is written comes back, the same bytes every time, all or nothing."""

from __future__ import annotations

import resource
import tempfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from assessed_points import points
from hypothesis import given, settings
from hypothesis import strategies as st

from kinacc.errors import InputError
from kinacc.tables import store
from kinacc.tables.atomic import write_together, write_whole
from kinacc.tables.contract import PROVENANCE_KEYS

PROVENANCE = {"kinacc_version": "0.1.0", "config_hash": "c", "seed": 7}


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


def content_of(artefact, columns):
    """The bytes of a table's file."""
    return store.content_of(store.to_table(artefact, columns, PROVENANCE))


@pytest.mark.parametrize("joints", [4, 7])
def test_round_trip_for_any_number_of_joints_and_row_groups(tmp_path, joints):
    path = tmp_path / "a folder" / "assessment_points.parquet"
    table = pd.DataFrame(points(joints))
    write_whole(path, content_of("assessment_points", table))
    pd.testing.assert_frame_equal(store.read_table(path), table)
    pq.write_table(pq.read_table(path), path, row_group_size=1)
    back = store.read(path)
    assert back["s1"].dtype == np.int8
    np.testing.assert_array_equal(pd.DataFrame(back), table)


def test_a_frame_and_columns_give_the_same_bytes_with_units_and_provenance(tmp_path):
    frame = pd.DataFrame(residuals())
    path, content = tmp_path / "a.parquet", content_of("residuals", frame)
    path.write_bytes(content)
    for same in (residuals(), store.read_table(path)):
        assert content_of("residuals", same) == content
    raw = pq.read_table(path)
    assert (raw["fold"].to_pylist(), raw["gamma99"].to_pylist()) == ([None, 1], [0.9, None])
    assert sorted(raw.schema.metadata) == sorted(key.encode() for key in PROVENANCE_KEYS)
    assert store.read_metadata(path)["seed"] == "7"
    assert all({*field.metadata} == {b"unit", b"meaning"} for field in raw.schema)


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"mean": [0.4, np.nan]}, ["mean", "row 1"]),
        ({"mean": [0.4, np.inf]}, ["mean", "infinite"]),
        ({"n": [10, 2.5]}, ["column n", "2.5"]),
        ({"unit": ["mm", None]}, ["unit", "row 1"]),
        ({"unit": ["mm", 3]}, ["column unit"]),
        ({"mean": ["a", 1.0], "rms": [None, 1.0]}, ["column mean", "column rms"]),
        ({"surprise": [1, 2]}, ["surprise", "not in the contract"]),
        ({"n": [1, 2, 3]}, ["column mean", "different lengths"]),
    ],
)
def test_every_column_that_does_not_fit_is_named(changes, names):
    with pytest.raises(InputError) as caught:
        store.to_table("residuals", residuals(**changes), PROVENANCE)
    assert all(name in str(caught.value) for name in names)


def test_a_failure_while_writing_leaves_nothing_of_any_file(tmp_path):
    with pytest.raises(TypeError):
        write_together({tmp_path / "fig1.svg": b"whole", tmp_path / "fig1.pdf": None})
    assert not list(tmp_path.iterdir())
    (tmp_path / "fig1.svg").mkdir()
    with pytest.raises(InputError, match=r"fig1\.svg: cannot be written: is a directory"):
        write_together({tmp_path / "fig1.svg": b"whole"})
    assert [*tmp_path.iterdir()] == [tmp_path / "fig1.svg"]


@settings(max_examples=150, deadline=5000)
@given(st.lists(st.tuples(st.floats(0, 1), st.binary(max_size=8)), max_size=6), st.floats(0, 1))
def test_a_damaged_file_is_refused_or_read_within_a_gigabyte_and_five_seconds(damage, kept):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    content = bytearray(content_of("residuals", residuals()))
    for place, replaced in damage:
        start = int(place * len(content))
        content[start : start + len(replaced)] = replaced
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "residuals.parquet"
        path.write_bytes(content if kept > 0.2 else content[: int(5 * kept * len(content))])
        for reading in (store.read_table, store.read, store.read_metadata):
            with suppress(InputError):
                reading(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1_000_000

"""Two results are the same but for rounding: what was planted is found, order does not count."""

import numpy as np
import pyarrow.parquet as pq
import pytest

from kinacc.errors import InputError
from kinacc.tables import store
from kinacc.tables.comparison import compare_folders, compare_tables

MARKS = {"kinacc_version": "0", "config_hash": "c", "seed": 1}
ROWS = 12


def measurements():
    draw = np.random.default_rng(3)
    return {
        "pose": np.arange(ROWS),
        **{f"q{joint}": draw.uniform(-1.0, 1.0, ROWS) for joint in range(1, 7)},
        **{f"s{joint}": np.zeros(ROWS, int) for joint in range(1, 7)},
        "target": ["tool"] * ROWS,
        **{f"{axis}_mm": draw.normal(size=ROWS) for axis in "xyz"},
        "qw": np.ones(ROWS),
        **{f"q{axis}": np.zeros(ROWS) for axis in "xyz"},
        "repeat": np.zeros(ROWS, int),
        "subset": ["train"] * ROWS,
        "fold": [0.0, 1.0] * (ROWS // 2),
    }


def claims():
    return {
        "claim": ["first", "second"],
        "statement": ["a sentence", "another"],
        "statistic": ["mean", "mean"],
        "evidence": ["tables", "tables"],
        "paper": [1.0, 2.0],
        "reproduced": [1.1, 2.1],
        "tolerance": [0.2, 0.2],
        "verdict": ["agrees", "agrees"],
        "share": [np.nan, np.nan],
        "used_to_choose": [False, True],
    }


def written(folder, artefact, columns):
    folder.mkdir(exist_ok=True)
    path = folder / f"{artefact}.parquet"
    path.write_bytes(store.content_of(store.to_table(artefact, columns, MARKS)))
    return path


def differences(tmp_path, artefact, before, now, tolerances=None):
    paths = [written(tmp_path / name, artefact, columns)
             for name, columns in (("before", before), ("now", now))]  # fmt: skip
    return list(compare_tables(*paths, tolerances))


def changed(table, column, row, value):
    values = list(table[column])
    values[row] = value
    return {**table, column: values}


def test_the_same_tables_do_not_differ(tmp_path):
    assert differences(tmp_path, "measurements", measurements(), measurements()) == []
    assert differences(tmp_path, "claims", claims(), claims()) == []


@pytest.mark.parametrize(("by_mm", "found"), [(1e-5, 1), (-1e-5, 1), (1e-8, 0)])
def test_a_length_may_differ_by_rounding_and_by_no_more(tmp_path, by_mm, found):
    table = measurements()
    now = changed(table, "y_mm", 7, table["y_mm"][7] + by_mm)
    told = differences(tmp_path, "measurements", table, now)
    assert [each.column for each in told] == ["y_mm"] * found
    for each in told:
        assert (each.rows, each.unit) == (1, "mm")
        assert each.largest == pytest.approx(1e-5, rel=1e-3)
        assert "pose=7" in each.row


@pytest.mark.parametrize(
    ("artefact", "table", "column", "value"),
    [
        ("measurements", measurements(), "subset", "validation"),
        ("measurements", measurements(), "s3", 1),
        ("measurements", measurements(), "fold", np.nan),
        ("claims", claims(), "verdict", "differs"),
    ],
)
def test_a_count_a_word_and_a_null_are_equal_or_differ(tmp_path, artefact, table, column, value):
    now = changed(table, column, 1, value)
    (told,) = differences(tmp_path, artefact, table, now)
    assert (told.table, told.column, told.rows) == (artefact, column, 1)


def test_a_missing_row_and_a_new_one_are_counted(tmp_path):
    table = measurements()
    fewer = {name: list(values)[:-2] for name, values in table.items()}
    (told,) = differences(tmp_path, "measurements", table, fewer)
    assert (told.column, told.what.split(",")[0]) == ("", "2 rows missing")
    (told,) = differences(tmp_path, "measurements", fewer, table)
    assert told.what.startswith("2 rows new")


def test_a_missing_column_is_named(tmp_path):
    whole = written(tmp_path / "whole", "measurements", measurements())
    (tmp_path / "part").mkdir()
    part = tmp_path / "part" / "measurements.parquet"
    pq.write_table(pq.read_table(whole).drop_columns(["fold"]), part)
    (told,) = compare_tables(whole, part)
    assert (told.column, told.what) == ("fold", "missing")
    (told,) = compare_tables(part, whole)
    assert (told.column, told.what) == ("fold", "new")


def test_rows_in_another_order_are_the_same(tmp_path):
    order = np.random.default_rng(5).permutation(ROWS)
    now = {name: [list(values)[i] for i in order] for name, values in measurements().items()}
    assert differences(tmp_path, "measurements", measurements(), now) == []


def test_a_tolerance_of_ones_own_counts_for_its_column_alone(tmp_path):
    table = measurements()
    now = changed(changed(table, "x_mm", 0, table["x_mm"][0] + 0.01), "y_mm", 0, 9.0)
    told = differences(tmp_path, "measurements", table, now, {"measurements.x_mm": 0.1})
    assert [each.column for each in told] == ["y_mm"]


def test_folders_are_compared_table_by_table(tmp_path):
    for name in ("before", "now"):
        written(tmp_path / name, "measurements", measurements())
        written(tmp_path / name, "claims", claims())
    assert list(compare_folders(tmp_path / "before", tmp_path / "now")) == []
    (tmp_path / "now" / "claims.parquet").unlink()
    (told,) = compare_folders(tmp_path / "before", tmp_path / "now")
    assert (told.table, told.what) == ("claims.parquet", "missing")
    with pytest.raises(InputError, match="holds no table"):
        list(compare_folders(tmp_path / "nothing", tmp_path / "now"))

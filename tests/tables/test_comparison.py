"""Two results are the same but for rounding: what was planted is found, order does not count."""

import numpy as np
import pyarrow.parquet as pq
import pytest
from assessed_points import points

from kinacc.errors import InputError
from kinacc.tables import store
from kinacc.tables.atomic import write_whole
from kinacc.tables.comparison import compare_folders, compare_tables

MARKS = {"kinacc_version": "0", "config_hash": "c", "seed": 1}
ROWS = 12


def written(folder, artefact, columns):
    path = folder / f"{artefact}.parquet"
    write_whole(path, store.content_of(store.to_table(artefact, columns, MARKS)))
    return path


def differences(tmp_path, before, now):
    paths = [written(tmp_path / name, "assessment_points", columns)
             for name, columns in (("before", before), ("now", now))]  # fmt: skip
    return list(compare_tables(*paths))


def changed(table, column, row, value):
    values = list(table[column])
    values[row] = value
    return {**table, column: values}


@pytest.mark.parametrize(("by_mm", "found"), [(1e-5, 1), (-1e-5, 1), (1e-8, 0)])
def test_a_length_may_differ_by_rounding_and_by_no_more(tmp_path, by_mm, found):
    table = points()
    now = changed(table, "ey_mm", 7, table["ey_mm"][7] + by_mm)
    told = differences(tmp_path, table, now)
    assert len(told) == found
    for line in told:
        assert line.startswith("assessment_points, column ey_mm: 1 rows differ, first point=7: ")
    (told,) = differences(tmp_path, table, changed(table, "s3", 0, 1))
    assert told.startswith("assessment_points, column s3: 1 rows differ")


def test_rows_belong_together_by_their_key_and_are_missing_or_new(tmp_path):
    order = np.random.default_rng(5).permutation(ROWS)
    table = points()
    assert differences(tmp_path, table, {k: v[order] for k, v in table.items()}) == []
    fewer = {name: values[:-2] for name, values in table.items()}
    (told,) = differences(tmp_path, table, fewer)
    assert told.startswith("assessment_points: 2 rows missing, first point=10")
    (told,) = differences(tmp_path, fewer, table)
    assert told.startswith("assessment_points: 2 rows new")


def test_files_and_columns_that_are_missing_are_named(tmp_path):
    before, now = (written(tmp_path / name, "assessment_points", points()) for name in "ab")
    assert list(compare_folders(before.parent, now.parent)) == []
    pq.write_table(pq.read_table(now).drop_columns(["ex_mm"]), now)
    (told,) = compare_tables(before, now)
    assert told == "assessment_points, column ex_mm: missing"
    now.unlink()
    (told,) = compare_folders(before.parent, now.parent)
    assert told == f"{before.name}: missing"
    with pytest.raises(InputError, match="holds no table"):
        list(compare_folders(now.parent, before.parent))

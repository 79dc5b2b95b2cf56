"""Tables of results on the screen and in files."""

from __future__ import annotations

import shutil

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from command_line import answer, call

POSES = 80  # of the small study


@pytest.fixture
def folder(study, tmp_path):
    """A data set's folder with a table, one damaged and one of another program."""
    here = tmp_path / "results" / "arm"
    here.mkdir(parents=True)
    shutil.copy(study / "measurements.parquet", here)
    (here / "vec_model.parquet").write_bytes(b"PAR1 and no more")
    pq.write_table(pa.table({"a": [1, 2], "b": ["\x1b[31mred", None]}), here / "own.parquet")
    return here


def rows(*words):
    return answer("show", *words)["rows"]


def test_folders_and_tables_are_listed(folder):
    assert rows(folder.parent) == [{"folder": "arm", "tables": 3}]
    found = {row["table"]: row["rows"] for row in rows(folder)}
    assert found == {"measurements": "80", "own": "2", "vec_model": ""}


@pytest.mark.parametrize("name", ["measurements", "measurements.parquet"])
def test_a_table_is_found_with_and_without_its_ending(folder, name):
    assert len(rows(folder, name)) == len(rows(folder / name)) == POSES
    assert rows(folder, "own") == [{"a": 1, "b": "\x1b[31mred"}, {"a": 2, "b": None}]
    assert "\x1b" not in call("show", folder, "own").output


@pytest.mark.parametrize("kind", ["csv", "excel", "parquet"])
def test_files_hold_all_rows_and_all_digits(folder, tmp_path, kind):
    known = pd.read_parquet(folder / "measurements.parquet")
    file = tmp_path / f"out.{'xlsx' if kind == 'excel' else kind}"
    assert [call("show", folder, "measurements", "-o", file).exit_code for _ in "12"] == [0, 2]
    found = getattr(pd, f"read_{kind}")(file)
    np.testing.assert_allclose(found["q3"], known["q3"], rtol=1e-11)


@pytest.mark.parametrize("name", ["measurement", "vec_model", "empty", "measurements.parquet/x"])
def test_what_is_no_table_is_refused(folder, name):
    (folder / "empty.parquet").touch()
    done = call("show", folder, name, code=2)
    assert ("did you mean" in done.output) == (name == "measurement")

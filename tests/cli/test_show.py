"""An engineer at a terminal looks at results: folders, tables, pictures, and files for others."""

import json

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from kinacc.cli.group import main
from kinacc.tables import store
from kinacc.tables.contract import PROVENANCE_KEYS, columns_of

PROVENANCE = dict.fromkeys(PROVENANCE_KEYS, "1")


def show(*words, width=80, **environment):
    env = {"COLUMNS": str(width), "NO_COLOR": None, "FORCE_COLOR": None, **environment}
    return CliRunner().invoke(main, ["show", *map(str, words)], env=env)


def write(folder, name, rows, stem=None):
    path = folder / f"{stem or name}.parquet"
    store.write(path, name, columns_of(name, rows), PROVENANCE)
    return path


def residuals(folder):
    rows = [
        (f"{model}_vs_measured", "validation", fold, quantity, unit, 299, 0.25 + place / 7, 2, 1,
         None if fold is None else 1.5)
        for place, model in enumerate(("vec", "dh", "nominal"))
        for fold in (None, *range(5))
        for quantity, unit in (("position", "mm"), ("orientation", "mrad"))
    ]  # fmt: skip
    return write(folder, "residuals", rows)


def measurements(folder, poses=60, target="tool"):
    rng = np.random.default_rng(1)
    columns = {
        "pose": np.arange(poses),
        **{f"q{i + 1}": rng.uniform(-1, 1, poses) for i in range(6)},
        **{f"s{i + 1}": np.zeros(poses, np.int8) for i in range(6)},
        "target": [target] * poses,
        **{f"{axis}_mm": rng.uniform(-900, 900, poses) for axis in "xyz"},
        **{f"q{part}": [None] * poses for part in "wxyz"},
        "repeat": np.zeros(poses, int),
        "subset": ["train"] * poses,
        "fold": [None] * poses,
        "row": np.arange(poses) + 2,
    }
    store.write(folder / "measurements.parquet", "measurements", columns, PROVENANCE)


def test_the_folder_of_a_data_set_lists_its_tables(tmp_path):
    residuals(tmp_path)
    measurements(tmp_path)
    (tmp_path / "vec_model.parquet").write_bytes(b"PAR1 and no more")
    done = show(tmp_path, "--json")
    assert done.exit_code == 0, done.output
    rows = {row["table"]: row for row in json.loads(done.stdout)["rows"]}
    assert (rows["residuals"]["rows"], rows["measurements"]["rows"]) == ("36", "60")
    assert rows["vec_model"]["rows"] == ""  # a damaged table does not hide the others
    assert "residuals" in show(tmp_path).output


def test_a_folder_of_results_lists_its_data_sets(tmp_path):
    for name in ("arm", "other"):
        (tmp_path / name).mkdir()
        residuals(tmp_path / name)
    rows = json.loads(show(tmp_path, "--json").stdout)["rows"]
    assert rows == [{"folder": "arm", "tables": 1}, {"folder": "other", "tables": 1}]


@pytest.mark.parametrize("words", [("residuals",), ("residuals.parquet",)])
def test_a_table_is_found_with_and_without_its_ending(tmp_path, words):
    residuals(tmp_path)
    for done in (show(tmp_path, *words), show(tmp_path / words[0])):
        assert done.exit_code == 0
        assert "36 rows" in done.output


def test_rows_and_columns_can_be_chosen(tmp_path):
    residuals(tmp_path)
    words = ("--where", "fold=-", "--where", "unit=mm", "--columns", "comparison,me*")
    rows = json.loads(show(tmp_path, "residuals", *words, "--json").stdout)["rows"]
    assert [list(row) for row in rows] == [["comparison", "mean"]] * 3
    assert [row["mean"] for row in rows] == [0.25, 0.25 + 1 / 7, 0.25 + 2 / 7]
    assert "in every row" in show(tmp_path, "residuals", *words[:4]).output


def test_a_long_table_shows_both_ends(tmp_path):
    measurements(tmp_path)
    done = show(tmp_path, "measurements", "--columns", "pose,q1")
    assert ".. 40 more" in done.output
    assert len(done.output.splitlines()) < 30
    assert "59" in done.output


def test_files_hold_all_rows_and_all_digits(tmp_path):
    measurements(tmp_path)
    known = pd.read_parquet(tmp_path / "measurements.parquet")
    for kind, read in (
        (".csv", pd.read_csv),
        (".xlsx", pd.read_excel),
        (".parquet", pd.read_parquet),
    ):
        file = tmp_path / f"out{kind}"
        assert show(tmp_path, "measurements", "-o", file).exit_code == 0
        assert show(tmp_path, "measurements", "-o", file).exit_code == 2
        np.testing.assert_allclose(read(file)["q3"], known["q3"], rtol=1e-11)
    printed = show(tmp_path, "measurements", "--csv", "--rows", 3).stdout
    assert len(printed.splitlines()) == 4


def test_columns_are_described_with_unit_and_meaning(tmp_path):
    measurements(tmp_path)
    rows = json.loads(show(tmp_path, "measurements", "--describe", "--json").stdout)["rows"]
    known = {row["column"]: row for row in rows}
    assert known["q1"]["unit"] == "rad"
    assert known["pose"]["holds"] == "0 to 59"
    assert known["x_mm"]["meaning"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("residual",), "did you mean"),
        (("residuals", "--columns", "men"), "did you mean mean?"),
        (("residuals", "--where", "fold=77"), "no row meets"),
        (("residuals.parquet/x",), "is a file"),
        (("--describe",), "is a folder"),
    ],
)
def test_a_mistake_is_answered_in_words(tmp_path, words, said):
    residuals(tmp_path)
    done = show(tmp_path, *words)
    assert done.exit_code == 2
    assert said in done.output


def test_a_table_of_another_program_is_shown(tmp_path):
    pq.write_table(pa.table({"a": [1, 2], "b": ["x", None]}), tmp_path / "own.parquet")
    done = show(tmp_path, "own")
    assert done.exit_code == 0
    assert "2 rows" in done.output


@pytest.mark.parametrize("name", ["text.parquet", "empty.parquet"])
def test_a_file_that_is_no_table_is_refused(tmp_path, name):
    (tmp_path / name).write_bytes(b"" if name.startswith("empty") else b"no table")
    assert show(tmp_path / name).exit_code == 2
    (tmp_path / name).unlink()
    assert show(tmp_path).exit_code == 2


def test_texts_cannot_control_the_terminal(tmp_path):
    measurements(tmp_path, 3, target="\x1b[31mred\x07")
    assert "\x1b" not in show(tmp_path, "measurements").output

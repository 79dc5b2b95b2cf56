"""An engineer at a terminal looks at results: folders, tables, pictures, and files for others."""

import csv
import io
import json
import shlex
import subprocess
import sys

import numpy as np
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


def vec_orders(folder, orders=range(1, 8)):
    rows = [(None, order, 1.0, 1.0, 0.7, -1 / order - 0.05 * order, 0.0, int(order == 4))
            for order in orders]  # fmt: skip
    return write(folder, "vec_orders", rows)


def table_of(output):
    """Rows of the printed table below its rule, split at two spaces or more."""
    lines = output.splitlines()
    rule = next(i for i, line in enumerate(lines) if line.startswith("──"))
    return [line.split() for line in lines[rule + 1 :]]


def test_the_folder_of_a_data_set_says_what_is_there_and_what_is_not(tmp_path):
    measurements(tmp_path)
    residuals(tmp_path)
    said = show(tmp_path)
    assert said.exit_code == 0
    rows = table_of(said.output)
    assert rows[0][:3] == ["measurements", "60", "Measured"]
    assert any(row[:2] == ["residuals", "36"] for row in rows)
    told = " ".join(said.output.split())
    assert "excluded_rows" not in told  # nothing is excluded
    assert "missing: vec_model, dh_model, frames, pose_errors, robot, model_selection" in told


def test_a_folder_of_results_lists_its_data_sets(tmp_path):
    for name in ("one", "two"):
        measurements(tmp_path / name)
    write(tmp_path / "one", "robot", [("ur10", None, None, "name: ur10")])
    rows = table_of(show(tmp_path).output)
    assert rows[0][:4] == ["one", "ur10", "60", "2"]
    assert next(row for row in rows if row[0] == "two")[1:4] == ["-", "60", "1"]


@pytest.mark.parametrize("words", [["residuals.parquet"], ["residuals"]], ids=" ".join)
def test_a_table_is_found_with_and_without_its_ending_alone_and_after_its_folder(tmp_path, words):
    path = residuals(tmp_path)
    alone, after = show(tmp_path / words[0]), show(tmp_path, *words)
    assert alone.exit_code == after.exit_code == 0
    assert alone.output == after.output
    # Lines are wrapped, so that the length of the test's folder says where they break.
    assert "".join(f"{path}: 36 rows, 10 columns".split()) in "".join(alone.output.split())


def test_what_is_the_same_in_every_row_stands_above_the_table_once(tmp_path):
    said = show(residuals(tmp_path), "--where", "fold=-", "--where", "quantity=position").output
    assert "in every row: subset validation, quantity position, unit mm, n 299" in said
    assert "without values: fold, gamma99" in said
    assert table_of(said) == [
        ["vec_vs_measured", "0.25000"],
        ["dh_vs_measured", "0.39286"],
        ["nominal_vs_measured", "0.53571"],
    ]


def test_a_long_table_shows_both_ends_and_says_how_many_rows_are_between(tmp_path):
    measurements(tmp_path, 1600)
    said = show(tmp_path, "measurements", "--rows", 9).output
    assert ".. 1,591 more rows (--rows all) .." in said
    shown = [row[0] for row in table_of(said.partition("80 characters")[0]) if row[0] != ".."]
    assert shown == ["0", "1", "2", "3", "4", "5", "1597", "1598", "1599"]
    whole = show(tmp_path, "measurements", "--rows", "all", "--columns", "pose").output
    assert len(table_of(whole)) == 1600


def test_columns_too_wide_for_the_terminal_are_named_and_can_be_asked_for(tmp_path):
    measurements(tmp_path)
    narrow, wide = (show(tmp_path, "measurements", width=width).output for width in (60, 160))
    assert max(map(len, narrow.splitlines())) <= 60
    assert "60 characters are too narrow for" in narrow
    assert "z_mm" in narrow.partition("too narrow for")[2]
    assert "too narrow" not in wide
    asked = show(tmp_path, "measurements", "--columns", "z_mm,pose,s*", width=60).output
    heading = next(line for line in asked.splitlines() if "z_mm" in line)
    assert heading.split() == ["z_mm", "pose", "s1", "s2", "s3", "s4", "s5", "s6"]


def test_the_facts_of_a_summary_are_told_on_more_lines_rather_than_left_out(tmp_path):
    statement = "a shift of the base along y cannot be told from a shift of the tool along z"
    facts = [
        ("held_out_orientation_error", "nominal", "mean", 12.345, "mrad", None),
        ("like_measured", "ranges of all joints", "highest_order_set_by", 0.5, "1", None),
        ("undetermined", "1", "statement", None, None, statement),
    ]
    path = write(tmp_path, "summary", facts)
    said = show(path).output
    assert max(map(len, said.splitlines())) <= 80
    assert "too narrow" not in said
    rows = table_of(said)
    second = next(place for place, row in enumerate(rows) if row[0] == "like_measured")
    third = next(place for place, row in enumerate(rows) if row[0] == "undetermined")
    assert rows[0] == ["held_out_", "nominal", "mean", "12.345", "mrad", "-"]
    assert "".join(row[0] for row in rows[:second]) == "held_out_orientation_error"
    told = " ".join(" ".join(row) for row in rows[third:])
    assert told.split() == f"undetermined 1 statement - - {statement}".split()
    assert "held_out_orientation_error  nominal" in show(path, width=160).output


def test_headings_tell_units_that_names_do_not(tmp_path):
    measurements(tmp_path)
    heading = show(tmp_path, "measurements", "--columns", "q1,x_mm,pose,qw").output.splitlines()
    assert "q1 [rad]      x_mm  pose  qw" in heading


def test_a_joint_that_slides_is_said_to_be_in_millimetres(tmp_path):
    rows = [
        "{joint: prismatic, theta_offset_deg: 0, d_mm: 5, a_mm: 70, alpha_deg: -90, "
        "limits_mm: [0, 400]}",
        *["{theta_offset_deg: 0, d_mm: 80, a_mm: 250, alpha_deg: 90, limits_deg: [-90, 90]}"] * 5,
    ]
    text = "name: sliding\ndh:\n" + "".join(f"  - {row}\n" for row in rows)
    measurements(tmp_path)
    write(tmp_path, "robot", [("sliding", None, None, text)])
    said = show(tmp_path, "measurements", "--columns", "q1,q2").output
    assert "q1 [mm]  q2 [rad]" in said


def test_numbers_are_aligned_and_rounding_is_not_shown_as_a_number(tmp_path):
    rows = [(f"p{i}", f"p{i}", value, None) for i, value in enumerate((1234.5, 0.25, -4e-19, 2e-5))]
    path = write(tmp_path, "dh_covariance", rows)
    lines = show(path).output.splitlines()
    cells = [line for line in lines if line.startswith("p") and line[1].isdigit()]
    assert [line.split()[2] for line in cells] == ["1234.500", "0.250", "0.000", "2.0e-05"]
    assert len({len(line) for line in cells}) == 1


def test_a_table_of_one_row_stands_upright(tmp_path):
    said = show(vec_orders(tmp_path, [5])).output
    assert "order              5\n" in said
    assert "fold               -\n" in said


def test_columns_are_described_with_unit_and_what_they_hold(tmp_path):
    said = show(residuals(tmp_path), "--describe", width=120).output
    assert ["n", "-", "299", "number", "of", "target", "points"] in table_of(said)
    assert "0 to 4, 6 without" in said
    assert "kinacc_version: 1" in said


def test_a_name_that_is_not_there_is_answered_with_the_nearest(tmp_path):
    measurements(tmp_path / "results" / "arm")
    residuals(tmp_path / "results" / "arm")
    missing = show(tmp_path / "results" / "arm" / "residual")
    assert missing.exit_code == 2
    assert f"did you mean {tmp_path / 'results' / 'arm' / 'residuals'}?" in missing.output
    assert f"did you mean {tmp_path / 'results'}?" in show(tmp_path / "result" / "arm").output
    study = show(tmp_path / "results" / "arm", "study_summary")
    assert "kinacc study makes it" in study.output
    for words, close in ((["--columns", "meen"], "mean"), (["--where", "flod=1"], "fold")):
        said = show(tmp_path / "results" / "arm", "residuals", *words)
        assert said.exit_code == 2
        assert f"did you mean {close}?" in said.output


def test_a_table_looked_for_inside_a_file_is_answered_in_words(tmp_path):
    said = show(residuals(tmp_path), "vec_model")
    assert said.exit_code == 2


def test_results_are_where_one_looks_without_a_word(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    measurements(tmp_path / "results" / "arm")
    assert table_of(show().output)[0][0] == "arm"


def test_joints_printed_as_csv_are_understood_without_their_unit_being_told(tmp_path):
    from kinacc.cli import rows
    from kinacc.kinematics import robot

    measurements(tmp_path)
    path = tmp_path / "joints.csv"
    path.write_text(show(tmp_path, "measurements", "--columns", "pose,q*", "--csv").output)
    read = rows.joints_of(str(path), robot.load("mh180"), {})
    table = store.read(tmp_path / "measurements.parquet")
    expected = np.column_stack([table[f"q{i + 1}"] for i in range(6)])
    np.testing.assert_allclose(read.joints, expected, rtol=1e-11)


def test_a_name_without_its_data_set_is_answered_with_where_there_is_one(tmp_path, monkeypatch):
    residuals(tmp_path / "results" / "arm")
    monkeypatch.chdir(tmp_path)
    said = show("residuals")
    assert said.exit_code == 2
    assert "kinacc show results/arm residuals" in said.output


def test_a_condition_that_no_row_meets_is_answered_with_what_there_is(tmp_path):
    path = residuals(tmp_path)
    said = show(path, "--where", "fold=7")
    assert said.exit_code == 2
    assert "is true of no row; allowed: -, 0, 1, 2, 3, 4" in said.output
    both = show(path, "--where", "quantity=position", "--where", "unit=mrad")
    assert both.exit_code == 2


def test_a_spreadsheet_gets_all_rows_all_digits_and_no_formula(tmp_path):
    measurements(tmp_path, 60, target="=cmd()")
    said = show(tmp_path, "measurements", "--csv").output
    rows = list(csv.DictReader(io.StringIO(said)))
    assert len(rows) == 60
    table = store.read(tmp_path / "measurements.parquet")
    np.testing.assert_allclose([float(r["q1 [rad]"]) for r in rows], table["q1"], rtol=1e-11)
    np.testing.assert_allclose([float(r["x_mm"]) for r in rows], table["x_mm"], rtol=1e-11)
    assert {row["target"] for row in rows} == {"'=cmd()"}
    assert {row["fold"] for row in rows} == {""}
    done = show(tmp_path, "measurements", "--csv", "--out", tmp_path / "table.csv")
    assert done.exit_code == 0
    assert (tmp_path / "table.csv").read_text() == said


def test_a_spreadsheet_gets_no_more_rows_than_were_asked_for(tmp_path):
    measurements(tmp_path, 60)
    words = (tmp_path, "measurements", "--columns", "pose", "--rows")
    assert show(*words, 5, "--csv").output.split() == ["pose", *"01234"]
    assert len(show(*words, "all", "--csv").output.split()) == 61
    rows = json.loads(show(*words, 3, "--json").output)["rows"]
    assert rows == [{"pose": pose} for pose in range(3)]
    out = tmp_path / "few.csv"
    said = show(*words, 2, "--out", out).output
    assert f"2 rows: {out}" in said
    assert out.read_text().split() == ["pose", "0", "1"]
    listed = show(tmp_path / "measurements", "--describe", "--rows", 2, "--csv").output
    assert [line.split(",")[0] for line in listed.splitlines()] == ["column", "pose", "q1"]


def test_a_program_gets_the_same_rows_as_json(tmp_path):
    path = residuals(tmp_path)
    told = json.loads(
        show(path, "--where", "fold=-", "--columns", "comparison,mean", "--json").output
    )
    assert told["rows"][0] == {"comparison": "vec_vs_measured", "mean": 0.25}
    assert len(told["rows"]) == 6
    listed = json.loads(show(tmp_path, "--json").output)
    assert listed["rows"][0]["table"] == "residuals"


def test_a_table_of_another_program_is_shown_and_said_to_be_unknown(tmp_path):
    path = tmp_path / "other.parquet"
    columns = {"when": pa.array([0, 86_400_000_000], pa.timestamp("us")), "ok": [True, None],
               "": [[1, 2], []], "size": [1e300, 2.5], "name": ["a" * 5000, "b"]}  # fmt: skip
    pq.write_table(pa.table(columns), path)
    said = show(path).output
    assert "1970-01-02 00:00:00" in said
    assert "True" in said
    assert "1.0000e+300" in said
    assert max(map(len, said.splitlines())) <= 80
    assert show(path, "--csv").exit_code == 0
    assert show(path, "--json").exit_code == 0


def test_a_table_that_only_has_the_name_of_an_artefact_is_said_to_differ(tmp_path):
    path = tmp_path / "residuals.parquet"
    pq.write_table(pa.table({"comparison": ["a", "b"], "extra": [1.0, 2.0]}), path)
    said = " ".join(show(path).output.split())
    assert "this is no table residuals as kinacc makes it: it lacks subset, fold" in said
    assert "it has extra" in said


@pytest.mark.parametrize("name", ["residuals.parquet", "other.parquet", "notes.txt", "poses.csv"])
def test_a_file_that_is_no_table_is_refused_in_words(tmp_path, name):
    (tmp_path / name).write_bytes(b"PAR1 or not")
    said = show(tmp_path / name)
    assert said.exit_code == 2
    assert "not a readable Parquet file" in said.output or "is not a Parquet file" in said.output


def test_a_damaged_table_does_not_hide_the_others_of_its_folder(tmp_path):
    residuals(tmp_path)
    (tmp_path / "study.parquet").write_bytes(b"half")
    said = show(tmp_path)
    assert said.exit_code == 0


def test_a_folder_without_tables_is_refused_in_words(tmp_path):
    said = show(tmp_path)
    assert said.exit_code == 2
    (tmp_path / "campaign.json").write_text("{}")
    assert f"kinacc campaign report {tmp_path}" in show(tmp_path).output


def test_texts_cannot_control_the_terminal(tmp_path):
    measurements(tmp_path, 3, target="\x1b[2Jtool[red]")
    said = show(tmp_path, "measurements", "--columns", "pose,target").output
    assert "\x1b" not in said
    assert "[2Jtool[red]" in said


def test_a_reader_who_has_seen_enough_is_left_in_peace(tmp_path):
    measurements(tmp_path, 2000)
    shown = shlex.join([sys.executable, "-m", "kinacc", "show", str(tmp_path), "measurements"])
    command = f"{shown} --csv | head -1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True)
    assert done.stdout.startswith("pose,")
    assert done.stderr == ""

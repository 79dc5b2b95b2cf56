"""One stage at a time: what a failure, a warning or a long wait leaves on screen and in the log."""

import time
import warnings
from dataclasses import replace

import numpy as np
import pytest
from recorded import MARKS

from kinacc import progress
from kinacc.artifacts.store import read_metadata, write
from kinacc.errors import InputError, Problem
from kinacc.workflow.plan import planned
from kinacc.workflow.runner import Job, execute, stage_provenance
from kinacc.workflow.stages import error_model, study


def frames(model="vec"):
    columns = {f"{axis}_mm": [0.0] for axis in "xyz"} | {f"q{part}": [0.0] for part in "xyz"}
    return {"model": [model], "frame": ["base"], "qw": [1.0], **columns}


def job(tmp_path, **changes):
    outputs = {name: str(tmp_path / f"{name}.parquet") for name in ("vec_frames", "frames")}
    given = {
        "module": "kinacc.workflow.stages.study",
        "inputs": {},
        "outputs": outputs,
        "settings": {"study": {"alpha": 0.6}},
        "seed": 7,
        "label": "arm study",
        "log": str(tmp_path / "logs" / "study.log"),
    }
    return Job(**(given | changes))


def log_of(tmp_path):
    return (tmp_path / "logs" / "study.log").read_text()


def test_all_tables_are_written_with_the_same_provenance(tmp_path, monkeypatch):
    monkeypatch.setattr(study, "run", lambda i, s: {"vec_frames": frames(), "frames": frames()})
    execute(job(tmp_path))
    marks = read_metadata(tmp_path / "frames.parquet")
    assert marks == read_metadata(tmp_path / "vec_frames.parquet")
    assert marks["seed"] == "7"
    assert log_of(tmp_path) == ""


def test_a_failing_stage_leaves_its_traceback_in_the_log_and_on_screen(
    tmp_path, monkeypatch, capsys
):
    def run(inputs, settings):
        raise ZeroDivisionError("no poses at all")

    monkeypatch.setattr(study, "run", run)
    with pytest.raises(SystemExit) as left:
        execute(job(tmp_path))
    assert left.value.code == 1
    for text in (log_of(tmp_path), capsys.readouterr().err):
        assert "arm study failed" in text
        assert "ZeroDivisionError: no poses at all" in text
        assert "Traceback" in text
    assert [path.name for path in tmp_path.iterdir()] == ["logs"]


def test_bad_input_is_listed_without_a_traceback(tmp_path, monkeypatch, capsys):
    def run(inputs, settings):
        raise InputError([Problem("row 3", "q1 is NaN"), Problem("row 9", "q2 is NaN")])

    monkeypatch.setattr(study, "run", run)
    with pytest.raises(SystemExit):
        execute(job(tmp_path))
    for text in (log_of(tmp_path), capsys.readouterr().err):
        assert "row 3: q1 is NaN" in text
        assert "row 9: q2 is NaN" in text
        assert "Traceback" not in text


def test_no_table_appears_when_the_last_one_breaks_the_contract(tmp_path, monkeypatch):
    tables = {"vec_frames": frames(), "frames": frames() | {"x_mm": [np.inf]}}
    monkeypatch.setattr(study, "run", lambda i, s: tables)
    with pytest.raises(SystemExit):
        execute(job(tmp_path))
    assert "x_mm" in log_of(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["logs"]


def test_a_stage_that_makes_something_else_than_the_catalogue_says_fails(tmp_path, monkeypatch):
    monkeypatch.setattr(study, "run", lambda i, s: {"frames": frames()})
    with pytest.raises(SystemExit):
        execute(job(tmp_path))
    assert "the catalogue says frames, vec_frames" in log_of(tmp_path)


def test_a_warning_is_on_screen_and_in_the_log(tmp_path, monkeypatch, capsys):
    def run(inputs, settings):
        warnings.warn("joint 4 was hardly moved", stacklevel=1)
        return {"vec_frames": frames(), "frames": frames()}

    monkeypatch.setattr(study, "run", run)
    execute(job(tmp_path))
    assert "joint 4 was hardly moved" in log_of(tmp_path)
    assert "joint 4 was hardly moved" in capsys.readouterr().err


def test_parts_of_one_run_count_as_one_input_however_many_there_are(tmp_path):
    hashes = set()
    for count in (1, 2, 3):
        parts = [str(tmp_path / f"{number}-of-{count}.parquet") for number in range(count)]
        rows = np.array(["dh", "nominal", "vec"])
        for number, path in enumerate(parts):
            columns = [frames(model) for model in rows[number::count]]
            whole = {name: [each[name][0] for each in columns] for name in columns[0]}
            write(path, "frames", whole, MARKS)
        hashes.add(stage_provenance(job(tmp_path, inputs={"frames": parts}))["inputs_hash"])
    assert len(hashes) == 1


def test_parts_of_different_runs_are_refused(tmp_path):
    parts = [str(tmp_path / "1.parquet"), str(tmp_path / "2.parquet")]
    write(parts[0], "frames", frames(), MARKS)
    write(parts[1], "frames", frames(), MARKS | {"code_hash": "older"})
    with pytest.raises(InputError, match="parts of frames made from 2 different states"):
        stage_provenance(job(tmp_path, inputs={"frames": parts}))


@pytest.fixture
def made(tmp_path, monkeypatch):
    """Two tables as a stage left them in the folder of a data set, with its record."""
    folder = tmp_path / "arm"
    outputs = {name: str(folder / f"{name}.parquet") for name in ("frames", "dh_model")}
    monkeypatch.setattr(study, "run", lambda i, s: {"frames": frames(), "dh_model": dh_model()})
    given = {"outputs": outputs, "stage": "dh", "record": f"{folder}/records/dh.json"}
    execute(job(tmp_path, **given))
    return folder


def dh_model():
    names = ("theta_offset_rad", "d_mm", "a_mm", "alpha_rad", "beta_rad")
    columns = {name: [0.0] for name in names} | {f"std_{name}": [0.1] for name in names}
    return {"joint": [1], **columns}


def flipped(folder):
    path = folder / "frames.parquet"
    content = bytearray(path.read_bytes())
    content[len(content) // 3] ^= 4
    path.write_bytes(content)


def of_another_run_with_its_digest(folder):
    write(folder / "frames.parquet", "frames", frames("nominal"), MARKS)


def of_a_run_that_did_not_end(folder):
    (folder / "records" / "dh.json").unlink()


def with_a_record_cut_off(folder):
    path = folder / "records" / "dh.json"
    path.write_bytes(path.read_bytes()[:100])


@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (flipped, "frames.parquet: "),
        (of_another_run_with_its_digest, "is not the file that stage dh wrote"),
        (of_a_run_that_did_not_end, "its run did not come to its end"),
        (with_a_record_cut_off, "dh.json: is no record of a stage"),
    ],
)
def test_the_next_stage_refuses_a_table_by_name_with_the_command_that_makes_it(
    made, tmp_path, monkeypatch, capsys, harm, words
):
    inputs = {"frames": str(made / "frames.parquet"), "dh_model": str(made / "dh_model.parquet")}
    again = "snakemake -c2 --configfile 'my arm.yaml' --forcerun {file}{target}"
    monkeypatch.setattr(study, "run", lambda i, s: {"vec_frames": frames(), "frames": frames()})
    execute(job(tmp_path, inputs=inputs, remake=again))
    assert capsys.readouterr().err == ""
    harm(made)
    with pytest.raises(SystemExit):
        execute(job(tmp_path, inputs=inputs, remake=again))
    said = capsys.readouterr().err
    assert words in said
    assert "make it again: snakemake -c2 --configfile 'my arm.yaml' --forcerun " in said
    assert str(made / "frames.parquet") in said
    assert "Traceback" not in said


def test_a_long_stage_says_how_far_it_is_and_a_short_one_nothing(monkeypatch, capsys):
    monkeypatch.setattr(progress, "QUIET_S", 0.05)
    with progress.reporting("arm study") as report:
        for item in report(range(2), "simulations"):
            time.sleep(0.1 if item else 0.0)
    assert "arm study: 1 of 2 simulations" in capsys.readouterr().err
    with progress.reporting("arm study"):
        pass
    assert capsys.readouterr().err == ""


def test_a_long_fit_says_what_is_being_done_and_no_name_of_the_programs(
    tmp_path, monkeypatch, capsys
):
    def run(inputs, settings, progress, kind):
        for item in progress(range(2), "orders and priors of the VEC model tried"):
            time.sleep(0.1 if item else 0.0)
        return {}

    (tmp_path / "small.yaml").write_text("datasets: {cell: {robot: mh180}}\n")
    planned_job = planned([tmp_path / "small.yaml"]).job("vec", "cell")
    monkeypatch.setattr(progress, "QUIET_S", 0.05)
    monkeypatch.setattr(error_model, "run", run)
    execute(replace(planned_job, inputs={}, outputs={}, log=None))
    said = capsys.readouterr().err.splitlines()[0]
    assert said.startswith("cell: fitting the volumetric error compensation (VEC) model")
    assert "1 of 2 orders and priors" in said

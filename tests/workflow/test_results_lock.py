"""Two runs in one results folder, runs that were killed, and jobs that outlive them."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import signal
import subprocess
import sys
import threading
from contextlib import ExitStack
from pathlib import Path

import pytest
from click.testing import CliRunner

from kinacc.artifacts import records
from kinacc.cli.group import main
from kinacc.workflow import results_lock
from kinacc.workflow.results_lock import RUN, InUse, joined, running, sharing

HOLD = """\
import sys, time
from kinacc.workflow.results_lock import RUN, joined, running, sharing
with {how}:
    import os
    print(os.environ.get(RUN, "held"), flush=True)
    time.sleep(60)
"""


@pytest.fixture
def hold(tmp_path):
    """Start a process that holds the folder until it is killed; gives it and what it printed."""
    with ExitStack() as ended:

        def start(how: str, **more: str) -> tuple[subprocess.Popen, str]:
            begun = HOLD.format(how=how.replace("FOLDER", repr(str(tmp_path))))
            process = subprocess.Popen(
                [sys.executable, "-c", begun, "--cores", "2"],
                env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)} | more,
                stdout=subprocess.PIPE,
                text=True,
            )
            ended.callback(process.wait)
            ended.callback(process.kill)
            return process, process.stdout.readline().strip()

        yield start


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr(results_lock, "_PATIENCE_S", 0.1)


def test_a_second_run_is_refused_in_a_line_that_names_the_first(tmp_path, hold):
    first, _ = hold("running(FOLDER)")
    with pytest.raises(InUse) as refused, running(tmp_path):
        pass
    said = str(refused.value)
    assert "\n" not in said
    for part in (str(tmp_path), "--cores 2", f"process {first.pid} on {os.uname().nodename}"):
        assert part in said


def test_a_run_after_one_that_was_killed_needs_nothing_by_hand(tmp_path, hold):
    first, _ = hold("running(FOLDER)")
    half = tmp_path / "mh180" / ".vec_model.parquet.another-machine.7.0123abcd.partial"
    half.parent.mkdir()
    half.write_text("half")
    first.kill()
    first.wait()
    with running(tmp_path):
        assert not half.exists()
    assert [path.stat().st_size for path in tmp_path.glob(".lock*")] == [0, 0]


def test_jobs_of_a_run_that_was_killed_keep_the_next_one_waiting(tmp_path, hold):
    first, number = hold("running(FOLDER)")
    job, _ = hold("joined()", **{RUN: number})
    first.kill()
    first.wait()
    told = []

    def tell(words: str) -> None:
        told.append(words)
        threading.Timer(0.2, job.kill).start()

    with running(tmp_path, tell):
        assert job.wait() == -signal.SIGKILL
    assert len(told) == 1
    assert "waiting for jobs" in told[0]


def test_a_job_that_begins_after_its_run_was_killed_does_nothing(tmp_path, hold, monkeypatch):
    first, number = hold("running(FOLDER)")
    first.kill()
    first.wait()
    hold("running(FOLDER)")
    monkeypatch.setenv(RUN, number)
    with pytest.raises(InUse, match="another one began"), joined():
        pass


def test_parts_are_made_side_by_side_but_not_beside_a_run(tmp_path, hold):
    part, _ = hold("sharing(FOLDER)")
    with sharing(tmp_path):
        pass
    with pytest.raises(InUse, match="single parts"), running(tmp_path):
        pass
    part.kill()
    part.wait()
    hold("running(FOLDER)")
    with pytest.raises(InUse, match="another run"), sharing(tmp_path):
        pass


def test_a_file_system_without_locks_is_told_of_and_used(tmp_path, monkeypatch):
    def flock(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", flock)
    told = []
    with running(tmp_path, told.append):
        (tmp_path / "made").touch()
    assert len(told) == 1
    assert "no locks" in told[0]


def test_a_folder_that_cannot_be_written_is_told_of_in_a_line(tmp_path):
    (tmp_path / "results").write_text("a file")
    with (
        pytest.raises(Exception, match="cannot be written") as refused,
        running(tmp_path / "results"),
    ):
        pass
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("how", ["zeros", "cut off", "empty record"])
def test_a_file_that_a_loss_of_power_tore_is_made_anew(tmp_path, how):
    folder, marks = tmp_path / "mh180", {"seed": "1"}
    for stage in ("measurements", "vec"):
        record = records.Record(stage, None, marks, {}, {})
        path = folder / f"{'vec_model' if stage == 'vec' else stage}.parquet"
        records.leave(records.place(folder, stage), record, {str(path): (b"whole", None)})
    torn, place = folder / "vec_model.parquet", Path(records.place(folder, "vec"))
    before = torn.stat()
    if how == "empty record":
        place.write_bytes(b"")
    else:
        torn.write_bytes(bytes(5) if how == "zeros" else b"who")
    os.utime(torn, ns=(before.st_atime_ns, before.st_mtime_ns))  # Snakemake goes by times
    told = []
    with running(tmp_path, told.append):  # the last one came to its end: nothing is looked at
        assert place.exists()
    (tmp_path / ".lock").write_text("{}")
    with running(tmp_path, told.append):
        names = {path.name for path in folder.rglob("*") if path.is_file()}
    assert names == {"measurements.json", "measurements.parquet"}
    assert len(told) == 1
    assert "made anew" in told[0]


def test_a_record_made_up_by_a_stranger_removes_nothing_elsewhere(tmp_path):
    keep, place = tmp_path / "keep", tmp_path / "results" / "mh180" / "records" / "vec.json"
    keep.touch()
    place.parent.mkdir(parents=True)
    files = {name: {"sha256": ""} for name in ("../../keep", str(keep))}
    told = {"stage": "vec", "part": None, "marks": {}, "inputs_digests": {}, "files": files}
    place.write_text(json.dumps(told))
    (tmp_path / "results" / ".lock").write_text("{}")
    with running(tmp_path / "results", print):
        assert not place.exists()
    assert keep.exists()


@pytest.mark.parametrize("folder", ["", "mh180"])
def test_a_check_while_a_run_writes_says_so_and_finds_nothing_amiss(tmp_path, hold, folder):
    (tmp_path / "mh180").mkdir()
    first, _ = hold("running(FOLDER)")
    done = CliRunner().invoke(main, ["check-results", str(tmp_path / folder)])
    assert done.exit_code == 1
    assert f"process {first.pid} on" in done.output
    assert done.output.count("\n") == 1

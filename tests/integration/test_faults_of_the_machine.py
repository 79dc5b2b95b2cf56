"""A run that is killed, stopped, started twice, or whose disk fills; a table that is corrupted."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from command_line import call
from whole_project import PARTS, ROOT, write_poses

RUN = ("snakemake", "-c1", "--nocolor", "--configfile", "config.yaml", "small.yaml", "--")
FIT = (*RUN, "results/own/vec_model.parquet")
CALIBRATE = ("kinacc", "calibrate", "config.yaml", "small.yaml", "--cores", "1")
FIRST = "results/own/measurements.parquet"


@pytest.fixture
def fresh(project) -> tuple[Path, dict[str, bytes]]:
    """A project without results, and the tables of an undisturbed run of its fit."""
    folder = project.folder
    names = ("measurements", "vec_model", "vec_frames", "vec_covariance", "vec_fit")
    wanted = {name: (folder / f"results/own/{name}.parquet").read_bytes() for name in names}
    shutil.rmtree(folder / "results")
    shutil.rmtree(folder / ".snakemake")
    return folder, wanted


def started(folder: Path, words: tuple[str, ...], **more) -> subprocess.Popen:
    """A command in a process group of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", *words],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder / "src")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        **more,
    )


def ended(folder: Path, words: tuple[str, ...], **more) -> tuple[int, str]:
    """Exit code and output of a command."""
    process = started(folder, words, **more)
    text, _ = process.communicate(timeout=300)
    return process.returncode, text


def until(there: Callable[[], bool], process: subprocess.Popen) -> None:
    for _ in range(6000):
        if there():
            return
        assert process.poll() is None, process.communicate()[0]
        time.sleep(0.01)
    raise AssertionError("nothing happened in a minute")


def tables(folder: Path, wanted: dict[str, bytes]) -> dict[str, bytes]:
    return {name: (folder / f"results/own/{name}.parquet").read_bytes() for name in wanted}


def half_written(folder: Path) -> list[Path]:
    return [*folder.rglob("*.partial")]


def test_a_run_killed_with_all_its_processes_is_continued_by_the_same_command(fresh):
    folder, wanted = fresh
    for name in ("results/.lock", FIRST, "results/own/logs/fit_vec.log"):
        run = started(folder, FIT)
        until((folder / name).exists, run)
        os.killpg(run.pid, signal.SIGKILL)
        run.communicate()
    code, text = ended(folder, FIT)
    assert code == 0, text
    assert tables(folder, wanted) == wanted
    assert not half_written(folder)


@pytest.mark.parametrize(
    ("words", "by", "code", "limit_s"),
    [
        (FIT, signal.SIGINT, 1, 60.0),  # Snakemake waits for a job that it is just beginning
        (CALIBRATE, signal.SIGINT, 130, 3.0),
        (CALIBRATE, signal.SIGTERM, 143, 3.0),
    ],
)
def test_a_run_that_is_stopped_ends_soon_and_can_go_on(fresh, words, by, code, limit_s):
    folder, wanted = fresh
    run = started(folder, words)
    until((folder / FIRST).exists, run)
    began = time.monotonic()
    os.killpg(run.pid, by)
    text, _ = run.communicate(timeout=60)  # when all processes that write to it have ended
    assert run.returncode == code, text
    assert time.monotonic() - began < limit_s
    assert (folder / FIRST).read_bytes() == wanted["measurements"]
    again, text = ended(folder, FIT)  # the others calibrate two arms
    assert again == 0, text
    assert tables(folder, wanted) == wanted
    assert not half_written(folder)


def test_a_second_run_is_refused_while_the_first_goes_on(fresh):
    folder, wanted = fresh
    first = started(folder, FIT)
    until((folder / FIRST).exists, first)
    os.killpg(first.pid, signal.SIGSTOP)
    try:
        for words in (FIT, ("kinacc", "calibrate", "small.yaml")):
            code, text = ended(folder, words)
            assert code == 1, text
            assert "another run holds results" in text
            assert "Traceback" not in text
        assert ended(folder, (*RUN[:-1], "--dry-run", *FIT[-2:]))[0] == 0
    finally:
        os.killpg(first.pid, signal.SIGCONT)
    text, _ = first.communicate(timeout=300)
    assert first.returncode == 0, text
    assert tables(folder, wanted) == wanted


def test_a_stage_whose_disk_fills_leaves_nothing_half_written_and_is_continued(fresh):
    folder, wanted = fresh
    code, text = ended(folder, (*RUN, FIRST, "results/own/data_check.parquet"))
    assert code == 0, text
    script = folder / "workflow/scripts/fit_vec.py"
    good = script.read_text()
    full = "import resource\n\nresource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
    script.write_text(full + good)
    code, text = ended(folder, FIT)
    assert code == 1, text
    assert "own fit_vec: results/own/vec_model.parquet: cannot be written: file too" in text
    assert "Traceback" not in text
    assert not [*folder.glob("results/own/vec*.parquet")]
    assert not half_written(folder)
    script.write_text(good)
    code, text = ended(folder, FIT)
    assert code == 0, text
    assert tables(folder, wanted) == wanted


@pytest.mark.parametrize(("full", "expected"), [(True, 1), (False, 141)])
def test_output_on_a_full_disk_and_output_that_nobody_reads(finished, full, expected):
    reader, nobody = os.pipe()
    os.close(reader)
    with open("/dev/full", "w") if full else os.fdopen(nobody, "w") as output:
        done = subprocess.run(
            [sys.executable, "-m", "kinacc", "show", "results/own", "measurements"],
            cwd=finished.folder,
            stdout=output,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == expected
    assert done.stderr.lower().count("no space left on device") == done.stderr.count("\n") == full


def _bit_turned(path: Path) -> None:
    good = path.read_bytes()
    middle = len(good) // 2
    path.write_bytes(good[:middle] + bytes([good[middle] ^ 1]) + good[middle + 1 :])


def _edited(path: Path) -> None:
    pq.write_table(pq.read_table(path).slice(1), path)


@pytest.mark.parametrize("spoil", [_bit_turned, _edited])
def test_a_spoiled_table_is_refused_by_the_next_stage_and_made_again(project, spoil):
    folder = project.folder
    path = folder / FIRST
    good = path.read_bytes()
    spoil(path)
    code, text = ended(folder, FIT)
    assert code == 1, text
    said = re.search(rf"own (\w+): .*{FIRST}: changed since .*rm {FIRST}", text, re.S)
    assert said, text
    assert "Traceback" not in text
    assert "Traceback" in (folder / f"results/own/logs/{said[1]}.log").read_text()
    done = call("check-results", folder / "results/own")
    assert done.exit_code == 1
    assert "measurements.parquet" in done.output
    path.unlink()
    code, text = ended(folder, (*RUN, FIRST))
    assert code == 0, text
    assert path.read_bytes() == good


def test_a_clone_in_a_folder_with_odd_letters_runs_and_braces_in_a_file_are_refused(tmp_path):
    clone = tmp_path / "a clone of 'ours' \"$HOME\" größe"
    clone.mkdir()
    for name in PARTS:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, clone / name)
    write_poses(clone / "poses.csv")
    words = ("kinacc", "init", "poses.csv", "--robot", "mh180", "--yes", "--name", "own")
    assert ended(clone, words)[0] == 0
    run = ("snakemake", "-c1", "--configfile", "own.yaml", "--", FIRST)
    code, text = ended(clone, run)
    assert code == 0, text
    assert (clone / FIRST).is_file()
    (clone / "{data}").mkdir()
    (clone / "poses.csv").rename(clone / "{data}/poses.csv")
    path = clone / "own.yaml"
    path.write_text(path.read_text().replace("path: poses.csv", 'path: "{data}/poses.csv"'))
    code, text = ended(clone, ("kinacc", "calibrate", "own.yaml"))
    assert code == 2
    assert "{data}/poses.csv" in text
    assert "Traceback" not in text
    braces = clone.rename(tmp_path / "a {dataset}")
    code, text = ended(braces, ("snakemake", "-n"))
    assert code == 1, text
    assert "braces in its name" in text
    assert "Traceback" not in text

"""A run that is killed, stopped, started twice, or whose disk fills; a table that is corrupted."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Iterable
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from command_line import call
from preloaded import python
from whole_project import Project, copy, write_poses

RUN = ("snakemake", "-c1", "--nocolor", "--configfile", "config.yaml", "small.yaml", "--")
FIT = (*RUN, "results/own/vec_model.parquet")
BOTH = (*RUN, "calibration")
CALIBRATE = ("kinacc", "calibrate", "small.yaml", "--cores", "1")
FIRST, LOG = "results/own/measurements.parquet", "results/own/logs/fit_vec.log"
FITTED = ("vec_model", "vec_frames", "vec_covariance", "vec_fit")


@pytest.fixture
def unfitted(project) -> tuple[Path, dict[str, bytes]]:
    """A project whose VEC model is to be fitted again, and its tables as they were."""
    wanted = tables(project.folder, FITTED)
    forget_fit(project.folder)
    return project.folder, wanted


def forget_fit(folder: Path) -> None:
    """Remove the tables of the fit and its log, as far as they are there."""
    for name in (*(f"results/own/{name}.parquet" for name in FITTED), LOG):
        (folder / name).unlink(missing_ok=True)


def started(folder: Path, words: tuple[str, ...]) -> subprocess.Popen:
    """A command in a process group of its own."""
    return subprocess.Popen(
        [python(), "-m", *words],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder / "src")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        process_group=0,
    )


def ended(folder: Path, words: tuple[str, ...], code: int = 0) -> str:
    """Output of a command that ends with ``code``, without a traceback."""
    text = Project(folder).run([python(), "-m", *words], code)
    assert "Traceback" not in text
    return text


def until(path: Path, process: subprocess.Popen) -> None:
    """Wait for a file that a command writes."""
    for _ in range(6000):
        if path.exists():
            return
        assert process.poll() is None, process.communicate()[0]
        time.sleep(0.01)
    raise AssertionError("nothing happened in a minute")


def tables(folder: Path, names: Iterable[str]) -> dict[str, bytes]:
    """Tables of the data set that are there, by name."""
    paths = {name: folder / f"results/own/{name}.parquet" for name in names}
    return {name: path.read_bytes() for name, path in paths.items() if path.exists()}


def test_a_run_killed_or_stopped_at_any_moment_is_continued_by_the_same_command(project):
    folder = project.folder
    wanted = tables(folder, ["measurements", *FITTED])
    for name in ("results", ".snakemake"):
        shutil.rmtree(folder / name)
    for words, moment, by, code, limit_s in (
        (FIT, "results/.lock", signal.SIGKILL, -9, 60.0),  # before the first stage
        (FIT, FIRST, signal.SIGKILL, -9, 60.0),  # between two stages
        (FIT, LOG, signal.SIGKILL, -9, 60.0),  # within one
        (CALIBRATE, LOG, signal.SIGINT, 130, 3.0),
        (CALIBRATE, LOG, signal.SIGTERM, 143, 3.0),
        (CALIBRATE, LOG, signal.SIGKILL, -9, 3.0),
        (BOTH, LOG, signal.SIGINT, 1, 60.0),  # Snakemake waits for a job that it is just beginning
    ):
        forget_fit(folder)
        run = started(folder, words)
        until(folder / moment, run)
        began = time.monotonic()
        os.killpg(run.pid, by)
        text, _ = run.communicate(timeout=60)  # when all processes that write to it have ended
        assert run.returncode == code, text
        assert time.monotonic() - began < limit_s
        assert tables(folder, wanted).items() <= wanted.items()
    assert (folder / FIRST).exists()
    assert not (folder / "results/own/summary.parquet").exists()  # no run went on unseen
    ended(folder, FIT)
    assert tables(folder, wanted) == wanted
    assert not [*folder.rglob("*.partial")]


def test_a_second_run_is_refused_while_the_first_goes_on(unfitted):
    folder, wanted = unfitted
    first = started(folder, FIT)
    until(folder / LOG, first)
    os.killpg(first.pid, signal.SIGSTOP)
    try:
        for words in (FIT, CALIBRATE):
            assert "another run holds results" in ended(folder, words, 1)
        ended(folder, (*RUN[:-1], "--dry-run", *FIT[-2:]))
    finally:
        os.killpg(first.pid, signal.SIGCONT)
    text, _ = first.communicate(timeout=300)
    assert first.returncode == 0, text
    assert tables(folder, wanted) == wanted


def test_a_stage_whose_disk_fills_leaves_nothing_half_written_and_is_continued(unfitted):
    folder, wanted = unfitted
    script = folder / "workflow/scripts/fit_model.py"
    good = script.read_text()
    full = "import resource\n\nresource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
    script.write_text(full + good)
    text = ended(folder, FIT, 1)
    assert "own fit_vec: results/own/vec_model.parquet: cannot be written: file too" in text
    assert not tables(folder, wanted)
    assert not [*folder.rglob("*.partial")]
    script.write_text(good)
    ended(folder, FIT)
    assert tables(folder, wanted) == wanted


@pytest.mark.parametrize(("full", "expected"), [(True, 1), (False, 141)])
def test_output_on_a_full_disk_and_output_that_nobody_reads(finished, full, expected):
    reader, nobody = os.pipe()
    os.close(reader)
    with open("/dev/full", "w") if full else os.fdopen(nobody, "w") as output:
        done = subprocess.run(
            [python(), "-m", "kinacc", "show", "results/own", "measurements"],
            cwd=finished.folder,
            stdout=output,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == expected
    assert done.stderr.lower().count("no space left on device") == done.stderr.count("\n") == full


def test_a_table_that_was_edited_is_refused_by_the_next_stage_and_made_again(project):
    folder = project.folder
    path = folder / FIRST
    good = path.read_bytes()
    pq.write_table(pq.read_table(path).slice(1), path)
    text = ended(folder, FIT, 1)
    said = re.search(rf"own (\w+): .*{FIRST}: changed since .*rm {FIRST}", text, re.S)
    assert said, text
    assert "Traceback" in (folder / f"results/own/logs/{said[1]}.log").read_text()
    done = call("check-results", folder / "results/own", code=1)
    assert "measurements.parquet" in done.output
    path.unlink()
    ended(folder, (*RUN, FIRST))
    assert path.read_bytes() == good


def test_a_clone_in_a_folder_with_odd_letters_runs_and_braces_in_a_file_are_refused(tmp_path):
    clone = tmp_path / "a clone of 'ours' \"$HOME\" größe"
    copy(clone)
    write_poses(clone / "poses.csv")
    ended(clone, ("kinacc", "init", "poses.csv", "--robot", "mh180", "--name", "own"))
    ended(clone, ("snakemake", "-c1", "--configfile", "own.yaml", "--", FIRST))
    assert (clone / FIRST).is_file()
    (clone / "{data}").mkdir()
    (clone / "poses.csv").rename(clone / "{data}/poses.csv")
    path = clone / "own.yaml"
    path.write_text(path.read_text().replace("path: poses.csv", 'path: "{data}/poses.csv"'))
    assert "{data}/poses.csv" in ended(clone, ("kinacc", "calibrate", "own.yaml"), 2)
    braces = clone.rename(tmp_path / "a {dataset}")
    assert "braces in its name" in ended(braces, ("snakemake", "-n"), 1)

"""Killed, interrupted and run twice at once: a few cases of what kill_runs.py does by dozens."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from pathlib import Path

import pytest
from kill_runs import KINACC, SNAKEMAKE, Place, faults, killed
from whole_project import finished, project

__all__ = ["finished", "project"]

_CONFIGS = ("--configfile", "config.yaml", "small.yaml")
# A stage of two tables, so that there is something between its renames.
_TABLES = ("measurements.parquet", "robot.parquet")
_RUN = (*SNAKEMAKE, "-c1", *_CONFIGS, "--", "results/own/measurements.parquet")
_STAGE = (*KINACC, "run", "measurements", "--config", "config.yaml", "--config", "small.yaml")
_STOPPED = "stopped; what is finished is kept, and the same command goes on from there\n"


@pytest.fixture
def place(project) -> tuple[Place, dict[str, str]]:
    """A project in which nothing has been run, and what the run makes where nobody disturbs it."""
    there = project.digests()
    wanted = {name: there[f"own/{name}"] for name in _TABLES}
    subprocess.run(["rm", "-r", "results", ".snakemake"], cwd=project.folder, check=True)
    return Place(project.folder), wanted


def check(place: Place, wanted: dict[str, str], command: tuple[str, ...]) -> None:
    """Start a command again, and hold what is there to an undisturbed run."""
    found = faults(place, command, {})
    assert not [each for each in found if not each.startswith("differs: ")]
    there = place.digests()
    assert {name: there[f"own/{name}"] for name in _TABLES} == wanted


def test_the_same_command_again_ends_as_if_nothing_had_happened(place):
    assert killed(place[0], _RUN, "finished 1")
    check(*place, _RUN)


@pytest.mark.parametrize("at", ["half 1", "renamed 1"])
def test_a_stage_by_hand_that_was_killed_within_or_between_its_tables(place, at):
    command = (*_STAGE, "--dataset", "own")
    assert killed(place[0], command, at)
    check(*place, command)


@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM], ids=["Ctrl-C", "SIGTERM"])
def test_a_run_that_is_stopped_says_so_in_a_line(place, by):
    here, _ = place
    command = (*SNAKEMAKE, "-c1", *_CONFIGS, "--", "own_vec")
    log = here.project / "results" / "own" / "logs" / "vec.log"
    run = subprocess.Popen(
        command,
        cwd=here.project,
        env=here.environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    until(lambda: run.poll() is not None or log.exists())
    if by == signal.SIGINT:  # as a terminal does
        os.killpg(run.pid, by)
    else:
        run.send_signal(by)
    said = run.communicate(timeout=60)[1]
    lines = [line for line in said.splitlines(keepends=True) if " so far" not in line]
    assert (run.returncode, lines[-1:]) == (128 + by, [_STOPPED])
    assert "Traceback" not in said
    assert (here.project / "results" / "own" / _TABLES[0]).exists()
    assert not [each for each in here.left() if "/incomplete/" not in each]


def until(seen) -> None:
    for _ in range(600):
        if seen():
            return
        time.sleep(0.1)
    raise AssertionError("nothing happened")


def test_a_second_run_and_a_dry_run_beside_the_first(place):
    here, _ = place
    holds = (
        "from kinacc.workflow.results_lock import running\n"
        "with running('results'): print(flush=True); input()\n"
    )
    first = subprocess.Popen(
        [KINACC[0], "-c", holds],
        cwd=here.project,
        env=here.environment(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    first.stdout.readline()
    options = {"cwd": here.project, "env": here.environment(), "text": True, "capture_output": True}
    for command in (_RUN, (*KINACC, "calibrate", "small.yaml")):
        second = subprocess.run(command, **options, check=False)
        by_snakemake = ("Using workflow specific profile", "own: ")
        said = [line for line in second.stderr.splitlines() if not line.startswith(by_snakemake)]
        assert second.returncode == 1
        assert "another run is at work in it" in said[-1]
        assert len(said) == 1
    dry = subprocess.run([*_RUN[:-2], "--dry-run", *_RUN[-2:]], **options, check=False)
    assert dry.returncode == 0, dry.stderr
    assert not [*Path(here.project, "results").glob("*/*.parquet")]
    first.communicate(b"\n")
    assert not here.left()


def test_other_settings_are_noticed_where_snakemake_knows_nothing_of_a_file(project):
    """As where the machine that submitted was lost, and its jobs went on."""
    subprocess.run(["rm", "-r", ".snakemake"], cwd=project.folder, check=True)
    before = project.digests()
    project.snakemake("results/own/histories.parquet")
    assert project.digests() == before
    subprocess.run(["rm", "-r", ".snakemake"], cwd=project.folder, check=True)
    project.configure("histories: {noise_mm: 0.2}")
    project.snakemake("results/own/histories.parquet")
    differ = {name for name, digest in project.digests().items() if digest != before.get(name)}
    assert differ == {"own/histories.parquet", "own/records/histories.json"}

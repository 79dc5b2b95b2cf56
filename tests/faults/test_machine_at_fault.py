"""A machine that is at fault: what commands say, leave and do then; small sizes of this folder."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
from command_line import call

from kinacc.kinematics import robot

HERE = Path(__file__).parent


@cache
def _apart() -> tuple[str, ...]:
    """What starts a process with mounts of its own; empty where that is not allowed."""
    for options in (("-m",), ("-rm",)):
        words = ("unshare", *options)
        trial = (*words, "mount", "-t", "tmpfs", "none", "/mnt")
        if shutil.which("unshare") and not subprocess.run(trial, capture_output=True).returncode:
            return words
    return ()


def held(tool: str, *options: str) -> str:
    """What a tool of this folder prints; fails the test where it finds anything."""
    if not _apart():
        pytest.skip("mounting a small disk is not allowed here")
    command = [*_apart(), sys.executable, str(HERE / tool), *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_disk_that_is_full_or_closed_and_output_that_goes_nowhere_are_told_in_a_line():
    told = json.loads(held("matrix.py", "--smoke", "--json"))
    assert told["found"] == {}
    assert told["cases"] == 50


def test_a_run_on_a_disk_that_fills_is_carried_on_when_there_is_room():
    assert "1 moments, 0 not as promised" in held("filling.py", "--stages", "--moments", "1")


def test_ctrl_c_is_told_in_a_line_where_it_finds_a_library_that_makes_an_error_of_it(monkeypatch):
    def load(*_: object) -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise ImportError("numpy.core.multiarray failed to import") from None

    monkeypatch.setattr(robot, "load", load)
    done = call("plan-poses", "ur10")
    assert (done.exit_code, done.output) == (130, "stopped\n")

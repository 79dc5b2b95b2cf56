"""Ctrl-C, a signal from the system and a lack of memory: told in a line, nothing left behind."""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from recorded import write

from kinacc.artifacts.store import read
from kinacc.cli.group import main

_SOON_S = 4.0
_PATIENCE_S = 120.0
_PARTS = 40
MARKS = {"kinacc_version": "0", "config_hash": "", "code_hash": "", "inputs_hash": "", "seed": 1}


@pytest.fixture
def results(tmp_path) -> Path:
    """A results folder with the points of the paper's arm."""
    rng = np.random.default_rng(2)
    error = 0.3 * rng.normal(size=(60, 3))
    points = {"point": np.arange(60)}
    points |= {f"q{j}": rng.uniform(-0.5, 0.5, 60) for j in range(1, 7)}
    points |= {f"s{j}": np.zeros(60) for j in range(1, 7)}
    points |= {f"e{axis}_mm": error[:, i] for i, axis in enumerate("xyz")}
    points["true_error_mm"] = np.linalg.norm(error, axis=1)
    write(tmp_path / "mh180" / "assessment_points.parquet", "assessment_points", points, MARKS)
    return tmp_path


class Started:
    """A tournament as a person starts it, in a process group of its own."""

    def __init__(self, results: Path, cores: int, parts: int = _PARTS) -> None:
        command = [sys.executable, "-m", "kinacc", "tournament", "--results", str(results)]
        command += ["--cores", str(cores), "--parts", str(parts), "--noise-mm", "0.1"]
        if parts == _PARTS:
            command += ["--assessor", "maximum", "--assessor", "model_invalidation"]
        self.process = subprocess.Popen(
            command, stderr=subprocess.PIPE, text=True, start_new_session=True
        )
        self.lines: queue.Queue[str | None] = queue.Queue()
        self.said: list[str] = []
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self) -> None:
        for line in self.process.stderr:
            self.said.append(line)
            self.lines.put(line)
        self.lines.put(None)

    def until(self, *words: str) -> None:
        """Wait for a line that holds all the words."""
        while (line := self.lines.get(timeout=_PATIENCE_S)) is not None:
            if all(word in line for word in words):
                return
        raise AssertionError(f"{words} not in {self.said}")

    def stop(self, how: signal.Signals, everyone: bool) -> int:
        """Exit code after a signal; fails where a process of the group is left."""
        (os.killpg if everyone else os.kill)(self.process.pid, how)
        code = self.process.wait(_SOON_S)
        self.reader.join(_SOON_S)
        with pytest.raises(ProcessLookupError):
            os.killpg(self.process.pid, 0)
        return code

    def give_up(self) -> None:
        """End whatever a failed test has left."""
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


@pytest.mark.parametrize(
    ("how", "everyone", "code"),
    [(signal.SIGINT, True, 130), (signal.SIGINT, False, 130), (signal.SIGTERM, False, 143)],
    ids=["Ctrl-C", "SIGINT to the command alone", "SIGTERM"],
)
def test_a_tournament_stops_at_once_and_keeps_what_is_done(results, how, everyone, code):
    started = Started(results, 2)
    try:
        started.until("done, 2 of")
        assert started.stop(how, everyone) == code
    finally:
        started.give_up()
    folder = results / "tournament"
    done = sorted((folder / "tournament_chunk").iterdir())
    assert 2 <= len(done) < _PARTS
    assert all(len(read(path)) > 0 for path in done), "half-written"
    assert f"{len(done)} of {_PARTS} parts are done and kept" in started.said[-2]
    assert "the same command goes on" in started.said[-2]
    assert not any("Traceback" in line for line in started.said)
    assert not list(folder.glob("*.parquet"))
    again = Started(results, 2)
    try:
        again.until(f"{len(done)} of {_PARTS} parts are there")
    finally:
        again.give_up()


def test_ctrl_c_on_one_core_is_told_in_a_line(results):
    started = Started(results, 1, parts=1)
    try:
        started.until("so far")
        assert started.stop(signal.SIGINT, True) == 130
    finally:
        started.give_up()
    assert not any("Traceback" in line for line in started.said)
    assert not list(results.rglob("*.partial"))


@pytest.mark.parametrize(
    ("fault", "code", "words"),
    [
        (MemoryError("Unable to allocate 80 GiB"), 1, "not enough memory for this: Unable to"),
        (RecursionError("maximum depth"), 1, "nested too deeply"),
        (PermissionError(13, "Permission denied", "robot.yaml"), 1, "robot.yaml: permission"),
        (KeyboardInterrupt(), 130, "stopped"),
    ],
    ids=["memory", "recursion", "permission", "Ctrl-C"],
)
def test_what_ends_a_command_is_said_in_a_line(monkeypatch, fault, code, words):
    from kinacc.kinematics import robot

    def fail(*_: object) -> None:
        raise fault

    monkeypatch.setattr(robot, "load", fail)
    done = CliRunner().invoke(main, ["plan-poses", "ur10"])
    assert (done.exit_code, words in done.output) == (code, True), done.output
    assert done.output.count("\n") == 1

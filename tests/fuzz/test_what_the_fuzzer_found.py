"""A stranger's file never does more than bring a message: every finding, and a few new inputs."""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from fuzz import bugs
from fuzz.case import Case
from fuzz.seeds import with_what_is_beside
from fuzz.targets import TARGETS

from kinacc.errors import KinaccError

HERE = Path(__file__).resolve().parent
KEPT = sorted((HERE / "findings").glob("*.json"))


@pytest.mark.parametrize("path", KEPT, ids=lambda path: path.stem)
def test_a_file_that_once_ended_in_a_traceback_is_read_or_refused(path, tmp_path, monkeypatch):
    target, case = Case.of_json(path.read_text())
    case = with_what_is_beside(case)
    case.write(tmp_path)
    there = sorted(tmp_path.rglob("*"))
    monkeypatch.chdir(tmp_path)
    with suppress(KinaccError):
        TARGETS[target].read(tmp_path, case.options)
    if TARGETS[target].writes is None:
        assert sorted(tmp_path.rglob("*")) == there


def fuzzed(*words: object) -> str:
    """What a short run of the fuzzer says; it fails where an input is a finding."""
    command = [sys.executable, HERE / "run.py", *words]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]
    return done.stdout


def test_some_hundred_strange_files_bring_messages_and_nothing_else():
    said = fuzzed("--inputs", 250, "--seed", 20)
    *each, whole = said.splitlines()[1:]
    assert whole.startswith("all")
    assert len(each) >= 12


def test_an_input_is_made_again_from_its_number():
    target = TARGETS["robot"]
    made = [target.case("robot", 1, number) for number in (7, 8, 7)]
    assert made[0] == made[2] != made[1]
    kept = json.loads(made[0].to_json("robot", "why"))
    assert Case.of_json(json.dumps(kept)) == ("robot", made[0])


@pytest.mark.parametrize("name", bugs.BUGS)
def test_a_fault_of_the_past_can_be_put_back(name):
    bug = bugs.BUGS[name]
    path = Path(*bug.module.split(".")).with_suffix(".py")
    source = (HERE.parents[1] / "src" / path).read_text()
    assert compile(bugs.changed(bug, source), str(path), "exec")


def test_the_fuzzer_finds_a_fault_that_is_put_back():
    name = "huge whole numbers in a configuration"
    from fuzz.run import FINDINGS, outcomes

    found = outcomes([["configuration", 1, 0, 400]], bug=name)
    assert any(each["outcome"] in FINDINGS for _, each in found)

"""A command that is printed as the next one runs as it is printed, in a folder with a space."""

from __future__ import annotations

import json
import re
import shlex

import numpy as np
import pytest
from command_line import call

from kinacc.kinematics import robot


@pytest.fixture
def described(tmp_path):
    """A measured file that init described, into a folder with a space: what it said."""
    arm = robot.load("irb120")
    q = np.round(np.random.default_rng(0).uniform(-1.0, 1.0, (40, 6)), 6)
    rows = np.column_stack([q, robot.forward(arm, q).position_mm])
    file = tmp_path / "day 1 (it's late).csv"
    head = ",".join([*(f"q{i}_rad" for i in range(1, 7)), "x_mm", "y_mm", "z_mm"])
    np.savetxt(file, rows, delimiter=",", header=head, comments="")

    def run(*more):
        done = call("init", file, "--robot", "irb120", "--out", tmp_path / "my cell", "--yes",
                    "--name", "own", *more)  # fmt: skip
        assert done.exit_code == 0, done.output
        return done

    return run


def run(line):
    """Run a line as a shell would take it."""
    words = shlex.split(line)
    assert words[0] == "kinacc"
    return call(*words[1:])


def test_what_init_writes_into_its_file_and_its_json_runs_as_printed(described, tmp_path):
    described()
    text = (tmp_path / "my cell" / "own.yaml").read_text()
    noted = re.search(r"^#\s+(kinacc check-data .*)$", text, re.MULTILINE)[1]
    told = json.loads(described("--force", "--json").stdout)["next"]
    for line in (noted, told[0]):
        assert run(line).exit_code == 0, line


def test_what_campaign_start_names_next_runs_as_printed(study, tmp_path):
    folder = tmp_path / "my arm's check"
    done = call("campaign", "start", folder, "--calibration", study, "--model", "dh",
                "--candidates", 5, "--budget", 5, "--noise-mm", 0.05)  # fmt: skip
    assert done.exit_code == 0, done.output
    line = re.search(r"^Next: (.*)$", done.output, re.MULTILINE)[1]
    shown = run(line)
    assert shown.exit_code == 0, line
    assert "reading 1 of 5" in shown.output

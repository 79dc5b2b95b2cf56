"""kinacc is installed from a wheel, and used in a folder that holds nothing but measurements."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import shared_work
import typed_commands


@pytest.fixture(scope="session")
def installed(tmp_path_factory) -> Path:
    """A folder with the contents of a wheel of the package, as pip leaves them."""
    return shared_work.once(tmp_path_factory, "wheel", typed_commands.installed) / "site"


@pytest.fixture
def call(installed, tmp_path):
    """A command in an empty folder of one's own, whose name has a space in it, and that folder."""
    folder = tmp_path / "my cell"
    folder.mkdir()

    def started(*words: str, ok: bool = True) -> str:
        done = subprocess.run(
            [sys.executable, "-m", "kinacc", *words],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": str(installed)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.returncode == 0) == ok, done.stdout + done.stderr
        assert "Traceback" not in done.stderr
        return done.stdout if ok else done.stderr

    started.folder = folder
    return started


def test_without_a_configuration_the_command_says_how_to_get_one(call):
    assert "kinacc init" in call("calibrate", ok=False)


def test_the_papers_study_runs_from_the_installed_package(call):
    said = call("study", "--", "--dry-run")
    assert "study_part" in said

"""kinacc is installed from a wheel, and used in a folder that holds nothing but measurements."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from kinacc.artifacts import store

ROOT = Path(__file__).resolve().parents[2]
SERIES = ROOT / "examples" / "data" / "ur10_tmac" / "series_D.csv"


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> Path:
    """A folder with the contents of a wheel of the package, as pip leaves them."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*pip, "--target", str(folder / "site"), str(wheel)], check=True)
    return folder / "site"


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


def printed_in_the_readme(section: str) -> list[list[str]]:
    """Words of the commands that a section of README.md tells to type, in their order."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (text,) = re.findall(rf"^## {re.escape(section)}\n(.*?)^## ", text, re.MULTILINE | re.DOTALL)
    blocks = "\n".join(re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL))
    lines = re.findall(r"^kinacc (.*)", blocks, re.MULTILINE)
    return [shlex.split(line, comments=True) for line in lines]


def test_the_readme_leads_from_a_tracker_file_to_models_and_what_they_are_worth(call):
    shutil.copy(SERIES, call.folder / "tracker.csv")
    commands = printed_in_the_readme("Your robot")
    assert [words[0] for words in commands] == ["init", "check-data", "calibrate"]
    described, checked, calibrated = (call(*words) for words in commands)
    for command in ("kinacc check-data tracker.yaml", "kinacc calibrate tracker.yaml"):
        assert f"  {command}\n" in described
    assert "kinacc calibrate tracker.yaml" in checked
    assert "is selected" in calibrated
    assert "kinacc study tracker.yaml" in calibrated
    commands = printed_in_the_readme("How large is the largest error?")
    planned, begun, asked = (call(*words) for words in commands)
    assert "readings give bounds at most 0.1 mm apart" in planned
    assert "kinacc campaign next check" in begun
    assert "reading 1 of 300" in asked
    model = store.read(call.folder / "results" / "tracker" / "dh_model.parquet")
    assert list(model["joint"]) == [1, 2, 3, 4, 5, 6]
    assert not (call.folder / "results" / "tracker" / "study.parquet").exists()


def test_without_a_configuration_the_command_says_how_to_get_one(call):
    assert "kinacc init" in call("calibrate", ok=False)


def test_the_papers_study_runs_from_the_installed_package(call):
    said = call("study", "--", "--dry-run")
    assert "mh180" in said

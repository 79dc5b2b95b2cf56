"""What pytest says of tests that it could not run."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
NEEDY = """\
import shared_data

@shared_data.needed("ur10_tmac/series_A.csv")
def test_marked():
    pass

def test_asks():
    shared_data.path_of("fanuc_r2000ic")

def test_needs_nothing():
    pass
"""


def report_of(project: Path) -> str:
    """What pytest says of a project of three tests, two of which need measured data."""
    tests = project / "tests"
    tests.mkdir(parents=True)
    for name in ("conftest.py", "shared_data.py"):
        shutil.copy(HERE / name, tests)
    (tests / "test_needy.py").write_text(NEEDY, encoding="utf-8")
    command = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider")
    return subprocess.run(command, cwd=tests, capture_output=True, text=True).stdout


def test_without_measured_data_the_number_of_skipped_tests_and_the_place_are_said(tmp_path):
    said = report_of(tmp_path / "project")
    assert f"2 skipped: the measured data sets are expected in {tmp_path / 'shared/data'}" in said
    assert "1 passed, 2 skipped" in said


def test_with_measured_data_nothing_is_said_of_it(tmp_path):
    for name in ("ur10_tmac/series_A.csv", "fanuc_r2000ic/poses.csv"):
        path = tmp_path / "shared" / "data" / name
        path.parent.mkdir(parents=True)
        path.touch()
    said = report_of(tmp_path / "project")
    assert "3 passed" in said
    assert "expected in" not in said

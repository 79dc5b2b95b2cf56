"""Set-up on machines that are not as they should be."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def find_python(*candidates: str) -> subprocess.CompletedProcess:
    command = ["sh", str(ROOT / "requirements" / "find-python"), *candidates]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_first_python_that_works_is_taken(tmp_path):
    old = tmp_path / "old python"
    old.write_text("#!/bin/sh\nexit 1\n")
    old.chmod(0o755)
    found = find_python("no-such-python", str(old), sys.executable)
    assert found.returncode == 0
    assert found.stdout.strip() == sys.executable


def test_no_suitable_python_gives_one_clear_line():
    found = find_python("no-such-python")
    assert found.returncode == 1
    assert found.stdout == ""
    (line,) = found.stderr.splitlines()
    for word in ("3.11", "3.13", "venv", "no-such-python"):
        assert word in line


def test_lock_files_hold_names_versions_and_hashes_only():
    for name in ("run.txt", "test.txt", "audit.txt"):
        text = (ROOT / "requirements" / name).read_text()
        assert "--hash=sha256:" in text
        for foreign in ("://", "--index", "--find-links", "--extra", "file:", "/home", " @ "):
            assert foreign not in text, f"{name}: {foreign}"

"""Set-up on machines that are not as they should be."""

import re
import subprocess
import sys
import tomllib

import yaml
from shared_data import ROOT


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
    assert "no-such-python" in line


def test_lock_files_hold_names_versions_and_hashes_only():
    for name in ("run.txt", "test.txt", "audit.txt"):
        text = (ROOT / "requirements" / name).read_text()
        assert "--hash=sha256:" in text
        for foreign in ("://", "--index", "--find-links", "--extra", "file:", "/home", " @ "):
            assert foreign not in text, f"{name}: {foreign}"


def test_the_conda_environment_has_every_dependency_in_the_version_of_the_lock():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = {re.match(r"[\w-]+", each)[0] for each in project["dependencies"]} - {"snakemake"}
    locked = (ROOT / "requirements" / "run.txt").read_text()
    locked = dict(re.findall(r"^([a-z0-9_.-]+)==([^ ;]+)", locked, re.M))
    environment = yaml.safe_load((ROOT / "workflow" / "envs" / "kinacc.yaml").read_text())
    python, *pinned = environment["dependencies"]
    assert python == f"python {project['requires-python']}"
    found = dict(each.replace("matplotlib-base", "matplotlib").split(" =") for each in pinned)
    assert wanted <= set(found)
    assert found == {name: locked[name] for name in found}

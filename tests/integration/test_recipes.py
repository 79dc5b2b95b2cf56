"""The pipelines of examples/ci, run as they stand there, from nothing and from what was kept."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
import typed_commands
from build_servers import Ended, Server, on_github, on_gitlab, on_one_machine
from whole_project import write_poses

# Models alone, as the recipes have it.
STUDY = """\
datasets:
  cell:
    robot: mh180
    measurements: {source: file, folds: 2, file: {path: poses.csv, orientation: {kind: quaternion}}}
    calibration: {vec: {order: 2}}
    evaluation: {space: measured}
gates:
  - {name: held out, value: residuals.position.p99, at_most_mm: 2.0}
"""
RUNS = {"github": on_github, "gitlab": on_gitlab, "pipeline": on_one_machine}


@dataclass(frozen=True)
class Team:
    """A bare repository, and the clone of the person who works on it."""

    repository: Path
    clone: Path
    shell: typed_commands.Shell

    def git(self, *words: str) -> None:
        """A git command in the clone."""
        who = ("-c", "user.name=A. Person", "-c", "user.email=person@example.com")
        subprocess.run(["git", *who, *words], cwd=self.clone, check=True, capture_output=True)

    def push(self, why: str) -> None:
        """All that stands in the clone."""
        self.git("add", "--all")
        self.git("commit", "-q", "-m", why)
        self.git("push", "-q", "origin", "HEAD:main")

    def types(self, text: str) -> str:
        """What a command says that is typed in the clone by a person, not by a build server."""
        code, said, _ = self.shell(text, self.clone, CI="", BUILD_ID="", BUILD_NUMBER="")
        assert code == 0, said
        return said


@pytest.fixture(scope="module")
def shell(tmp_path_factory) -> Iterator[typed_commands.Shell]:
    commands = tmp_path_factory.mktemp("commands")
    shell, server = typed_commands.started(commands, typed_commands.ROOT / "src")
    yield shell
    server.terminate()
    server.wait()


@pytest.fixture(scope="module")
def team(tmp_path_factory, shell) -> Team:
    """A repository as docs/pipeline.md lays it out, before anything was accepted."""
    folder = tmp_path_factory.mktemp("a team")
    team = Team(folder / "study.git", folder / "study", shell)
    for words in (["init", "-q", "--bare", "-b", "main"], ["clone", "-q"]):
        where = [team.repository] if "init" in words else [team.repository, team.clone]
        subprocess.run(["git", *words, *where], check=True, capture_output=True)
    write_poses(team.clone / "poses.csv")
    (team.clone / "tracker.yaml").write_text(STUDY)
    (team.clone / ".gitignore").write_text("results/\n.snakemake/\n.cache/\n.venv/\ngate.*\n")
    (team.clone / "requirements").mkdir()
    shutil.copy(typed_commands.ROOT / "requirements" / "run.txt", team.clone / "requirements")
    (team.clone / "requirements" / "kinacc.txt").write_text("./wheels/kinacc.whl --hash=sha256:0\n")
    team.push("The study")
    return team


@pytest.fixture(scope="module")
def new_server(tmp_path_factory, team):
    """A build server that has nothing yet."""

    def made() -> Server:
        kept = {"PYTHONPATH": str(team.shell.installed)}
        folder = tmp_path_factory.mktemp("a server")
        return Server(folder, team.repository, team.shell.commands / "kinacc", kept)

    return made


@pytest.fixture(scope="module")
def first(team, new_server) -> tuple[Server, Ended]:
    """The first push, on a server of GitHub; a person then accepts what the pipeline left."""
    server = new_server()
    ended = on_github(server)
    team.types(f"kinacc accept {str(ended.left / 'results')!r} --reason 'first run of the cell'")
    team.push("Accept the first run")
    return server, ended


@pytest.mark.parametrize("name", RUNS)
def test_nothing_is_computed_again_from_what_was_kept(name, first, new_server):
    run = RUNS[name]
    server = first[0] if name == "github" else new_server()
    if name != "github":
        cold = run(server)
        assert cold.passed, cold.text
        assert len(cold.computed) == 6
    warm = run(server)
    assert warm.passed, warm.text
    assert warm.computed == []
    assert (warm.left / "gate.xml").is_file()
    assert list(warm.left.rglob("results/cell/report.html" if name != "gitlab" else "report.html"))
    installed = server.asked.read_text().splitlines()
    assert len(installed) == 1
    assert "--require-hashes" in installed[0]

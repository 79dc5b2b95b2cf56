"""The pipelines of examples/ci, run as they stand there, from nothing and from what was kept."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest
import typed_commands
from build_servers import RECIPES, Ended, Server, on_github, on_gitlab, on_one_machine
from whole_project import write_poses

from kinacc.workflow.contradictions import load

# Models alone, as the recipes have it.
STUDY = """\
datasets:
  cell:
    robot: mh180
    measurements: {source: file, folds: 2, file: {path: poses.csv, orientation: {kind: quaternion}}}
    calibration: {vec: {order: 2}}
    evaluation: {space: measured}
gates:
  - {name: held out, value: residuals.position.mean, at_most_mm: 2.0}
"""


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
        code, said, _ = self.shell(text, self.clone)
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
    (team.clone / "requirements" / "wheel.txt").write_text("./wheels/kinacc.whl --hash=sha256:0\n")
    team.push("The study")
    return team


@pytest.fixture(scope="module")
def server_of(tmp_path_factory, team):
    """A build server that has nothing yet."""

    def made() -> Server:
        kept = {"PYTHONPATH": str(team.shell.installed)}
        folder = tmp_path_factory.mktemp("a server")
        return Server(folder, team.repository, team.shell.commands / "kinacc", kept)

    return made


@pytest.fixture(scope="module")
def first(team, server_of) -> tuple[Server, Ended]:
    """The first push, on a server of GitHub; a person then accepts what the pipeline left."""
    server = server_of()
    ended = on_github(server)
    team.types(f"kinacc accept {str(ended.left / 'results')!r} --reason 'first run of the cell'")
    team.push("Accept the first run")
    return server, ended


@pytest.fixture
def new_server(first, server_of):
    """A build server that has nothing yet, after a run was accepted."""
    return server_of


def test_the_first_push_fails_at_the_gate_and_leaves_what_a_person_accepts(first):
    _, ended = first
    assert not ended.passed
    assert len(ended.computed) == 6
    assert "kinacc accept" in ended.text
    assert (ended.left / "results" / "cell" / "report.html").is_file()
    assert not list(ended.left.rglob("accepted.json"))


def test_strangers_read_what_is_kept_and_write_nothing(first):
    server, _ = first
    before = len(server.caches)
    warm = on_github(server, event="pull_request")
    assert len(server.caches) == before
    passed_without_computing(server, warm)


def test_a_merge_request_computes_nothing_again_after_a_push_on_gitlab(new_server):
    server = new_server()
    cold = on_gitlab(server)
    assert cold.passed, cold.text
    assert len(cold.computed) == 6
    before = len(server.caches)
    warm = on_gitlab(server, merge_request=True)
    assert len(server.caches) == before
    assert (warm.left / "gate.codequality.json").is_file()
    passed_without_computing(server, warm)


def test_on_one_machine(new_server):
    """One story, for every run takes seconds."""
    server = new_server()
    cold = on_one_machine(server)
    assert cold.passed, cold.text
    assert len(cold.computed) == 6
    passed_without_computing(server, on_one_machine(server))

    work = server.folder / "kept" / "clone"
    shutil.rmtree(work / "results")
    shutil.rmtree(work / ".snakemake")
    again = on_one_machine(server)
    assert again.passed, again.text
    assert {"vec_model", "dh_model"} <= again.taken
    assert len(again.computed) == 4, "fits come from Snakemake's cache, what is quick does not"

    table = work / "results" / "cell" / "residuals.parquet"
    content = bytearray(table.read_bytes())
    content[len(content) // 2] ^= 1
    table.write_bytes(content)
    edited = on_one_machine(server)
    assert not edited.passed
    assert "residuals.parquet" in edited.text


def passed_without_computing(server: Server, warm: Ended) -> None:
    """Nothing was installed or computed a second time, and all is left for people."""
    assert warm.passed, warm.text
    assert warm.computed == []
    assert json.loads((warm.left / "gate.json").read_text())["format"] == "kinacc gate 1"
    assert (warm.left / "gate.xml").is_file()
    (report,) = warm.left.rglob("report.html")
    assert not report.is_symlink()
    (installed,) = server.asked.read_text().splitlines()
    assert "--require-hashes" in installed


def test_the_small_study_of_the_paper_is_smaller_in_what_it_says_alone():
    def flat(section: Mapping, place: str = "") -> dict[str, object]:
        found: dict[str, object] = {}
        for key, value in section.items():
            deep = isinstance(value, Mapping) and value
            found |= flat(value, f"{place}{key}.") if deep else {f"{place}{key}": value}
        return found

    small, whole = (
        flat(load([str(path)])["mh180"])
        for path in (RECIPES / "paper-small.yaml", typed_commands.ROOT / "config.yaml")
    )
    other = {key for key in small.keys() | whole.keys() if small.get(key) != whole.get(key)}
    said = {"map.grid_mm", "study.noise_mm", "study.repetitions", "figures.formats"}
    assert other == said | {"gates"}


def test_recipes_pin_what_they_use_and_leave_accepting_to_people():
    for path in RECIPES.iterdir():
        text = path.read_text()
        assert "kinacc accept" not in text
        for used in re.findall(r"uses: (.*)", text):
            assert re.fullmatch(r"[\w/-]+@v\d+\.\d+\.\d+", used), used

"""A finished study of a synthetic and of a measured arm, its reruns, and what the gate says."""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from unittest.mock import patch

import numpy as np
from click.testing import CliRunner
from whole_project import write_poses

import kinacc
from kinacc.artifacts import provenance
from kinacc.cli.group import main
from kinacc.config.validate import overlay
from kinacc.workflow import runner
from kinacc.workflow.catalogue import FIGURE, PAGE, TABLES
from kinacc.workflow.plan import Plan, planned
from kinacc.workflow.runner import is_done, perform

ALL = (TABLES, FIGURE, PAGE)
ROOT = Path(__file__).resolve().parents[2]
SOURCE = Path(kinacc.__file__).parent
SETTINGS = """\
seed: 20
measurements: {folds: 4, synthetic: {poses: 80}}
calibration: {vec: {order: 2}}
evaluation: {points: 12}
map: {slices_deg: [0, 30], grid_mm: 250}
study: {noise_mm: [0.1, 0.3], repetitions: 4, measurements: 20}
histories: {simulations_searched: 20}
figures: {formats: [svg]}
datasets:
  own:
    robot: own_arm.yaml
    calibration: {compliance: {joints: [2, 3]}}
    evaluation: {space: measured}
    measurements:
      source: file
      file:
        path: poses.csv
        orientation: {kind: quaternion}
        exclude: [{lines: [5], reason: the probe was touched}]
"""
GATES = """\
gates:
  - {name: not worse, value: residuals.position.mean, model: dh, against: accepted,
     allow_mm: 0.02, beyond_chance: 0.99}
"""
# Variables by which the command knows a build server, at work on these tests perhaps.
SERVERS = ("CI", "GITHUB_ACTIONS", "GITLAB_CI", "JENKINS_URL", "BUILD_ID", "TF_BUILD")


@dataclass(frozen=True)
class World:
    """A study on disk: its configuration and files in ``folder``, its results below."""

    folder: Path

    @property
    def results(self) -> Path:
        """The results folder."""
        return self.folder / "results"

    @property
    def accepted(self) -> Path:
        """The accepted run."""
        return self.folder / "accepted"

    @property
    def configs(self) -> list[Path]:
        """Configuration files, the later ones over the earlier ones."""
        return [ROOT / "config.yaml", self.folder / "small.yaml"]

    def plan(self) -> Plan:
        """The plan for the configuration as it is now."""
        return planned(self.configs, results=str(self.results))

    def configure(self, change: Mapping[str, object]) -> None:
        """Lay a change over the configuration."""
        import yaml

        path = self.folder / "small.yaml"
        path.write_text(yaml.safe_dump(overlay(yaml.safe_load(path.read_text()), change)))

    def copied(self, folder: Path) -> World:
        """A copy to be changed, with the times of its files."""
        shutil.copytree(self.folder, folder)
        return World(folder)

    def gate(self, *options: object) -> Answer:
        """What the gate says of the results beside the accepted run."""
        return asked("gate", self.results, *self._given(), "--against", self.accepted, *options)

    def accept(self) -> None:
        """Make the results the accepted run."""
        done = asked("accept", self.results, "--reason", "first", "--to", self.accepted, json=False)
        if done.code:
            raise RuntimeError(done.text)

    def _given(self) -> list[object]:
        return [word for path in self.configs for word in ("--config", path)]


@dataclass(frozen=True)
class Answer:
    """Exit code of a command, the JSON it printed (None where it is none) and all it said."""

    code: int
    told: object
    text: str


def asked(*words: object, json: bool = True) -> Answer:
    """Call kinacc as a person would, beside no build server."""
    everything = [str(word) for word in (*words, *(["--json"] if json else []))]
    with patch.dict(os.environ):
        for name in SERVERS:
            os.environ.pop(name, None)
        done = CliRunner().invoke(main, everything)
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    return Answer(done.exit_code, _as_json(done.stdout) if json else None, done.output)


def _as_json(text: str) -> object:
    try:
        return json.loads(text)
    except ValueError:
        return None


def write_world(folder: Path, poses: int = 40, settings: str = SETTINGS) -> World:
    """Configuration and files of a world, nothing of it run; the gates are part of it."""
    folder.mkdir(parents=True)
    write_poses(folder / "poses.csv", poses)
    shutil.copy(SOURCE / "kinematics/robots/mh180.yaml", folder / "own_arm.yaml")
    (folder / "small.yaml").write_text(settings + GATES)
    return World(folder)


def finished(folder: Path) -> World:
    """A world whose study has been run, pictures and pages too."""
    world = write_world(folder)
    rerun(world.plan(), leaves=ALL)
    return world


def rerun(
    plan: Plan, draw: np.random.Generator | None = None, leaves: Collection[str] = (TABLES,)
) -> list[str]:
    """Run what the records do not say is done, and name it; by ``draw`` in a drawn order.

    ``leaves``: what is made, tables alone to spare the time of pictures that show them.

    As the workflow does: what was made of other settings, code, versions or inputs, and what was
    made from what is made anew, as far as that says something else.
    """
    made = []
    waiting = [
        (dataset, name)
        for dataset in plan.datasets
        for name, stage in plan.stages(dataset).items()
        if stage.leaves in leaves and not stage.on_request
    ]
    while waiting:
        dataset, name = _next(plan, waiting, draw)
        parts = plan.part_names(name, dataset)
        for part in draw.permutation(np.array(parts, object)) if draw is not None else parts:
            job = plan.job(name, dataset, part)
            if not is_done(job):
                perform(job)
                made.append(f"{dataset}/{name}")
    return list(dict.fromkeys(made))


def _next(
    plan: Plan, waiting: list[tuple[str, str]], draw: np.random.Generator | None
) -> tuple[str, str]:
    """Take out one stage that nothing that still waits has to be made before."""
    stages = {(dataset, name): plan.stages(dataset)[name] for dataset, name in waiting}
    to_come = {(dataset, each) for (dataset, _), one in stages.items() for each in one.outputs}
    ready = [
        (dataset, name)
        for (dataset, name), stage in stages.items()
        if not {(dataset, each) for each in (*stage.inputs, *stage.optional, *stage.after)}
        & to_come
    ]
    one = ready[0 if draw is None else int(draw.integers(len(ready)))]
    waiting.remove(one)
    return one


# What changes around a run, for as long as a case lasts.


def forgotten() -> None:
    """Let the package look anew at code, versions and folders."""
    for module in [each for name, each in sys.modules.items() if name.startswith("kinacc.")]:
        for value in list(vars(module).values()):
            if hasattr(value, "cache_clear") and value.__module__.startswith("kinacc.artifacts"):
                value.cache_clear()


@contextmanager
def other_version(name: str, number: str, folder: Path) -> Iterator[None]:
    """A library, Python or kinacc itself of another version, as far as the code can read it."""
    if name == "kinacc":
        with (
            patch.object(runner, "__version__", number),
            patch.object(kinacc, "__version__", number),
        ):
            yield
        return
    if name == "python":
        major, minor = map(int, number.split("."))
        with patch.object(provenance, "sys", _Other(sys, version_info=_Version(major, minor))):
            forgotten()
            yield
        forgotten()
        return
    metadata = folder / f"{name}-{number}.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {number}\n")
    sys.path.insert(0, str(folder))
    forgotten()
    try:
        yield
    finally:
        sys.path.remove(str(folder))
        forgotten()


@dataclass(frozen=True)
class _Version:
    major: int
    minor: int
    micro: int = 0

    def __getitem__(self, place: object) -> object:
        return (self.major, self.minor, self.micro, "final", 0)[place]

    def __iter__(self) -> Iterator[object]:
        return iter(self[:])


class _Other:
    """A module with some of its values replaced."""

    def __init__(self, module: ModuleType, **values: object) -> None:
        self.__dict__.update(values, module=module)

    def __getattr__(self, name: str) -> object:
        return getattr(self.__dict__["module"], name)


@contextmanager
def other_numbers(module: str, function: str, factor: float) -> Iterator[None]:
    """A function whose result comes out otherwise, in memory, whatever its file says.

    As a library of another version may round otherwise, or a machine that makes mistakes.
    """
    right = getattr(import_module(module), function)

    def wrong(*given: object, **named: object) -> object:
        return right(*given, **named) * factor

    places = [
        each
        for name, each in list(sys.modules.items())
        if name.startswith("kinacc") and vars(each).get(function) is right
    ]
    for each in places:
        setattr(each, function, wrong)
    try:
        yield
    finally:
        for each in places:
            setattr(each, function, right)

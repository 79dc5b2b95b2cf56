"""Hold the provenance of a data set's artefacts to each other: was each made from what is there?"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

from kinacc import __version__
from kinacc.artifacts import provenance
from kinacc.artifacts.contract import ARTEFACTS
from kinacc.artifacts.store import read_metadata
from kinacc.errors import InputError, Problem
from kinacc.workflow.catalogue import STAGES, TABLES, Stage, maker_of
from kinacc.workflow.plan import Plan
from kinacc.workflow.runner import Job, stage_provenance
from kinacc.workflow.verification.mending import Doubt, Marks

Inputs = dict[str, "str | list[str]"]

# A problem, and the stages whose files it leaves in doubt.
Found = tuple[Problem, tuple[Doubt, ...]]


def check_lineage(
    folder: Path, marks: Marks, plan: Plan | None = None
) -> tuple[list[Found], list[str]]:
    """Problems and notes on the provenance of the tables in a data set's folder.

    ``marks`` holds the provenance of every readable table by artefact. Without a ``plan``, files
    from outside the folder (measurements, a robot of one's own) and configuration are not known.
    """
    found = list(_one_version(folder, marks))
    older: list[str] = []
    held: dict[str, _Held] = {}
    of_robot_file: dict[str, _Held] = {}
    for stage in STAGES.values():
        if stage.joint:
            continue  # not of this data set alone
        made = [name for name in stage.outputs if name in marks]
        torn = list(_one_run(folder, made, marks))
        found += [(problem, (Doubt(stage.name),)) for problem in torn]
        if stage.scattered and plan is not None:
            found += _parts_held_to_settings(folder, stage, plan)
        if not made or stage.scattered or (plan is None and "measurements_file" in _roles(stage)):
            continue
        own = _held_to_inputs(folder, stage, marks[made[0]], plan)
        own = own._replace(vouched_for=set() if torn else own.vouched_for)
        (of_robot_file if plan is None and stage.files else held)[made[0]] = own
        older += [] if own.is_current else made
    notes = []
    if len(of_robot_file) > 1 and all(own.problems for own in of_robot_file.values()):
        # One robot serves all stages: where every one that reads it differs, it has a file.
        names = ", ".join(of_robot_file)
        notes.append(f"{folder}: its robot file is not checked without --config: {names}")
    else:
        held |= of_robot_file
    sound = set().union(*(own.vouched_for for own in held.values()))
    for name, own in held.items():
        stage = maker_of(name).name
        makers = {maker_of(each).name for each in own.in_doubt - sound}
        doubts = tuple(map(Doubt, (stage, *sorted(makers))))
        found += [(problem, doubts) for problem in own.problems]
    if older:
        names = ", ".join(older)
        notes.append(f"{folder}: made with other code or library versions than installed: {names}")
    return found, notes


def outdated(folder: Path, artefacts: Collection[str]) -> set[str]:
    """Which of the artefacts, as far as they are there, were made from others than are there."""
    marks = {
        path.stem: read_metadata(path)
        for path in sorted(folder.glob("*.parquet"))
        if path.stem in ARTEFACTS
    }
    doubted = {doubt.stage for _, doubts in check_lineage(folder, marks)[0] for doubt in doubts}
    return {name for name in artefacts if name in marks and maker_of(name).name in doubted}


def made_without(folder: Path, artefact: str, marks: Marks) -> bool:
    """Whether every stage that may use an artefact was run without it."""
    users = [
        stage for stage in STAGES.values() if artefact in stage.optional and stage.leaves == TABLES
    ]
    return bool(users) and all(
        stage.outputs[0] in marks and made_of_these(folder, stage, marks[stage.outputs[0]])
        for stage in users
    )


def made_of_these(folder: Path, stage: Stage, own: Mapping[str, str]) -> bool:
    """Whether a stage's table with the provenance ``own`` was made from the tables now there."""
    return any(
        _expected(stage, inputs, {}, 0)["inputs_hash"] == own.get("inputs_hash")
        for inputs in _candidates(folder, stage)
    )


def parts(folder: Path, artefact: str) -> list[list[str]]:
    """Complete sets of the parts of a scattered artefact, one list for every number of parts."""
    found: dict[int, dict[int, str]] = {}
    for path in sorted((folder / artefact).glob("*.parquet")):
        numbers = re.fullmatch(r"(\d+)-of-(\d+)", path.stem)
        if numbers:
            number, count = map(int, numbers.groups())
            found.setdefault(count, {})[number] = str(path)
    return [
        [own[number] for number in range(1, count + 1)]
        for count, own in sorted(found.items())
        if set(own) == set(range(1, count + 1))
    ]


def _roles(stage: Stage) -> set[str]:
    roles = {"measurements_file", "joints_file"}
    return roles if "measurements.file.path" in stage.files else set()


def _one_version(folder: Path, marks: Marks) -> Iterator[Found]:
    for key in ("kinacc_version", "seed"):
        groups: dict[str, list[str]] = {}
        for name, own in marks.items():
            if key in own:
                groups.setdefault(own[key], []).append(name)
        if len(groups) < 2:
            continue
        said = "; ".join(f"{value} in {', '.join(names)}" for value, names in groups.items())
        problem = Problem(str(folder), f"{key} {said}", "the same in all artefacts")
        right = __version__ if __version__ in groups else max(groups, key=lambda v: len(groups[v]))
        stages = {
            maker_of(name).name for value in groups if value != right for name in groups[value]
        }
        yield problem, tuple(map(Doubt, sorted(stages)))


def _one_run(folder: Path, made: Sequence[str], marks: Marks) -> Iterator[Problem]:
    for name in made[1:]:
        for key, value in marks[made[0]].items():
            if marks[name].get(key, value) != value:
                where = str(folder / f"{name}.parquet")
                what = f"{key} {marks[name][key]} differs from {value} of {made[0]}.parquet"
                yield Problem(where, what, "tables of one stage are made together")


class _Held(NamedTuple):
    """What the provenance of one stage says of it and of its inputs.

    ``vouched_for`` are inputs that are those it was made from; of those ``in_doubt`` one or
    another is not. ``is_current`` is whether it was made with the code installed.
    """

    problems: list[Problem]
    vouched_for: set[str]
    in_doubt: set[str]
    is_current: bool


def _held_to_inputs(folder: Path, stage: Stage, own: Mapping[str, str], plan: Plan | None) -> _Held:
    where = str(folder / f"{stage.outputs[0]}.parquet")
    settings, seed = {}, 0
    candidates = _candidates(folder, stage)
    if plan is not None:
        settings, seed = plan.settings(stage.name, folder.name), plan.seed(folder.name)
        known = plan.inputs(stage.name, folder.name)
        files = {name: known[name] for name in known if name.endswith("_file")}
        candidates = [
            inputs | files
            for inputs in candidates
            if all(Path(each).is_file() for each in files.values())
        ]
    if not candidates:
        return _Held([], set(), set(), True)
    artefacts = {name for name in candidates[0] if not name.endswith("_file")}
    problems = []
    try:
        expected = [_expected(stage, inputs, settings, seed) for inputs in candidates]
    except InputError as error:
        return _Held(list(error.problems), set(), artefacts, True)
    matching = [
        inputs
        for inputs, each in zip(candidates, expected, strict=True)
        if each["inputs_hash"] == own.get("inputs_hash")
    ]
    if not matching:
        names = ", ".join(candidates[0]) or "nothing"
        fix = ""
        if plan is None and stage.files:
            fix = "if the robot is a file of your own, give the configuration too"
        what = f"inputs_hash {own.get('inputs_hash')} is not that of the inputs now there ({names})"
        problems.append(Problem(where, what, expected[0]["inputs_hash"], fix))
    if plan is not None and own.get("config_hash") != expected[0]["config_hash"]:
        what = f"config_hash {own.get('config_hash')}: made with another configuration"
        problems.append(Problem(where, what, expected[0]["config_hash"]))
    if plan is not None and own.get("seed") != str(seed):
        problems.append(Problem(where, f"seed {own.get('seed')}", str(seed)))
    vouched = set(matching[0]) if matching and not problems else set()
    is_current = own.get("code_hash") in _codes(
        stage, settings if plan else None, matching[0] if matching else None
    )
    return _Held(problems, vouched, set() if matching else artefacts, is_current)


def _parts_held_to_settings(folder: Path, stage: Stage, plan: Plan) -> Iterator[Found]:
    """Parts of a scattered table that were made with other settings than the plan's."""
    from kinacc.artifacts.store import read_metadata

    wanted = _expected(stage, {}, plan.settings(stage.name, folder.name), 0)["config_hash"]
    for part in plan.part_names(stage.name, folder.name):
        path = folder / stage.outputs[0] / f"{part}.parquet"
        try:
            own = read_metadata(path).get("config_hash") if path.is_file() else wanted
        except InputError:
            continue  # an unreadable part is reported where parts are held to the contract
        if own != wanted:
            what = f"config_hash {own}: made with another configuration"
            yield Problem(str(path), what, wanted), (Doubt(stage.name, part),)


def _expected(stage: Stage, inputs: Inputs, settings: Mapping, seed: int) -> dict[str, object]:
    return stage_provenance(Job(stage.module, inputs, {}, settings, seed))


def _codes(stage: Stage, settings: Mapping | None, inputs: Inputs | None) -> set[str]:
    """Hashes of the code installed; for every robot it may be where the settings are not known."""
    from kinacc.kinematics import robot

    known = [settings] if settings is not None else [{"robot": n} for n in ("", *robot.shipped())]
    return {provenance.stage_code_hash(stage.module, stage.used(each, inputs)) for each in known}


def _candidates(folder: Path, stage: Stage) -> list[Inputs]:
    """Sets of artefacts a stage may have read, as they are now; none if a needed one is absent."""
    found: list[Inputs] = [{}]
    for name in stage.inputs:
        maker = next(each for each in STAGES.values() if name in each.outputs)
        path = folder / f"{name}.parquet"
        if maker.scattered:
            found = [old | {name: own} for old in found for own in parts(folder, name)]
        else:
            found = [old | {name: str(path)} for old in found] if path.is_file() else []
    present = [name for name in stage.optional if (folder / f"{name}.parquet").is_file()]
    chosen = [
        {name: str(folder / f"{name}.parquet") for name in names}
        for count in range(len(present), -1, -1)
        for names in combinations(present, count)
    ]
    return [old | extra for old in found for extra in chosen]

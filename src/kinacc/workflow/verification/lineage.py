"""Hold the provenance of a data set's artefacts to each other: was each made from what is there?"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from kinacc import __version__
from kinacc.artifacts import provenance
from kinacc.artifacts.contract import ARTEFACTS, INPUTS_DIGESTS
from kinacc.artifacts.store import read_metadata
from kinacc.errors import InputError, Problem
from kinacc.workflow.catalogue import FIGURE_FOLDER, PAGE, STAGES, TABLES, Stage, maker_of
from kinacc.workflow.inputs import digests
from kinacc.workflow.plan import Plan
from kinacc.workflow.verification.mending import Doubt, Marks

# A problem, and the stages whose files it leaves in doubt.
Found = tuple[Problem, tuple[Doubt, ...]]


def check_lineage(
    folder: Path, marks: Marks, plan: Plan | None = None
) -> tuple[list[Found], list[str]]:
    """Problems and notes on the provenance of what is in a data set's folder.

    ``marks`` holds the provenance of every readable table by artefact, of parts by artefact and
    part (``study_chunk/1-of-2``), of figures and pages by their stage. Without a ``plan``, files
    from outside the folder (measurements, a robot of one's own) and configuration are not known.
    """
    found = list(_one_version(folder, marks))
    older: list[str] = []
    held: dict[str, _Held] = {}
    outside: set[str] = set()
    now = _Now(folder)
    for stage in STAGES.values():
        units = _units(stage, marks)
        torn = [each for made in units.values() for each in _one_run(folder, made, marks)]
        found += [(problem, (Doubt(stage.name),)) for problem in torn]
        for part, made in units.items():
            own = _held_to_inputs(folder, stage, made[0], marks[made[0]], now, plan)
            own = own._replace(part=part, vouched_for=set() if torn else own.vouched_for)
            held[made[0]] = own
            older += [] if own.is_current else made
            outside |= own.outside
        if len({frozenset(marks[made[0]].items()) for made in units.values()}) > 1:
            problem = Problem(str(folder / stage.outputs[0]), "parts of different states")
            found.append((problem, (Doubt(stage.name),)))
    notes = []
    if outside:
        names = ", ".join(sorted(outside))
        notes.append(f"{folder}: not checked without --config: {names}")
    sound = set().union(*(own.vouched_for for own in held.values()))
    for name, own in held.items():
        stage = maker_of(name.partition("/")[0]).name
        makers = {maker_of(each).name for each in own.in_doubt - sound}
        doubts = (Doubt(stage, own.part), *map(Doubt, sorted(makers)))
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
        stage.outputs[0] in marks
        and artefact not in digests_read(marks[stage.outputs[0]])
        and made_of_these(folder, stage, marks[stage.outputs[0]])
        for stage in users
    )


def made_of_these(folder: Path, stage: Stage, own: Mapping[str, str]) -> bool:
    """Whether a stage's table with the provenance ``own`` was made from the tables now there."""
    now = _Now(folder)
    return all(
        digest in now[role] for role, digest in digests_read(own).items() if role in ARTEFACTS
    )


def digests_read(own: Mapping[str, str]) -> dict[str, str]:
    """Digests of what an artefact says it was made from; none where it does not say."""
    try:
        found = json.loads(own.get(INPUTS_DIGESTS, "{}"))
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


class _Now(dict[str, tuple[str, ...]]):
    """Digests of artefacts as they are now; of one in parts that of every whole set of these.

    Those of another data set, ``<data set>/<artefact>``, stand in its folder beside this one.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.folder = folder

    def __missing__(self, role: str) -> tuple[str, ...]:
        whose, _, artefact = role.rpartition("/")
        folder = self.folder.parent / whose if whose else self.folder
        path = folder / f"{artefact}.parquet"
        sets: Sequence[str | Sequence[str]] = [str(path)] if path.is_file() else []
        found = []
        for own in sets or parts(folder, artefact):
            with suppress(InputError, OSError):
                found.append(digests({role: own})[role])
        self[role] = tuple(found)
        return self[role]


def strays(folder: Path, marks: Marks) -> Iterator[Found]:
    """Parts of tables that are of another run than what was made from them."""
    for stage in STAGES.values():
        for artefact in stage.outputs if stage.scattered else ():
            read = [digests_read(own).get(artefact) for own in marks.values()]
            whole = parts(folder, artefact)
            right = []
            for own in whole:
                with suppress(InputError, OSError):
                    right += own if digests({artefact: own})[artefact] in read else []
            there = sorted((folder / artefact).glob("*.parquet"))
            for path in there if right else ():
                if str(path) not in right:
                    what = f"is no part of what {artefact} of this folder was gathered from"
                    yield Problem(str(path), what), (Doubt(stage.name, path.stem),)


def _units(stage: Stage, marks: Marks) -> dict[str | None, list[str]]:
    """What each run of a stage left that can be read, by the part it was about."""
    if not stage.scattered:
        made = [name for name in stage.outputs if name in marks]
        return {None: made} if made else {}
    units: dict[str | None, list[str]] = {}
    for each in marks:
        name, _, part = each.partition("/")
        if part and name in stage.outputs:
            units.setdefault(part, []).append(each)
    return units


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
            maker_of(name.partition("/")[0]).name
            for value in groups
            if value != right
            for name in groups[value]
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
    """What the provenance of one run of a stage says of it and of its inputs.

    ``vouched_for`` are inputs that are those it was made from; those ``in_doubt`` are not.
    ``is_current`` is whether it was made with the code installed, ``outside`` are files it read
    of which nothing is known here.
    """

    problems: list[Problem]
    vouched_for: set[str]
    in_doubt: set[str]
    is_current: bool
    outside: set[str]
    part: str | None = None


def _held_to_inputs(
    folder: Path,
    stage: Stage,
    name: str,
    own: Mapping[str, str],
    now: _Now,
    plan: Plan | None,
) -> _Held:
    ending = {TABLES: f"{name}.parquet", PAGE: f"{name}.html"}
    where = str(folder / ending.get(stage.leaves, f"{FIGURE_FOLDER}/{name}"))
    if INPUTS_DIGESTS not in own:
        return _Held([], set(), set(), True, set())  # of an earlier version; said elsewhere
    read, problems = digests_read(own), []
    if provenance.inputs_hash(read) != own.get("inputs_hash"):
        problems.append(Problem(where, f"inputs_hash is not that of its {INPUTS_DIGESTS}"))
    whose = ("",)  # what stands before the names of tables: of lines theirs
    if stage.of_lines:
        whose = tuple(dict.fromkeys(f"{each.partition('/')[0]}/" for each in read if "/" in each))
    known = {f"{each}{name}" for each in whose for name in (*stage.inputs, *stage.optional)}
    unknown = [each for each in read if each not in known and not each.endswith("_file")]
    needed = [f"{each}{name}" for each in whose for name in stage.inputs]
    lacking = [each for each in needed if each not in read]
    if unknown or lacking:
        said = ", ".join((*unknown, *lacking))
        allowed = f"exactly what stage {stage.name} reads"
        problems.append(Problem(where, f"{INPUTS_DIGESTS} with or without {said}", allowed))
    tables = known & set(read)
    # One that is not there is said to be missing, or was left out since.
    other = {each for each in tables if now[each] and read[each] not in now[each]}
    outside, settings = set[str](), None
    if stage.leaves == TABLES:
        outside = {each for each in read if each.endswith("_file")}
    if plan is not None and stage.name in plan.stages(folder.name):
        settings = plan.settings(stage.name, folder.name)
        problems += _held_to_plan(where, stage, own, settings, plan.seed(folder.name))
        if stage.leaves != PAGE and not stage.of_lines:  # campaigns go on after those are made
            other |= _other_files(plan, stage, folder.name, read)
        outside = set()
    if other:
        what = f"was made from another {', '.join(sorted(other))}: {INPUTS_DIGESTS} differ"
        problems.insert(0, Problem(where, what, "made from what is now there"))
    vouched = set() if problems else tables
    is_current = own.get("code_hash") in _codes(stage, settings, read)
    in_doubt = {each for each in other & known if "/" not in each}  # others are told of elsewhere
    return _Held(problems, vouched, in_doubt, is_current, outside)


def _held_to_plan(
    where: str, stage: Stage, own: Mapping[str, str], settings: Mapping, seed: int
) -> Iterator[Problem]:
    wanted = provenance.config_hash(settings)
    # A page may be written by itself, with other settings of its own.
    if own.get("config_hash") != wanted and stage.leaves != PAGE:
        what = f"config_hash {own.get('config_hash')}: made with another configuration"
        yield Problem(where, what, wanted)
    if own.get("seed") != str(seed):
        yield Problem(where, f"seed {own.get('seed')}", str(seed))


def _other_files(plan: Plan, stage: Stage, dataset: str, read: Mapping[str, str]) -> set[str]:
    """Roles of files from outside that are not those a stage read, as far as they are there."""
    given = plan.inputs(stage.name, dataset)
    files = {role: str(path) for role, path in given.items() if role.endswith("_file")}
    if not all(Path(path).is_file() for path in files.values()):
        return set()
    roles = {role for role in read if role.endswith("_file")} | set(files)
    return {r for r in roles if r not in files or provenance.file_hash(files[r]) != read.get(r)}


def _codes(stage: Stage, settings: Mapping | None, read: Collection[str]) -> frozenset[str]:
    """Hashes of the code installed; for every robot it may be where the settings are not known."""
    from kinacc.kinematics import robot

    if settings is not None:
        return frozenset({provenance.stage_code_hash(stage.module, stage.used(settings, read))})
    known = ("", *robot.shipped())
    return frozenset(
        provenance.stage_code_hash(stage.module, stage.used({"robot": each}, read))
        for each in known
    )

"""What is fuzzed: how each reader is called, with what it may be given, and how far it has to come.

``past`` names a function that a reader calls once a file is parsed; an input that reaches it has
come past parsing.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import mutations
import seeds
from case import Case

from kinacc.errors import KinaccError

Random = random.Random


@dataclass(frozen=True)
class Target:
    """``seeds()`` are valid inputs, ``read(folder, options)`` is what must not fall over them.

    ``options`` may be set to one of several values each. ``share``: of all inputs. ``only``:
    endings of files that are changed. ``writes``: a folder that the reader may write into.
    """

    seeds: Callable[[], Sequence[Case]]
    read: Callable[[Path, dict], object]
    past: str
    share: float
    options: Callable[[dict, Random], dict] = lambda options, rng: options
    only: tuple[str, ...] = ()
    also: Callable[[Case, Random], Case] | None = None
    writes: str | None = None

    def case(self, name: str, seed: int, number: int) -> Case:
        """The input of a number: a seed with some changes."""
        rng = random.Random(f"{name} {seed} {number}")
        held = _pool(self.seeds)
        mutations.OTHERS = [each.files[each.first] for each in held[:40]]
        case = rng.choice(held)
        names = [each for each in case.files if not self.only or each.endswith(self.only)]
        changed = _chosen(names, case, rng)
        if rng.random() < 0.97:
            case = case.but(changed, mutations.content(changed, case.files[changed], rng))
        if self.also is not None:
            case = self.also(case, rng)
        return replace(case, options=self.options(dict(case.options), rng))


@cache
def _pool(make: Callable[[], Sequence[Case]]) -> Sequence[Case]:
    return make()


def _chosen(names: Sequence[str], case: Case, rng: Random) -> str:
    given = [each for each in case.options.get("given", names[:1]) if each in names] or names
    return rng.choice(given if rng.random() < 0.9 else names)


class CrashError(Exception):
    """A command that ended in something other than an answer or a message."""


class RefusedError(KinaccError):
    """A command that ended with a message."""


def called(*words: object) -> None:
    """Run a command as a person would; an exception that is no message comes out of it."""
    from command_line import call

    done = call(*words)
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    if done.exit_code not in (0, 1, 2) or "Traceback" in done.output:
        raise CrashError(f"exit code {done.exit_code}: {done.output[-500:]}")
    if "nested too deeply" in done.output or "not enough memory" in done.output:
        raise CrashError(done.output[-500:])
    if done.exit_code == 2:
        raise RefusedError(done.output[-500:])


# --- measured files -------------------------------------------------------------------------------

_ANSWERS = {
    "encoding": ("utf-8", "latin-1", "utf-16-le", "cp932"),
    "decimal": (".", ","),
    "thousands": (".", ",", "'", " ", "none"),
    "names": ("A,B,C", "q1,q2,q3,q4,q5,q6,x,y,z", ",", "x" * 50),
    "no_reading": ("none", "0", "9999", "nan", "x", "1e400", "0,9999"),
    "sigma": ("1", "2", "3", "none"),
    "direction_unit": ("deg", "gon", "rad"),
    "vertical": ("zenith", "horizon"),
    "horizontal": ("clockwise", "counterclockwise"),
    "sheet": ("Sheet", "x", "Points"),
    "join": ("order", "time", "name", "Point=Point", "A=B", "=", "x"),
    "clock_offset": ("0", "3600", "-1e9", "x", "nan", "1e400"),
    "pulses_per_deg": ("1344.7,1341.4,1341.4,1019.6,980.3,454.1", "1,2", "0,0,0,0,0,0", "x"),
}


def _asked(options: dict, rng: Random) -> dict:
    answers = {"sigma": "2"} if rng.random() < 0.7 else {}
    answers |= mutations.chosen(_ANSWERS, rng, 1) if rng.random() < 0.4 else {}
    take = [rng.choice(mutations.HEADERS)] if rng.random() < 0.05 else []
    return {**options, "answers": answers, "take": take, "turned": rng.random() < 0.9,
            "strict": rng.random() < 0.5}  # fmt: skip


def guessed(folder: Path, options: dict) -> None:
    """What ``init`` makes of a file before it asks, its text, and the file read by it."""
    from kinacc.cli.first_poses import poses_without_robot
    from kinacc.kinematics import robot as robots
    from kinacc.measurements.intake import guess as guesses
    from kinacc.measurements.intake import write
    from kinacc.measurements.reader import read

    given = [Path(name) for name in options["given"]]
    found = guesses.look(
        given if len(given) > 1 else given[0],
        options["take"],
        options["turned"],
        options["answers"],
    )
    if found.found.questions:
        return
    guesses.sigma_choice(found)
    found.unused()
    write.dataset_text("own", "own.robot.yaml", found, 30, "note")
    poses_without_robot(found)
    read(found.section, robots.load(options["robot"]), strict=options["strict"])


def init(folder: Path, options: dict) -> None:
    """The command, and the data set it wrote."""
    words = ["--robot", options["robot"], "--json", "--out", "out", "--name", "own", "--force"]
    for name, value in options["answers"].items():
        words += [f"--{name.replace('_', '-')}", value]
    called("init", *options["given"], *words)
    called("check-data", "out/own.yaml", "--json")


def described(folder: Path, options: dict) -> None:
    """The stage ``measurements``: a file by its description, dealt into folds."""
    from kinacc.config.schema import defaults
    from kinacc.kinematics import robot as robots
    from kinacc.measurements.reader import read, read_excluded
    from kinacc.workflow.stages.measurements import split

    usual = defaults()["measurements"]
    given = options["section"]
    section = {
        **usual["file"],
        **given,
        "orientation": usual["file"]["orientation"] | given["orientation"],
    }
    arm = robots.load(options["robot"])
    found = read(section, arm, strict=options["strict"])
    found.left_out()
    if section["exclude"]:
        read_excluded(section, arm)
    settings = {"measurements": {**usual, "folds": 3, "validation_fold": 0}, "seed": 1}
    settings["measurements"]["fold_by"] = options["fold_by"]
    split(found.columns, settings)


_CONVENTIONS = ("XYZ", "ZYX", "xyz", "zyx", "ZYZ", "XYX")
_KEYS: dict[str, Sequence[Any]] = {
    "joint_unit": ("deg", "rad"),
    "length_unit": ("mm", "m"),
    "orientation": tuple(
        {"kind": kind, "convention": convention, "unit": unit, "order": order}
        for kind in ("none", "quaternion", "rotation_vector", "euler")
        for convention in _CONVENTIONS
        for unit in ("deg", "rad")
        for order in ("wxyz", "xyzw")
    ),
    "targets": (None, ["mA"], ["tool"], ["mA", "mB"], ["x"], ["nominal"]),
    "delimiter": (",", ";", "\t", " ", "blanks"),
    "decimal": (".", ","),
    "thousands": (None, ".", ",", " ", "'"),
    "encoding": ("utf-8", "utf-16-le", "utf-16-be", "latin-1", "cp932"),
    "sheet": (None, "Sheet", "x"),
    "layout": ("table", "features", "spherical"),
    "directions": tuple(
        {"unit": unit, "vertical": vertical, "horizontal": horizontal}
        for unit in ("deg", "gon", "rad")
        for vertical in ("zenith", "horizon")
        for horizontal in ("clockwise", "counterclockwise")
    ),
    "no_reading": ([], [0.0], [9999.999], [-1e38, 0.0], [1e20]),
    "sigma": (1, 2, 3),
    "names": (
        None,
        ["a"],
        ["x", "y", "z"],
        ["Collection", "Group", "Point", "X", "Y", "Z"],
        ["x"] * 12,
    ),
    "skip_lines": (0, 1, 2, 5, 10_000),
    "skip_under_names": (0, 1, 3, 100),
    "pulses_per_deg": (None, [1344.7, 1341.4, 1341.4, 1019.6, 980.3, 454.1], [1.0] * 4, [0.0] * 6),
    "repeats_in_names": (True, False),
    "exclude": tuple(
        [{"lines": lines, "reason": "slip"}] for lines in ([2], [1], [2, 3, 4], [10**6])
    ),
}


def _section(options: dict, rng: Random) -> dict:
    section = dict(options["section"])
    if rng.random() < 0.3:
        section |= mutations.chosen(_KEYS, rng)
    if rng.random() < 0.1:
        name = rng.choice(("q1", "q7", "x", "pose", "target", "repeat", "session", "temperature", "s1",
                           "q1_cmd", "payload", "qw", "e1", "std_x", "cov_xx", "mA_x"))  # fmt: skip
        section["columns"] = {**section.get("columns", {}), name: rng.choice(mutations.HEADERS)}
    if section.get("joints") and rng.random() < 0.2:
        joints = {"by": ("name", "time", "order"), "clock_offset_s": (0.0, 1e10), "within_s": (1e-3, 3600.0),
                  "key": (None, "x", "name"), "delimiter": (",", ";"), "skip_lines": (0, 1, 50)}  # fmt: skip
        section["joints"] = {**section["joints"], **mutations.chosen(joints, rng)}
    return {**options, "section": section, "strict": rng.random() < 0.5,
            "fold_by": rng.choice(("whole", "time_block"))}  # fmt: skip


def _all_described() -> Sequence[Case]:
    return seeds.with_description()


def examined(folder: Path, options: dict) -> None:
    """``check-data`` of a described file."""
    from kinacc.checks import check
    from kinacc.config.schema import defaults
    from kinacc.kinematics import robot as robots
    from kinacc.measurements.layout import Layout
    from kinacc.measurements.reader import read

    usual = defaults()["measurements"]["file"]
    given = options["section"]
    section = {**usual, **given, "orientation": usual["orientation"] | given["orientation"]}
    arm = robots.load(options["robot"])
    reading = read(section, arm, strict=False)
    found = check.check(
        reading, Layout.of(section), arm, "own", section["path"], lambda items, words: items
    )
    found.as_text()
    found.as_dict()


# --- robots and configurations --------------------------------------------------------------------


def robot_file(folder: Path, options: dict) -> None:
    """A robot file, written again and read back."""
    from kinacc.kinematics import robot as robots

    name = options["file"]
    robots.files(name)
    arm = robots.load(name)
    robots.of_text(robots.as_yaml(arm), "again")
    robots.forward(arm, 0.5 * (arm.q_min_rad + arm.q_max_rad)[None])


def configuration(folder: Path, options: dict) -> None:
    """A configuration, alone or over the paper's."""
    from kinacc.workflow.contradictions import load

    load(["own.yaml"], options.get("overrides") or None)


_OVERRIDES = (
    None,
    None,
    {"study": {"alpha": 10**5000}},
    {"study": {"alpha": "x"}},
    {"datasets": {}},
    {"datasets": {"own": {"robot": "mh180"}}},
    {"seed": float("nan")},
    {"measurements": None},
)


# --- campaigns ------------------------------------------------------------------------------------


def campaign(folder: Path, options: dict) -> None:
    """A campaign's folder, where it stands, and what is said of it."""
    from kinacc.campaign import marks, words
    from kinacc.campaign.folder import open_
    from kinacc.cli import campaigns_answers as answers

    opened = open_(".")
    state = opened.state()
    marks.doubts(opened)
    words.standing(state)
    words.statements(state)
    answers.as_facts(state, 1.0)
    if state.asked is not None:
        answers.next_in_words(state)


def _chained(case: Case, rng: Random) -> Case:
    """Give changed lines of a journal the hashes that fit them, mostly."""
    import json

    from kinacc.campaign import journal, plan

    if journal.JOURNAL not in case.files or rng.random() < 0.1:
        return case
    if rng.random() < 0.8:  # what was confirmed is known to this machine alone
        case = replace(case, files={k: v for k, v in case.files.items() if k != "head.json"})
    last, lines = plan.digest(case.files[journal.PLAN]), []
    for line in case.files[journal.JOURNAL].split(b"\n"):
        try:
            entry = json.loads(line)["entry"]
            entry = mutations.tree(entry, rng) if rng.random() < 0.08 else entry
            last = journal._chained(last, entry)
            lines.append(json.dumps({"chain": last, "entry": entry}, sort_keys=True).encode())
        except (ValueError, KeyError, TypeError, RecursionError):
            lines.append(line)
    if rng.random() < 0.02:
        lines.append(
            rng.choice((b"[" * 100_000, b'{"entry": {"a": ' + b"9" * 100_000 + b"}}", b"[]"))
        )
    return case.but(journal.JOURNAL, b"\n".join(lines))


# --- joints and poses given to commands -----------------------------------------------------------


@cache
def _calibration() -> Any:
    from kinacc.deployment.record import nominal
    from kinacc.kinematics import robot as robots

    return nominal(robots.load("mh180"))


def joints_given(folder: Path, options: dict) -> None:
    """``predict``: joints of a file, and poses there."""
    from kinacc.cli import tables
    from kinacc.deployment.predict import predict

    held = _calibration()
    given = tables.given_joints(held.robot, options["given"], (), (), options["answers"])
    predict(
        held,
        given.joints,
        given.directions,
        "base",
        None,
        lambda items, words: items,
        given.payload,
    )


def poses_given(folder: Path, options: dict) -> None:
    """``compensate``: poses of a file, and the joints for them."""
    from kinacc.cli import target_poses
    from kinacc.deployment.compensate import compensate

    held = _calibration()
    path, program = (None, options["given"]) if options["program"] else (options["given"], None)
    given = target_poses.poses(held, path, (), options["near"], program, "base", None)
    found = compensate(
        held, given.pose, given.joints, given.directions, "base", None, given.payload
    )
    unlike = target_poses.unlike_measured(held, found, None)
    target_poses.compensated(held, given, found, "base", None, unlike, program is not None)


def words_given(folder: Path, options: dict) -> None:
    """Numbers given as arguments: joints, a pose, joints to be near to."""
    from kinacc.cli import rows, target_poses

    held = _calibration()
    kind, words = options["kind"], options["words"]
    if kind == "pose":
        target_poses.poses(held, None, (words,), options.get("near"), None, "base", None)
    else:
        found = rows.of_arguments((words,), kind, held.robot, "--joints")
        given = rows.Rows(1, found[:, 0], found, None, None, ())
        rows.require_within_limits(held.robot, given, "joints")


def _arguments(options: dict, rng: Random) -> dict:
    kind = rng.choice(("deg", "rad", "pose"))
    numbers = (
        ["1500", "200", "900", "0", "1", "0", "0"]
        if kind == "pose"
        else ["10", "-20", "30", "0", "1", "0"]
    )
    for _ in range(rng.choice((0, 1, 1, 2))):
        at = rng.randrange(len(numbers))
        numbers[at] = mutations._number(numbers[at], rng)
    words = rng.choice((",", ", ", " ", ";")).join(numbers)
    near = rng.choice((None, "0,0,0,0,0,0", mutations.odd(rng)))
    return {"kind": kind, "words": words, "near": near}


def _rows_options(options: dict, rng: Random) -> dict:
    answers = {"encoding": ("latin-1", "utf-16-le"), "decimal": (".", ","), "thousands": (".", "none"),
               "names": ("a,b", "q1,q2,q3,q4,q5,q6"), "take": (("x",), ("q1_deg",)),
               "joint_unit": ("deg", "rad"), "pulses_per_deg": ("1,2,3,4,5,6", "x")}  # fmt: skip
    return {**options, "answers": mutations.chosen(answers, rng, 1), "program": rng.random() < 0.4,
            "near": rng.choice((None, "0,0,0,0,0,0"))}  # fmt: skip


def _joint_seeds() -> Sequence[Case]:
    return [replace(each, options={"given": each.first}) for each in seeds.joint_files()]


def _pose_seeds() -> Sequence[Case]:
    own = ("rows.csv", "rows.parquet", "rows.json")
    return [each for each in _joint_seeds() if each.first in own]


def compared(folder: Path, options: dict) -> None:
    """``compare``: two robot files, at the joints of a file."""
    joints = ["--joints", options["joints"]] if options["joints"] else []
    called("compare", "a.yaml", "b.yaml", "--poses", 10, "--json", *joints)


def _pairs() -> Sequence[Case]:
    rows = [each for each in seeds.joint_files() if "rows.csv" in each.files]
    arm = (seeds.SHIPPED / "mh180.yaml").read_bytes()
    return [Case({"a.yaml": arm, "b.yaml": arm, **each.files}) for each in rows]


# --- artefacts ------------------------------------------------------------------------------------


def _tables() -> Sequence[Case]:
    held = {Path(name).name: data for name, data in seeds.small_results().items()}
    return [Case({name: data}) for name, data in held.items() if name.endswith(".parquet")]


def _sealed(case: Case, rng: Random) -> Case:
    """Give a changed table the digest that fits its columns, mostly: anyone can compute it."""
    import io

    import pyarrow.parquet as pq

    from kinacc.artifacts.contract import COLUMNS_DIGEST
    from kinacc.artifacts.digests import columns_digest

    changed = [name for name in case.files if name.endswith(".parquet")]
    if len(changed) > 1:
        before = seeds.small_results()
        changed = [name for name in changed if case.files[name] != before[name]]
    if not changed or rng.random() < 0.1:
        return case
    try:
        table = pq.read_table(io.BytesIO(case.files[changed[0]]))
        kept = {**(table.schema.metadata or {}), COLUMNS_DIGEST.encode(): columns_digest(table)}
        written = io.BytesIO()
        pq.write_table(table.replace_schema_metadata(kept), written, write_page_checksum=True)
    except Exception:  # no longer a table, or of types without a digest
        return case
    return case.but(changed[0], written.getvalue())


def table_read(folder: Path, options: dict) -> None:
    """A table alone: read, its metadata, shown."""
    from kinacc.artifacts import store

    name = options["file"]
    store.read_metadata(Path(name))
    store.read(Path(name))


def table_shown(folder: Path, options: dict) -> None:
    """``show`` of a table, in one of its forms."""
    called("show", options["file"], *options["form"])


_FORMS = (
    (),
    ("--describe",),
    ("--json",),
    ("--csv",),
    ("--plot",),
    ("--columns", "q*"),
    ("--where", "pose=1"),
)


def _results() -> Sequence[Case]:
    return [
        Case(
            seeds.small_results(),
            {"given": [name for name in seeds.small_results() if "parquet" in name]},
        )
    ]


def results_used(folder: Path, options: dict) -> None:
    """The results of a data set as predictions take them."""
    import numpy as np

    from kinacc.cli import choice
    from kinacc.deployment.predict import predict

    held = choice.calibration_of("mh180", options["model"], None, ())
    predict(
        held,
        np.zeros((1, held.robot.dh.joints)),
        None,
        "base",
        None,
        lambda items, words: items,
        None,
    )


def results_checked(folder: Path, options: dict) -> None:
    """``check-results``, ``fitted`` and ``summary`` of a results folder."""
    if options["command"] == "check-results":
        from kinacc.workflow.verification.check import check_results

        str(check_results("."))
    else:
        called(options["command"], *(("mh180",) if options["command"] == "fitted" else (".",)))


def _first(
    cases: Callable[[], Sequence[Case]], name: str | None = None
) -> Callable[[], Sequence[Case]]:
    def made() -> Sequence[Case]:
        return [
            replace(each, options={**each.options, "file": name or next(iter(each.files))})
            for each in cases()
        ]

    return made


_LOADED = "kinacc.measurements.reader.convert"
TARGETS: dict[str, Target] = {
    "measured file": Target(
        seeds.as_they_come, guessed, "kinacc.measurements.intake.guess.name_of", 0.07, _asked
    ),
    "described text or workbook": Target(_all_described, described, _LOADED, 0.15, _section),
    "described Parquet": Target(seeds.parquet_files, described, _LOADED, 0.06, _section),
    "described workbook": Target(seeds.workbooks, described, _LOADED, 0.012, _section),
    "check-data": Target(_all_described, examined, _LOADED, 0.001, _section),
    "init": Target(
        seeds.as_they_come, init, "kinacc.measurements.intake.guess.name_of", 0.001, _asked, writes="out"
    ),
    "robot": Target(
        _first(seeds.robots, "arm.yaml"), robot_file, "kinacc.kinematics.robot.description.Reader", 0.20,
    ),
    "URDF": Target(_first(seeds.urdfs), robot_file, "kinacc.kinematics.robot.urdf._joints_alone", 0.18),
    "configuration": Target(
        seeds.configurations, configuration, "kinacc.config.load._resolve", 0.15,
        lambda options, rng: {**options, "overrides": rng.choice(_OVERRIDES) if rng.random() < 0.1 else None},
        only=(".yaml",),
    ),
    "campaign": Target(seeds.campaign, campaign, "kinacc.campaign.plan._plan", 0.04, also=_chained),
    "joints": Target(_joint_seeds, joints_given, "kinacc.cli.rows.numbers kinacc.measurements.intake.joint_files.name_of", 0.05, _rows_options),
    "poses": Target(_pose_seeds, poses_given, "kinacc.cli.rows.numbers", 0.04, _rows_options),
    "numbers on the command line": Target(
        lambda: [Case({"none.txt": b""})], words_given, "kinacc.cli.rows.numbers_of", 0.04, _arguments
    ),
    "compare": Target(
        _pairs, compared, "kinacc.cli.comparison_report.require_alike", 0.001,
        lambda options, rng: {"joints": rng.choice((None, "rows.csv"))},
    ),
    "table": Target(_first(_tables), table_read, "kinacc.artifacts.store.columns_in", 0.04, also=_sealed),
    "show": Target(
        _first(_tables), table_shown, "kinacc.cli.show_table.words", 0.001,
        lambda options, rng: {**options, "form": rng.choice(_FORMS)}, also=_sealed,
    ),
    "results used": Target(
        _results, results_used, "kinacc.deployment.folder.calibration", 0.005,
        lambda options, rng: {**options, "model": rng.choice((None, "dh", "vec", "nominal"))},
        also=_sealed,
    ),
    "results checked": Target(
        _results, results_checked, "kinacc.workflow.verification.check.check_dataset", 0.001,
        lambda options, rng: {**options, "command": rng.choice(("check-results", "check-results", "fitted", "summary"))},
    ),
}  # fmt: skip

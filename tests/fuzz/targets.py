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

from fuzz import mutations, readers, seeds, texts, trees
from fuzz.case import Case

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
        texts.OTHERS = [each.files[each.first] for each in held[:40]]
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
    take = [rng.choice(texts.HEADERS)] if rng.random() < 0.05 else []
    return {**options, "answers": answers, "take": take, "turned": rng.random() < 0.9,
            "strict": rng.random() < 0.5}  # fmt: skip


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
        name = rng.choice(("q1", "q7", "x", "pose", "target", "repeat", "session",
                           "temperature", "s1", "q1_cmd", "payload", "qw", "e1",
                           "std_x", "cov_xx", "mA_x"))  # fmt: skip
        section["columns"] = {**section.get("columns", {}), name: rng.choice(texts.HEADERS)}
    if section.get("joints") and rng.random() < 0.2:
        joints = {"by": ("name", "time", "order"), "clock_offset_s": (0.0, 1e10),
                  "within_s": (1e-3, 3600.0), "key": (None, "x", "name"), "delimiter": (",", ";"),
                  "skip_lines": (0, 1, 50)}  # fmt: skip
        section["joints"] = {**section["joints"], **mutations.chosen(joints, rng)}
    return {**options, "section": section, "strict": rng.random() < 0.5,
            "fold_by": rng.choice(("whole", "time_block"))}  # fmt: skip


# --- robots and configurations --------------------------------------------------------------------


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
            entry = trees.tree(entry, rng) if rng.random() < 0.08 else entry
            last = journal._chained(last, entry)
            lines.append(json.dumps({"chain": last, "entry": entry}, sort_keys=True).encode())
        except (ValueError, KeyError, TypeError, RecursionError):
            lines.append(line)
    if rng.random() < 0.02:
        long = (b"[" * 100_000, b'{"entry": {"a": ' + b"9" * 100_000 + b"}}", b"[]")
        lines.insert(rng.randrange(len(lines)), rng.choice(long))
    return case.but(journal.JOURNAL, b"\n".join(lines))


# --- joints and poses given to commands -----------------------------------------------------------


def _arguments(options: dict, rng: Random) -> dict:
    kind = rng.choice(("deg", "rad", "pose"))
    numbers = (
        ["1500", "200", "900", "0", "1", "0", "0"]
        if kind == "pose"
        else ["10", "-20", "30", "0", "1", "0"]
    )
    for _ in range(rng.choice((0, 1, 1, 2))):
        at = rng.randrange(len(numbers))
        numbers[at] = texts.number(numbers[at], rng)
    words = rng.choice((",", ", ", " ", ";")).join(numbers)
    near = rng.choice((None, "0,0,0,0,0,0", texts.odd(rng)))
    return {"kind": kind, "words": words, "near": near}


def _rows_options(options: dict, rng: Random) -> dict:
    answers = {"encoding": ("latin-1", "utf-16-le"), "decimal": (".", ","),
               "thousands": (".", "none"), "names": ("a,b", "q1,q2,q3,q4,q5,q6"),
               "take": (("x",), ("q1_deg",)), "joint_unit": ("deg", "rad"),
               "pulses_per_deg": ("1,2,3,4,5,6", "x")}  # fmt: skip
    return {**options, "answers": mutations.chosen(answers, rng, 1), "program": rng.random() < 0.4,
            "near": rng.choice((None, "0,0,0,0,0,0"))}  # fmt: skip


def _joint_seeds() -> Sequence[Case]:
    return [replace(each, options={"given": each.first}) for each in seeds.joint_files()]


def _pose_seeds() -> Sequence[Case]:
    own = ("rows.csv", "rows.parquet", "rows.json")
    return [each for each in _joint_seeds() if each.first in own]


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
    from kinacc.artifacts.digests import columns_digest

    from kinacc.artifacts.contract import COLUMNS_DIGEST

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


def _first(
    cases: Callable[[], Sequence[Case]], name: str | None = None
) -> Callable[[], Sequence[Case]]:
    def made() -> Sequence[Case]:
        return [
            replace(each, options={**each.options, "file": name or next(iter(each.files))})
            for each in cases()
        ]

    return made


def _overridden(options: dict, rng: Random) -> dict:
    return {**options, "overrides": rng.choice(_OVERRIDES) if rng.random() < 0.1 else None}


def _shown(options: dict, rng: Random) -> dict:
    return {**options, "form": rng.choice(_FORMS)}


def _by_model(options: dict, rng: Random) -> dict:
    return {**options, "model": rng.choice((None, "dh", "vec", "nominal"))}


def _by_command(options: dict, rng: Random) -> dict:
    return {
        **options,
        "command": rng.choice(("check-results", "check-results", "fitted", "summary")),
    }


def _at_joints(options: dict, rng: Random) -> dict:
    return {"joints": rng.choice((None, "rows.csv"))}


def _nothing() -> Sequence[Case]:
    return [Case({"none.txt": b""})]


_LOADED = "kinacc.measurements.reader.convert"
_LOOKED = "kinacc.measurements.intake.guess.name_of"
_ROWS = "kinacc.cli.rows.numbers"
_ANY_ROWS = f"{_ROWS} kinacc.measurements.intake.joint_files.name_of"
_ROBOT = "kinacc.kinematics.robot.description.Reader"
_CHAIN = "kinacc.kinematics.robot.urdf._joints_alone"
_SET = "kinacc.config.load._resolve"
_PLAN = "kinacc.campaign.plan._plan"
_ARGUMENT = "kinacc.cli.rows.numbers_of"
_ALIKE = "kinacc.cli.comparison_report.require_alike"
_TABLE = "kinacc.artifacts.store.columns_in"
_USED = "kinacc.deployment.folder.calibration"
_CHECKED = "kinacc.workflow.verification.check.check_dataset"
TARGETS: dict[str, Target] = {
    "measured file": Target(seeds.as_they_come, readers.guessed, _LOOKED, 0.04, _asked),
    "described text or workbook": Target(
        seeds.with_description, readers.described, _LOADED, 0.15, _section
    ),
    "described Parquet": Target(seeds.parquet_files, readers.described, _LOADED, 0.06, _section),
    "described workbook": Target(seeds.workbooks, readers.described, _LOADED, 0.006, _section),
    "check-data": Target(seeds.with_description, readers.examined, _LOADED, 0.001, _section),
    "init": Target(seeds.as_they_come, readers.init, _LOOKED, 0.001, _asked, writes="out"),
    "robot": Target(_first(seeds.robots, "arm.yaml"), readers.robot_file, _ROBOT, 0.22),
    "URDF": Target(_first(seeds.urdfs), readers.robot_file, _CHAIN, 0.24),
    "configuration": Target(
        seeds.configurations, readers.configuration, _SET, 0.1, _overridden, only=(".yaml",)
    ),
    "campaign": Target(seeds.campaign, readers.campaign, _PLAN, 0.03, also=_chained),
    "joints": Target(_joint_seeds, readers.joints_given, _ANY_ROWS, 0.05, _rows_options),
    "poses": Target(_pose_seeds, readers.poses_given, _ROWS, 0.04, _rows_options),
    "numbers on the command line": Target(
        _nothing, readers.words_given, _ARGUMENT, 0.06, _arguments
    ),
    "compare": Target(_pairs, readers.compared, _ALIKE, 0.001, _at_joints),
    "table": Target(_first(_tables), readers.table_read, _TABLE, 0.04, also=_sealed),
    "show": Target(_first(_tables), readers.table_shown, _TABLE, 0.001, _shown, also=_sealed),
    "results used": Target(_results, readers.results_used, _USED, 0.003, _by_model, also=_sealed),
    "results checked": Target(_results, readers.results_checked, _CHECKED, 0.001, _by_command),
}

"""The changes that are planted in a finished study, and what each of them is the cause of.

A change is told by a name, an action and its arguments, so that a list of them is the same on every
machine; `carried_out` does it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from code_changes import COMMENTED, DATA_FILES, SCALED, STAGES, WRAPPED
from worlds import ALL, SOURCE, World, other_numbers, other_version, rerun

from kinacc.workflow.catalogue import TABLES

OWN, PAPER = "own", "mh180"
WORSE = "worse calibration"


@dataclass(frozen=True)
class Change:
    """One thing that is changed.

    ``family`` groups it in the table. ``causes`` are (kind, pattern of where) of the gate's answer,
    of which every difference has to name one at least and nothing else. ``random``: only the seed
    or the number of repetitions changed: random results may be held to their standard error.
    ``code``: file of the package, a text in it and what stands there instead (at its end where
    there is no such text), changed before anything is imported. ``only``: of several changes at
    once, those that lead to artefacts of a pattern of ``data set/artefact``.
    """

    name: str
    family: str
    action: str
    given: Mapping[str, object] = field(default_factory=dict)
    causes: tuple[tuple[str, str], ...] = ()
    random: bool = False
    code: tuple[str, str, str] | None = None
    only: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = ()


def configured(name: str, values: Mapping[str, object], where: str, family: str, **more) -> Change:
    """One value of the configuration."""
    given = {"values": values}
    return Change(name, family, "configure", given, (("configuration", where),), **more)


def everything(seed: int = 16) -> list[Change]:
    """The 200 changes, the same for the same seed."""
    draw = np.random.default_rng(seed)
    found = [
        *_inputs(draw),
        *_code(),
        *_versions(),
        *_configuration(),
        *_seeds(),
        *_swapped(),
        *_edited(draw),
        *_machine(),
        *_worse(draw),
        *_two_at_once(),
    ]
    assert len({each.name for each in found}) == len(found), "two changes of one name"
    return found


POSES = (("input", r"poses\.csv|measurements_file|measurements\.file\.path"),)
ROBOT = (("input", r"own_arm\.yaml|robot_file"),)


def _inputs(draw: np.random.Generator) -> Iterator[Change]:
    columns = ("q1_deg", "q2_deg", "q3_deg", "q5_deg", "x_mm", "y_mm", "z_mm")
    for number in range(18):
        column, size = str(draw.choice(columns)), 10.0 ** draw.uniform(-3, -0.3)
        if column.endswith("_deg"):
            size /= 10  # the check of the data refuses joints that are farther off
        by = float(f"{size:.1g}") * float(draw.choice([-1, 1]))
        given = {"row": int(draw.integers(6, 40)), "column": column, "by": by}
        said = f"input: row {given['row']}, {column} by {by:g} ({number})"
        yield Change(said, "number of an input file", "cell", given, POSES)
    for row in (7, 11, 19, 33):  # far below what is told apart
        given = {"row": row, "column": "x_mm", "by": 1e-9}
        yield Change(f"input: row {row}, x_mm by 1e-9", "input, no numbers", "cell", given, POSES)
    for number, (old, new) in enumerate(
        [("a_mm: 325", "a_mm: 325.5"), ("a_mm: 1150", "a_mm: 1149"), ("-1225", "-1225.25")]
    ):
        given = {"file": "own_arm.yaml", "old": old, "new": new}
        yield Change(f"robot: {new} ({number})", "number of an input file", "text", given, ROBOT)
    given = {"file": "own_arm.yaml", "old": "dh: #", "new": "dh: # seen again:"}
    yield Change("robot: a comment", "input, no numbers", "text", given, ROBOT)


def _code() -> Iterator[Change]:
    for module, function, factor in WRAPPED:
        code = (_file_of(module), "", _WRAPPER.format(name=function, factor=factor))
        where = (("code", rf"^{re.escape(module)}$"),)
        said = f"code: {module}.{function}"
        yield Change(said, "code of a module", "nothing", {}, where, code=code)
    for module, artefact, column, factor in SCALED:
        said = f"code: {module}, {column} of {artefact}"
        text = _SCALER.format(artefact=artefact, column=column, factor=factor)
        where = (("code", rf"^{re.escape(module)}$"),)
        code = (_file_of(module), "", text)
        yield Change(said, "code of a module", "nothing", {}, where, code=code)
    for module in COMMENTED:
        code = (_file_of(module), "", "\n# a remark\n")
        where = (("code", rf"^{re.escape(module)}$"),)
        yield Change(f"comment: {module}", "code, a comment", "nothing", {}, where, code=code)
    for path, old, new in DATA_FILES:
        said, where = f"data file: {path}, {new}", (("code", re.escape(path)),)
        yield Change(said, "code of a module", "nothing", {}, where, code=(path, old, new))


_WRAPPER = """

_before_the_change = {name}


def {name}(*given, **named):
    return _before_the_change(*given, **named) * {factor}
"""


_SCALER = """

import functools as _functools

import numpy as _numpy

_before_the_change = run


@_functools.wraps(_before_the_change)
def run(*given, **named):
    made = dict(_before_the_change(*given, **named))
    if "{artefact}" in made:
        table = dict(made["{artefact}"])
        table["{column}"] = _numpy.asarray(table["{column}"], dtype=float) * {factor}
        made["{artefact}"] = table
    return made
"""


def _file_of(module: str) -> str:
    parts = module.split(".")[1:]
    return (
        "/".join([*parts, "__init__.py"])
        if SOURCE.joinpath(*parts).is_dir()
        else ("/".join(parts) + ".py")
    )


LIBRARIES = {"numpy": "9.9.9", "scipy": "8.1.0", "numba": "3.2.1", "pyarrow": "99.0.0"}


def _versions() -> Iterator[Change]:
    numbers = {**LIBRARIES, "pytransform3d": "9.0.0", "python": "3.14", "kinacc": "9.9.9"}
    for name, number in numbers.items():
        given = {"name": name, "number": number}
        cause = (("version", rf"(?i)\b{name}\b"),)
        yield Change(f"version: {name}", "version, no numbers", "version", given, cause)
        for module, function, factor in VERSION_SLIPS.get(name, ()):
            slip = {"module": module, "function": function, "factor": factor}
            said = f"version: {name}, {function} times {factor}"
            yield Change(said, "version", "version", {**given, "slip": slip}, cause)


_SLIPS = (
    ("kinacc.geometry", "exp_so3", 1 + 1e-7),
    ("kinacc.distributions", "gamma99", 1.001),
    ("kinacc.assess.outlier_rejection", "largest_inlier", 1.01),
)
VERSION_SLIPS = {
    "numpy": _SLIPS,
    "scipy": _SLIPS,
    "numba": _SLIPS[2:],
    "python": _SLIPS,
    "kinacc": _SLIPS[1:],
}


def _configuration() -> Iterator[Change]:
    for key, values in CONFIGURED.items():
        for value in values:
            where = re.escape(key.rpartition("/")[2])
            said = f"{key}: {value}"
            yield configured(said, _nested(key, value), where, "configuration value")


def _nested(key: str, value: object) -> dict[str, object]:
    """One value as a configuration; of one data set where the key begins with its name."""
    whose, _, path = key.rpartition("/")
    for part in reversed([*(("datasets", whose) if whose else ()), *path.split(".")]):
        value = {part: value}
    return value


CONFIGURED: dict[str, tuple[object, ...]] = {
    "calibration.vec.order": (1, 3),
    "calibration.vec.prior_std_mm": (0.5,),
    "calibration.vec.prior_decay": (0.5,),
    "calibration.vec.joint_range_margin_deg": (4.0,),
    "calibration.vec.travel_direction": (True,),
    "calibration.dh.truncation": (0.002,),
    "calibration.dh.loss": ("huber",),
    "calibration.dh.fit_to": ("measurements",),
    "calibration.rotation_weight_mm_per_rad": (100.0,),
    "measurements.folds": (3, 5),
    "measurements.validation_fold": (1,),
    "measurements.synthetic.poses": (90,),
    "measurements.synthetic.draw": (1,),
    "measurements.synthetic.tracker_noise_mm": (0.03,),
    "measurements.synthetic.ripple": (0.5,),
    "evaluation.points": (11,),
    "evaluation.sequence": ("halton",),
    "mh180/evaluation.rotation_deg": (30.0,),
    "mh180/evaluation.cylinder.inner_radius_mm": (1250.0,),
    "mh180/evaluation.tool_mm": ([0.0, 0.0, 50.0],),
    "map.grid_mm": (200.0,),
    "map.slices_deg": ([0, 20],),
    "study.noise_mm": ([0.1, 0.2], [0.1]),
    "study.measurements": (15,),
    "study.alpha": (0.7,),
    "study.outlier_rule": ("iqr",),
    "study.search": ("from_below",),
    "study.visiting_order": ("shuffled",),
    "histories.noise_mm": (0.2,),
    "histories.eta_ratio_kept": (1.2,),
    "own/calibration.compliance.joints": ([2], [2, 3, 5]),
    "own/calibration.compliance.payload.mass_kg": (50.0,),
    "own/measurements.file.exclude": ([{"lines": [5, 8], "reason": "touched"}],),
}


def _seeds() -> Iterator[Change]:
    for seed in (21, 22, 5, 1, 1000, 77):
        where = (("seed", ""), ("configuration", r"^seed$"))
        yield Change(
            f"seed: {seed}", "seed", "configure", {"values": {"seed": seed}}, where, random=True
        )
    for count in (3, 5, 6, 8, 10, 2):
        values = {"study": {"repetitions": count}}
        yield configured(
            f"repetitions: {count}", values, r"study\.repetitions", "repetitions", random=True
        )


# Another run differs in these; its record says so where it came with the table.
ANOTHER_RUN = (("seed", ""), ("configuration", ""), ("input", ""), ("unexplained", ""))
SWAPPED = (
    (OWN, "dh"), (OWN, "vec"), (OWN, "residuals"), (OWN, "measurements"), (OWN, "compliance"),
    (PAPER, "dh"), (PAPER, "vec"), (PAPER, "residuals"), (PAPER, "accuracy_map"),
    (PAPER, "assessment_points"), (PAPER, "study"), (PAPER, "histories"), (PAPER, "summary"),
)  # fmt: skip
TABLES_SWAPPED = (
    (OWN, "dh_model"), (OWN, "pose_errors"), (OWN, "summary"), (PAPER, "measurements"),
    (PAPER, "accuracy_map"), (PAPER, "study_summary"),
)  # fmt: skip


def _swapped() -> Iterator[Change]:
    nothing = (("unexplained", ""),)
    for dataset, artefact in TABLES_SWAPPED:
        for renewed in (False, True):
            given = {"dataset": dataset, "artefact": artefact, "renewed": renewed}
            said = f"swapped: {dataset}/{artefact}{', digests renewed' * renewed}"
            yield Change(said, "swapped artefact", "swap", given, nothing)
    for dataset, stage in SWAPPED:
        given = {"dataset": dataset, "stage": stage}
        said = f"swapped with its record: {dataset}/{stage}"
        yield Change(said, "swapped artefact", "swap_stage", given, ANOTHER_RUN)


EDITED = (
    (OWN, "pose_errors"), (OWN, "residuals"), (OWN, "assessment_points"), (PAPER, "accuracy_map"),
    (PAPER, "study_summary"), (PAPER, "dh_model"),
)  # fmt: skip


def _edited(draw: np.random.Generator) -> Iterator[Change]:
    for dataset, artefact in EDITED:
        for renewed in (False, True):
            given = {
                "dataset": dataset,
                "artefact": artefact,
                "renewed": renewed,
                "draw": int(draw.integers(1000)),
            }
            said = f"edited: {dataset}/{artefact}{', digests renewed' * renewed}"
            yield Change(said, "edited artefact", "edit", given, (("unexplained", ""),))


def _machine() -> Iterator[Change]:
    """Numbers that come out otherwise, though nothing that they are made from has changed."""
    stages = {"exp_so3": "vec", "gamma99": "residuals", "largest_inlier": "study_chunk"}
    for module, function, factor in _SLIPS:
        for dataset in (OWN, PAPER):
            slip = {"module": module, "function": function, "factor": factor}
            given = {"slip": slip, "dataset": dataset, "stage": stages[function]}
            said = f"not the same twice: {dataset}, {function}"
            yield Change(said, "not deterministic", "again", given, (("unexplained", ""),))


def _worse(draw: np.random.Generator) -> Iterator[Change]:
    for noise in (0.5, 1.0, 2.0, 3.0):
        given = {"noise_mm": noise, "draw": int(draw.integers(1000))}
        yield Change(f"worse: {noise:g} mm of noise", WORSE, "noise", given, POSES)
    for rows in (34, 30, 27):
        yield Change(f"worse: {rows} poses", WORSE, "fewer", {"rows": rows}, POSES)
    for share in (0.1, 0.2, 0.3):
        yield configured(
            f"worse: truncation {share:g}",
            {"calibration": {"dh": {"truncation": share}}},
            r"calibration\.dh\.truncation",
            WORSE,
        )


def _two_at_once() -> Iterator[Change]:
    """Two changes, of which each table follows from one, from the other or from both."""
    scaled = {f"{module}, {artefact}": each for each in SCALED for module, artefact, *_ in [each]}
    pairs = (
        ("study.alpha", 0.5, "accuracy_map, accuracy_map", "/(study|readings|histories)", "/acc"),
        ("map.grid_mm", 200.0, "summary, summary", "/accuracy_map", "/summary"),
        ("study.noise_mm", [0.2], "histories, histories", "/(study|readings)", "/histories"),
        ("histories.noise_mm", 0.2, "study, study_summary", "/histories", "/study"),
        ("mh180/evaluation.points", 14, "summary, summary", "/(ass|study|read|his)", "/summary"),
        ("map.grid_mm", 125.0, "excluded_rows, excluded_rows", "/acc", "/excluded"),
    )
    for key, value, name, by_key, by_code in pairs:
        module, artefact, column, factor = scaled[f"{STAGES}.{name}"]
        where = (("configuration", re.escape(key.rpartition("/")[2])),)
        code = (("code", rf"^{re.escape(module)}$"),)
        text = _SCALER.format(artefact=artefact, column=column, factor=factor)
        yield Change(
            f"two: {key}: {value} and {module}",
            "two changes",
            "configure",
            {"values": _nested(key, value)},
            (*where, *code),
            code=(_file_of(module), "", text),
            only=((by_key, where), (by_code, code)),
        )


# Actions.


def carried_out(change: Change, world: World, older: World, scratch: Path) -> list[str]:
    """Plant the change and rerun what has to be; the stages that were run."""
    given = dict(change.given)
    slip = given.pop("slip", None)
    with _slip(slip):
        if change.action == "version":
            with other_version(given["name"], given["number"], scratch / "versions"):
                return rerun(world.plan())
        if change.action == "again":
            again(world, given["dataset"], given["stage"])
            return rerun(world.plan())
        ACTIONS[change.action](world, older, **given)
        if change.action in AFTERWARDS:
            return []
        # Gates of the configuration are asked where all results hold, pictures too.
        return rerun(world.plan(), leaves=ALL if change.family == WORSE else (TABLES,))


@contextmanager
def _slip(slip: Mapping[str, object] | None) -> Iterator[None]:
    if slip is None:
        yield
        return
    with other_numbers(**slip):
        yield


def again(world: World, dataset: str, stage: str) -> None:
    """Lose what a stage left, so that it is made anew."""
    plan = world.plan()
    for part in plan.part_names(stage, dataset):
        os.remove(plan.record(stage, dataset, part))


def configure(world: World, older: World, values: Mapping[str, object]) -> None:
    """Lay values over the configuration."""
    world.configure(values)


def cell(world: World, older: World, row: int, column: str, by: float) -> None:
    """Change one number of the measured file."""
    lines = _lines(world)
    place = lines[0].index(column)
    lines[row][place] = f"{float(lines[row][place]) + by:.10f}"
    _write(world, lines)


def text(world: World, older: World, file: str, old: str, new: str) -> None:
    """Replace one text of a file."""
    path = world.folder / file
    before = path.read_text()
    assert before.count(old) == 1, f"{old} stands {before.count(old)} times in {file}"
    path.write_text(before.replace(old, new))


def noise(world: World, older: World, noise_mm: float, draw: int) -> None:
    """Measure all positions worse."""
    lines, generator = _lines(world), np.random.default_rng(draw)
    places = [lines[0].index(f"{axis}_mm") for axis in "xyz"]
    for line in lines[1:]:
        for place in places:
            line[place] = f"{float(line[place]) + generator.normal(0.0, noise_mm):.9f}"
    _write(world, lines)


def fewer(world: World, older: World, rows: int) -> None:
    """Leave out the last rows of the measured file."""
    _write(world, _lines(world)[: rows + 1])


def _lines(world: World) -> list[list[str]]:
    return [line.split(",") for line in (world.folder / "poses.csv").read_text().splitlines()]


def _write(world: World, lines: list[list[str]]) -> None:
    (world.folder / "poses.csv").write_text("\n".join(",".join(line) for line in lines) + "\n")


def swap(world: World, older: World, dataset: str, artefact: str, renewed: bool) -> None:
    """Put the table of another run in its place; the marks stay where digests are renewed."""
    from tampered import put

    put(world, dataset, artefact, (older.results / dataset / f"{artefact}.parquet"), renewed)


def edit(world: World, older: World, dataset: str, artefact: str, renewed: bool, draw: int) -> None:
    """Change one number of a table."""
    from tampered import put_edited

    put_edited(world, dataset, artefact, renewed, draw)


def swap_stage(world: World, older: World, dataset: str, stage: str) -> None:
    """Put all that a stage left of another run in its place, with its record."""
    import shutil

    plan, other = world.plan(), older.plan()
    for part in plan.part_names(stage, dataset):
        for name, path in other.outputs(stage, dataset, part).items():
            shutil.copy(path, plan.outputs(stage, dataset, part)[name])
        shutil.copy(other.record(stage, dataset, part), plan.record(stage, dataset, part))


def nothing(world: World, older: World) -> None:
    """The code was changed before anything was imported."""


ACTIONS = {
    each.__name__: each
    for each in (configure, cell, text, noise, fewer, swap, edit, swap_stage, nothing)
}
AFTERWARDS = ("swap", "edit", "swap_stage")  # results are touched after the run

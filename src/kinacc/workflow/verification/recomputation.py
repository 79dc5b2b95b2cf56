"""Hold tables to what their stages make of the tables beside them, computed again in memory.

One mechanism for every number: the function of the stage is run, and columns are compared. What it
costs decides what is run: a check of a data set of the paper's size stays under 2 s.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cache
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kinacc.artifacts import store
from kinacc.artifacts.allowed import COVARIANCES, DISTANCES, OUTLIER_RULES, SEARCHES
from kinacc.artifacts.columns import Columns
from kinacc.artifacts.provenance import config_hash, file_hash
from kinacc.config.schema import defaults, without_execution_keys
from kinacc.errors import InputError, Problem
from kinacc.kinematics import robot
from kinacc.study import monte_carlo
from kinacc.workflow import cost
from kinacc.workflow.catalogue import STAGES, TABLES, Stage
from kinacc.workflow.configured import in_use
from kinacc.workflow.described import beside
from kinacc.workflow.plan import Plan
from kinacc.workflow.verification.lineage import Found, digests_read
from kinacc.workflow.verification.mending import Doubt, Marks, above

# A number may differ from the one computed by this share of itself, and by this share of the
# largest one of its column: other processors and libraries move last digits, and fits amplify it.
RELATIVE, OF_LARGEST = 1e-6, 1e-9
WORK_S = 1.0  # of a stage, as is foreseen; more without --all would make a check slow
_DIRECTION, _EXACT = "undetermined_direction", 1e9
REPETITIONS, CELLS, ROWS = 5, 500, 5000  # computed again without --all
NOT_AGAIN = {
    "robustness_chunk": "every draw is a calibration and a study of its own",
}
_FITTED_ROWS = ("vec", "dh", "compliance", "residuals", "data_check", "summary", "history")


def described() -> dict[str, str]:
    """What is computed again of the tables of each stage that leaves some, in words."""
    words = {}
    for name, stage in STAGES.items():
        if stage.leaves == TABLES:
            words[name] = "all of it"
            if name in _FITTED_ROWS:
                words[name] = (
                    f"all of it, up to {ROWS} rows and {WORK_S:g} s of work foreseen; with `--all` "
                    "of any number"
                )
            if name in NOT_AGAIN:
                words[name] = f"nothing: {NOT_AGAIN[name]}"
    some = "chosen anew in every check; with `--all` all of them"
    return words | {
        "accuracy_map": f"{CELLS} cells, {some}",
        "study_chunk": f"{REPETITIONS} repetitions at every noise under every reading, {some}",
    }


class Again(NamedTuple):
    """What was computed again: the tables that were, what differs, and what was left and why."""

    tables: tuple[str, ...]
    found: list[Found]
    notes: list[str]


def computed_again(
    folder: Path,
    tables: Mapping[str, Columns],
    marks: Marks,
    in_doubt: Collection[str],
    plan: Plan | None = None,
    every: bool = False,
) -> Again:
    """Compute again what the stages of a data set make of the ``tables`` in its folder.

    ``tables`` hold the joined parts of scattered ones too. ``in_doubt``: stages of which something
    else is wrong; what follows from them is not computed. Settings are those whose hash a table
    carries, of the ``plan``, of a configuration beside the results or of the defaults. ``every``:
    all simulations, cells and rows in place of a sample of them.
    """
    plans = (
        [plan]
        if plan
        else [
            *(found for _, found in beside(folder.parent, folder.name)),
            *_assumed(folder.name, tables, marks),
        ]
    )
    doubted, found, done, unknown = set(in_doubt), [], [], []
    large: list[str] = []
    for stage in sorted(STAGES.values(), key=lambda each: len(above(each.name))):
        name = stage.name
        of_parts = {each.partition("/")[0]: own for each, own in marks.items()}
        made = [each for each in stage.outputs if each in tables and each in of_parts]
        if not made or stage.leaves != TABLES or name in NOT_AGAIN:
            continue
        if name in doubted or (above(name) & doubted and not stage.of_lines):
            continue
        inputs = _inputs(stage, folder, of_parts[made[0]], tables, plans)
        if inputs is None:
            continue
        settings, work_s = _settings(
            stage, folder.name, of_parts[made[0]].get("config_hash"), plans
        )
        if settings is None:
            unknown += made
            continue
        of_rows = name in _FITTED_ROWS and _rows(tables) > ROWS
        if not every and (of_rows or (name not in _SAMPLES and work_s > WORK_S)):
            large += made
            continue
        problems = list(_differing(folder, stage, tables, inputs, settings, every))
        found += [(problem, (Doubt(name),)) for problem in problems]
        doubted |= {name} if problems else set()
        done += made
    notes = []
    if unknown:
        words = "without their settings (--config)" if plan is None else "by other settings"
        notes.append(f"{folder}: not computed again {words}: {', '.join(unknown)}")
    if large:
        words = f"without --all, of more than {ROWS} rows or {WORK_S:g} s of work"
        notes.append(f"{folder}: not computed again {words}: {', '.join(large)}")
    return Again(tuple(done), found, notes)


def _differing(
    folder: Path,
    stage: Stage,
    tables: Mapping[str, Columns],
    inputs: Mapping[str, object],
    settings: Mapping[str, object],
    every: bool,
) -> Iterator[Problem]:
    run = import_module(stage.module).run
    more = {"kind": stage.fits} if stage.fits else {}
    chosen, only = None, {}
    if not every and stage.name in _SAMPLES:
        chosen, only = _SAMPLES[stage.name](settings, tables)
    try:
        with warnings.catch_warnings(action="ignore"), np.errstate(all="ignore"):
            made = run(inputs, {**settings, **only}, **more)
        right = {name: store.as_read(name, columns) for name, columns in made.items()}
    except MemoryError:
        raise
    except Exception as error:  # whatever a table that is not what it should be may lead to
        said = error.problems[0] if isinstance(error, InputError) else error
        names = ", ".join(inputs) or "its settings"
        what = f"cannot be computed again from {names}: {said}"
        yield Problem(str(folder / f"{stage.outputs[0]}.parquet"), what)
        return
    for name, columns in right.items():
        if name in tables:
            own = _in_order(stage, tables[name])
            if chosen is not None:
                own = {column: values[chosen(own)] for column, values in own.items()}
            place = folder / name if stage.scattered else folder / f"{name}.parquet"
            yield from _held(place, own, columns)


def _in_order(stage: Stage, columns: Columns) -> Columns:
    """Rows of a scattered table as one part of all would have them."""
    return monte_carlo.ordered(columns) if stage.name == "study_chunk" else columns


def _held(path: Path, own: Columns, right: Columns) -> Iterator[Problem]:
    """What of a table is not what was computed; numbers within the stated share of themselves."""
    counts = [len(next(iter(each.values()), ())) for each in (own, right)]
    if counts[0] != counts[1]:
        yield Problem(str(path), f"{counts[0]} rows", f"{counts[1]}, computed again")
        return
    if set(own) != set(right):
        names = ", ".join(sorted(set(own) ^ set(right)))
        yield Problem(str(path), f"columns {names}", "those computed again")
    free = _by_rounding(own, right)
    if free is None:
        what = "its undetermined directions span another space"
        yield Problem(str(path), what, "that of those computed again")
    for name in [each for each in right if each in own]:
        wrong = _unlike(own[name], right[name])
        if free is not None and name == "value":
            wrong &= ~free
        if wrong.any():
            row = int(np.argmax(wrong))
            is_, should = (_said(values[row]) for values in (own[name], right[name]))
            where, what = f"{path}, column {name}", f"{is_} in {store.rows(wrong)}"
            yield Problem(where, what, f"{should}, computed again")


def _by_rounding(own: Columns, right: Columns) -> np.ndarray | None:
    """Rows of a fit's table whose numbers another processor may round to quite others.

    Directions that nothing determines may be any basis of what they span: None where they span
    something else. A gap beyond all rounding has no value of its own.
    """
    if not {"quantity", "number", "parameter", "value"} <= set(right):
        return np.zeros(len(next(iter(right.values()))), dtype=bool)
    directions = right["quantity"] == _DIRECTION
    spans = [_projection(each, each["quantity"] == _DIRECTION) for each in (own, right)]
    if spans[0].shape != spans[1].shape or not np.allclose(*spans, rtol=0.0, atol=RELATIVE):
        return None
    gaps = [(each["quantity"] == "gap") & (each["value"] > _EXACT) for each in (own, right)]
    return directions | (gaps[0] & gaps[1])


def _projection(columns: Columns, rows: np.ndarray) -> np.ndarray:
    """On what the directions in some rows span, by the names of parameters."""
    numbers, place = np.unique(columns["number"][rows], return_inverse=True)
    names, of = np.unique(columns["parameter"][rows].astype(str), return_inverse=True)
    basis = np.zeros((len(numbers), len(names)))
    basis[place.ravel(), of.ravel()] = columns["value"][rows]
    return basis.T @ basis


def _unlike(own: np.ndarray, right: np.ndarray) -> np.ndarray:
    if own.dtype == object or right.dtype == object:
        pairs = zip(own, right, strict=True)
        return np.array([a != b for a, b in pairs], dtype=bool)
    own, right = own.astype(float), right.astype(float)
    largest = float(np.nanmax(np.abs(right), initial=0.0))
    return ~np.isclose(own, right, rtol=RELATIVE, atol=OF_LARGEST * largest, equal_nan=True)


def _said(value: object) -> str:
    return repr(value) if value is None or isinstance(value, str) else f"{value:.9g}"


Chosen = Callable[[Columns], np.ndarray]


def _repetitions(settings: Mapping, tables: Mapping[str, Columns]) -> tuple[Chosen, dict]:
    """Which rows are of some repetitions, and what makes the stage simulate these alone.

    Chosen anew in every check: who rewrites a simulation cannot know which will be computed.
    """
    count = int(settings["study"]["repetitions"])
    some = np.random.default_rng().permutation(count)[:REPETITIONS]
    return lambda rows: np.isin(rows["repetition"], some), {"only": sorted(some.tolist())}


def _cells(settings: Mapping, tables: Mapping[str, Columns]) -> tuple[Chosen, dict]:
    """Which rows are some cells of the map, and what makes the stage compute these alone."""
    count = len(tables["accuracy_map"]["slice_deg"])
    some = np.sort(np.random.default_rng().permutation(count)[:CELLS])
    return lambda rows: some, {"cells": some}


_SAMPLES = {"study_chunk": _repetitions, "accuracy_map": _cells}


def _inputs(
    stage: Stage,
    folder: Path,
    own: Mapping[str, str],
    tables: Mapping[str, Columns],
    plans: Sequence[Plan],
) -> dict[str, object] | None:
    """What a stage read, of the ``tables`` or of lines beside; None where it is not all there."""
    read = digests_read(own)
    if not stage.of_lines:
        found = {each: tables[each] for each in read if each in tables}
        return found if set(stage.inputs) <= set(found) else None
    inputs: dict[str, object] = {}
    files = next((_of_outside(each, stage, folder.name) for each in plans), {})
    for role, digest in read.items():
        try:
            if not role.endswith("_file"):
                inputs[role] = store.read(folder.parent / f"{role}.parquet")
            elif file_hash(files[role]) == digest:  # else the campaign went on
                inputs[role] = Path(files[role])
        except (InputError, KeyError, OSError):
            return None
    return inputs if len(inputs) == len(read) else None


def _rows(tables: Mapping[str, Columns]) -> int:
    return len(tables.get("measurements", {}).get("pose", ()))


def _settings(
    stage: Stage, dataset: str, wanted: str | None, plans: Sequence[Plan]
) -> tuple[Mapping[str, object] | None, float]:
    """The settings that have the hash a table carries, None where nobody knows them; and the work.

    The work is what the stage is foreseen to take, s."""
    for plan in plans:
        if dataset not in plan.datasets or stage.name not in plan.stages(dataset):
            continue
        found = plan.settings(stage.name, dataset)
        files = _of_outside(plan, stage, dataset).values()
        if config_hash(found) == wanted and all(map(os.path.isfile, files)):
            return found, cost.of_stage(stage.name, plan.datasets[dataset]).seconds
    if stage.name == "study":  # few enough to be tried
        return _readings().get(wanted or ""), 0.0
    return None, 0.0


def _of_outside(plan: Plan, stage: Stage, dataset: str) -> dict[str, str]:
    """Files from outside of a stage by role; none where the data set has no such stage."""
    if dataset not in plan.datasets or stage.name not in plan.stages(dataset):
        return {}
    given = plan.inputs(stage.name, dataset)
    return {role: str(path) for role, path in given.items() if role.endswith("_file")}


def _assumed(dataset: str, tables: Mapping[str, Columns], marks: Marks) -> Iterator[Plan]:
    """The plan of a data set with the robot and the seed of its tables, all else as usual."""
    if "robot" not in tables or "robot" not in marks:
        return
    name, seed = str(tables["robot"]["name"][0]), marks["robot"].get("seed", "")
    if name in robot.shipped() and seed.isdecimal():
        usual = without_execution_keys({**defaults(), "robot": name, "seed": int(seed)})
        parts = {"study": 1, "choices": 1}
        yield Plan({dataset: in_use(usual)}, {dataset: parts}, ())


@cache
def _readings() -> dict[str, dict]:
    """Settings of the stage ``study`` by their hash: every reading there is."""
    names = ("outlier_rule", "distance", "covariance", "search")
    every = product(OUTLIER_RULES, DISTANCES, COVARIANCES, SEARCHES)
    found = [{"study": dict(zip(names, each, strict=True))} for each in every]
    return {config_hash(each): each for each in found}

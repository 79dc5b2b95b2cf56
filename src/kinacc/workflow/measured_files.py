"""Measured files of a plan: read before anything runs, and what their check found."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

from kinacc.artifacts.provenance import config_hash
from kinacc.deployment import shared_readings
from kinacc.errors import InputError, Problem, gathered, refuse
from kinacc.workflow.plan import Plan


def check(plan: Plan) -> None:
    """Read every measured file that is newer than its table, or read by other settings.

    Raises InputError listing all problems. Done before anything runs, because Snakemake removes a
    table before it is made anew.
    """
    problems: list[Problem] = []
    tables: dict[str, Mapping] = {}
    for dataset, config in plan.datasets.items():
        files = plan.inputs("measurements", dataset)
        what = "has braces in its name, which Snakemake takes for a wildcard"
        problems += [
            Problem(path, what, fix="rename it")
            for path in dict.fromkeys(map(str, files.values()))
            if re.search(r"\{\s*\w.*\}", path)
        ]
        read = [str(files[role]) for role in ("measurements_file", "joints_file") if role in files]
        table = plan.outputs("measurements", dataset)["measurements"]
        settings = plan.settings("measurements", dataset)
        if not read or _is_current(table, read, settings):
            continue
        from kinacc.kinematics import robot
        from kinacc.workflow import calibration_settings
        from kinacc.workflow.stages import measurements

        with gathered(problems):
            with warnings.catch_warnings(action="ignore"):  # the stage says them itself
                made = measurements.run({}, settings)
            tables[dataset] = made["measurements"]
            arm = robot.load(config["robot"])
            calibration_settings.require_enough_rows(made, arm, config["calibration"])
    for config in plan.datasets.values():
        series: Any = config.get("series", ())
        problems += _repeated_in(plan, [line["name"] for line in series], tables)
    refuse(problems)


def _repeated_in(plan: Plan, lines: Sequence[str], new: Mapping[str, Mapping]) -> list[Problem]:
    """Lines of one series, of which some were read anew, that hold the same readings."""
    from kinacc.artifacts.store import read

    if not {*lines} & {*new}:
        return []
    problems, before = [], []
    for line in lines:
        table = plan.outputs("measurements", line)["measurements"]
        if line not in new and not os.path.exists(table):
            continue  # it could not be read, which is told already
        own = new[line] if line in new else read(table)
        path = str(plan.inputs("measurements", line)["measurements_file"])
        for earlier, other in before:
            problems += repeated(path, own, earlier, other)
        before.append((path, own))
    return problems


def repeated(path: str, own: Mapping, before: str, other: Mapping) -> list[Problem]:
    """That a file of a series holds readings of an earlier line: it says nothing new by them.

    A tracker's export that goes on holds the old readings among the new ones; the history would
    hold them against themselves.
    """
    count, rows = shared_readings.repeated(other, own), len(own["subset"])
    if not count:
        return []
    if count == rows:
        return [Problem(path, f"holds the readings of {before}, which is a line already",
                        "new readings")]  # fmt: skip
    what = f"{count} of its {rows} readings are those of {before}, which is a line already"
    fix = "leave those rows out of the file: a change would be held against readings before it"
    return [Problem(path, what, "new readings alone", fix)]


def remarks(plan: Plan, dataset: str) -> list[str]:
    """What the check found in a data set's file, a line each."""
    if "data_check" in plan.left_out(dataset):
        return []
    path = plan.outputs("data_check", dataset)["data_check"]
    if not os.path.exists(path):
        return []
    from kinacc.artifacts.store import read
    from kinacc.calibration.summary import findings

    found = findings(read(path))
    told = [f"{dataset}: the check of the data found:"] if found else []
    return told + [f"  - {words}" for words in found]


def _is_current(table: str, files: Sequence[str], settings: Mapping[str, object]) -> bool:
    """Whether a table was made after the ``files`` changed, and by these settings."""
    changed = max(map(os.path.getmtime, files))
    if not os.path.exists(table) or changed >= os.path.getmtime(table):
        return False
    return _marks(table).get("config_hash") == config_hash(settings)


def _marks(table: str) -> dict[str, str]:
    """What a table says it was made from; nothing where there is none that can be read."""
    from kinacc.artifacts.store import read_metadata

    try:
        return read_metadata(table)
    except InputError:
        return {}

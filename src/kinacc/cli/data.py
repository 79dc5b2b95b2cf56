"""``kinacc check-data``, ``exclude`` and ``add``: the measured files of a configuration."""

from __future__ import annotations

import math
import re
import shlex
import sys
from collections.abc import Sequence
from datetime import datetime
from typing import Any

import click
import pandas as pd

from kinacc.checks.check import examined
from kinacc.checks.configuration import add_to, load
from kinacc.checks.findings import VERDICTS
from kinacc.cli.choice import CONFIG, DATASET, PATH, REASON, option
from kinacc.cli.output import Output, answers
from kinacc.cli.process import AGAINST, DONE
from kinacc.config import schema
from kinacc.config.series import MOVED, SAME
from kinacc.deployment import adding
from kinacc.errors import InputError, Problem, first_few, gathered, input_error, refuse
from kinacc.figures.calibration import draw_check
from kinacc.kinematics import robot
from kinacc.measurements.reader import excluded_lines, read
from kinacc.progress import reporting
from kinacc.report.rendering import counted, environment

_MOST = 100_000  # lines of a range
_SETUP = click.Choice([SAME, MOVED])
_FINDING = click.Choice(schema.key("data_check.accept")["propertyNames"]["enum"])
_DAY = click.DateTime(["%Y-%m-%d"])
_EMPTY_REASON = Problem("--reason", "is empty", "why, in words")


@click.command("check-data")
@click.argument("files", nargs=-1, type=PATH)
@option("--dataset", multiple=True, help="Data set of the configuration; repeatable. [all]")
@option("--accept", type=_FINDING, metavar="FINDING",
        help="Finding to go on with, kept in FILE.yaml.")  # fmt: skip
@REASON
@answers(picture="Picture of one data set: .svg, .png or .pdf.")
def check_data(
    files: tuple[str, ...],
    dataset: tuple[str, ...],
    accept: str | None,
    reason: str | None,
    out: Output,
) -> None:
    """Check measured files before anything is fitted.

    FILES are configuration files [config.yaml]. Exit code 1: there are suspicions; 2: the file or
    its description cannot be used.

    \b
    Example:
      kinacc check-data examples/ur10_published.yaml --picture checked.svg
    """
    files = files or (CONFIG,)
    if accept is not None:
        _accept(files, dataset, accept, reason or "")
    sections = _sections(files, dataset)
    if out.picture is not None and len(sections) > 1:
        message = "draws one data set, and there are several"
        raise input_error("--picture", message, ", ".join(sections), "give --dataset")
    template = environment(is_page=False).get_template("data_check.txt")
    reports = {}
    problems: list[Problem] = []
    for name, settings in sections.items():
        with gathered(problems):
            with reporting(f"check-data {name}"):
                report = examined(settings)
            reports[name] = report
            if not out.as_json:
                click.echo(f"{template.render(dataset=name, report=report)}\n")
            if out.picture is not None:
                suspects = {item.kind: item.lines for item in report.suspicions}
                limit_mm = report.facts.get("quick_fit", {}).get("most_expected_mm", math.nan)
                joints = pd.DataFrame(report.facts["joint_coverage"])
                out.draw(draw_check(joints, report.line, report.left_mm, limit_mm, suspects))
    refuse(problems)
    code = AGAINST if any(report.suspicions for report in reports.values()) else DONE
    if out.as_json:
        datasets = [{"dataset": name, **report.as_dict()} for name, report in reports.items()]
        out.show({"verdict": VERDICTS[code], "datasets": datasets})
    else:
        stopping = [item for report in reports.values() for item in report.stopping]
        following = [line for item in stopping for line in item.commands(files[0])]
        lines = following or [shlex.join(["kinacc", "calibrate", *files])]
        first = "next: correct what is named above and check again, or" if following else "next:"
        click.echo("\n  ".join([first, *lines]))
    sys.exit(code)


def _accept(files: Sequence[str], dataset: Sequence[str], kind: str, reason: str) -> None:
    """Write to the configuration that the workflow goes on with a finding."""
    problems = [] if reason.strip() else [_EMPTY_REASON]
    problems += [] if len(files) == 1 else [Problem("--accept", "needs one FILE.yaml")]
    refuse(problems)
    name, _ = measured_data_set(files[0], next(iter(dataset), None))
    add_to(files[0], ("datasets", name, "data_check", "accept"), {kind: reason})


def _sections(files: Sequence[str], wanted: Sequence[str]) -> dict[str, dict[str, Any]]:
    """The data sets to check: the wanted ones, or all that are read from a file."""
    measured = _measured(files)
    # The newest line of a series is the arm's own file.
    chosen = wanted or [name for name in measured if "series" not in measured[name]]
    refuse(
        Problem("--dataset", f"{name!r} is not read from a file", ", ".join(measured))
        for name in chosen
        if name not in measured
    )
    if not chosen:
        raise input_error(", ".join(files), "no data set is read from a file")
    return {name: measured[name] for name in chosen}


def _measured(files: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Settings of the data sets that are read from a file."""
    return {
        name: settings
        for name, settings in load(files).items()
        if settings["measurements"]["source"] == "file"
    }


@click.command("exclude")
@click.argument("file", metavar="FILE.yaml")
@option("--lines", required=True, metavar="12,15-18", help="Lines of the measured file.")
@REASON
@DATASET
@answers()
def exclude(file: str, lines: str, reason: str | None, dataset: str | None, out: Output) -> None:
    """Exclude rows of a measured file from all fits and figures.

    \b
    Example:
      kinacc exclude tracker.yaml --lines 12,15-18 --reason "reflector moved"
    """
    name, settings = measured_data_set(file, dataset)
    section = settings["measurements"]["file"]
    numbers = _numbers(lines)
    if known := sorted({*numbers}.intersection(excluded_lines(section))):
        raise input_error("--lines", f"{first_few(known)} excluded already")
    if not (reason or "").strip():
        raise InputError(_EMPTY_REASON)
    item = {"lines": numbers, "reason": reason}
    read({**section, "exclude": [*section["exclude"], item]}, robot.load(settings["robot"]))
    add_to(file, ("datasets", name, "measurements", "file", "exclude"), [item])
    first = f"{file}: {counted(len(numbers), 'line')} of {section['path']} excluded"
    text = [first, "next:", f"  kinacc check-data {file}"]
    out.show({"file": file, "dataset": name, **item}, lines=text)


def measured_data_set(file: str, dataset: str | None) -> tuple[str, dict[str, Any]]:
    """Name and settings of a measured data set; InputError where it is not clear which."""
    measured = {
        name: settings
        for name, settings in _measured([file]).items()
        if {"line_of", "series"}.isdisjoint(settings)
    }
    name = dataset or (next(iter(measured)) if len(measured) == 1 else "")
    if name not in measured:
        message = f"{name!r} is not a data set of one file" if name else "is not given"
        raise input_error("--dataset", message, ", ".join(measured) or "a measured file")
    return name, measured[name]


def _numbers(text: str) -> list[int]:
    """Line numbers of a text such as 12,15-18. InputError for others."""
    numbers: set[int] = set()
    for part in text.split(","):
        ends = re.fullmatch(r"(\d{1,9})(?:-(\d{1,9}))?", part)
        first, last = (int(ends[1]), int(ends[2] or ends[1])) if ends else (1, 0)
        if not first <= last < first + _MOST:
            raise input_error("--lines", repr(text), "numbers and ranges such as 12,15-18")
        numbers |= {*range(first, last + 1)}
    return sorted(numbers)


@click.command("add")
@click.argument("measurement_file", metavar="FILE", type=PATH)
@option("--to", "config", required=True, type=PATH, help="Configuration file of the arm.")
@DATASET
@option("--date", type=_DAY, required=True, help="Day of the measurement.")
@option("--base", type=_SETUP, required=True, help="Robot and instrument since the newest line.")
@option("--tool", type=_SETUP, required=True, help="Tool or targets since the newest line.")
@option("--first-date", type=_DAY, help="Day of the first file, where it is no series yet.")
@answers()
def add(
    measurement_file: str,
    config: str,
    dataset: str | None,
    date: datetime,
    base: str,
    tool: str,
    first_date: datetime | None,
    out: Output,
) -> None:
    """Add a measured FILE of the same arm to its series, as a line of the configuration.

    \b
    Example:
      kinacc add june.csv --to tracker.yaml --date 2026-06-02 --base moved --tool same
    """
    first_day = first_date and first_date.date()
    result = adding.add(measurement_file, config, base, tool, date.date(), dataset, first_day)
    lines = [f"{config}, series of {result.dataset}:", *(f"  - {line}" for line in result.written)]
    out.show(result, lines=[*lines, f"Next: {shlex.join(['kinacc', 'calibrate', config])}"])

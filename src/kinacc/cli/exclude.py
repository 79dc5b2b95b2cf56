"""``kinacc exclude``: rows of a measured file that no fit uses, named in the configuration."""

from __future__ import annotations

import re
from pathlib import Path

import click

from kinacc.checks.contradictions import load
from kinacc.cli.output import Output, answers
from kinacc.config.edit import with_added
from kinacc.errors import InputError, Problem, first_few, refuse
from kinacc.kinematics import robot
from kinacc.measurements.reader import excluded_lines, read
from kinacc.tables.atomic import write_whole

_MOST = 100_000  # lines of a range


@click.command("exclude")
@click.argument("file", metavar="FILE.yaml")
@click.option("--lines", required=True, metavar="12,15-18", help="Lines of the measured file.")
@click.option("--reason", required=True, help="Reason, kept in the configuration.")
@click.option("--dataset", metavar="NAME", help="Data set; needed where FILE.yaml has several.")
@answers("Print what was excluded as JSON.")
def exclude(file: str, lines: str, reason: str, dataset: str | None, out: Output) -> None:
    """Exclude rows of a measured file from all fits and figures.

    \b
    Example:
      kinacc exclude tracker.yaml --lines 12,15-18 --reason "reflector moved"
    """
    name, settings = measured_data_set(file, dataset)
    section = settings["measurements"]["file"]
    numbers = _numbers(lines)
    known = [number for number in numbers if number in excluded_lines(section)]
    problems = [Problem("--lines", f"{first_few(known)} excluded already")] if known else []
    problems += [] if reason.strip() else [Problem("--reason", "is empty", "why, in words")]
    refuse(problems)
    item = {"lines": numbers, "reason": reason}
    read({**section, "exclude": [*section["exclude"], item]}, robot.load(settings["robot"]))
    path = ("datasets", name, "measurements", "file", "exclude")
    write_whole(file, with_added(Path(file).read_text("utf-8"), path, [item], file).encode())
    count = f"{len(numbers)} line{'s' if len(numbers) > 1 else ''}"
    text = f"{file}: {count} of {section['path']} excluded\nnext:\n  kinacc check-data {file}"
    out.say({"file": file, "dataset": name, **item}, text)


def measured_data_set(file: str, dataset: str | None) -> tuple[str, dict]:
    """Name and settings of a measured data set; InputError where it is not clear which."""
    measured = {
        name: settings
        for name, settings in load([file]).items()
        if settings["measurements"]["source"] == "file"
        and {"line_of", "series"}.isdisjoint(settings)
    }
    name = dataset or (next(iter(measured)) if len(measured) == 1 else "")
    if name not in measured:
        message = f"{name!r} is not a data set of one file" if name else "is not given"
        raise InputError(Problem("--dataset", message, ", ".join(measured) or "a measured file"))
    return name, measured[name]


def _numbers(text: str) -> list[int]:
    """Line numbers of a text such as 12,15-18. InputError for others."""
    numbers: set[int] = set()
    for part in text.split(","):
        ends = re.fullmatch(r"(\d{1,9})(?:-(\d{1,9}))?", part)
        first, last = (int(ends[1]), int(ends[2] or ends[1])) if ends else (1, 0)
        if not first <= last < first + _MOST:
            raise InputError(Problem("--lines", repr(text), "numbers and ranges such as 12,15-18"))
        numbers |= {*range(first, last + 1)}
    return sorted(numbers)

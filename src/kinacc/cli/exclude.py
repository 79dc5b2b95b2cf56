"""``kinacc exclude``: rows of a measured file that no fit uses, named in the configuration."""

from __future__ import annotations

import json
import re
from pathlib import Path

import click


@click.command("exclude")
@click.argument("file", metavar="FILE.yaml")
@click.option("--lines", required=True, metavar="12,15-18", help="Lines of the measured file.")
@click.option("--reason", required=True, help="Reason, kept in the configuration.")
@click.option("--dataset", metavar="NAME", help="Data set; needed where FILE.yaml has several.")
@click.option("--json", "as_json", is_flag=True, help="Print what was excluded as JSON.")
def exclude(file: str, lines: str, reason: str, dataset: str | None, as_json: bool) -> None:
    """Exclude rows of a measured file from all fits and figures.

    \b
    Example:
      kinacc exclude tracker.yaml --lines 12,15-18 --reason "reflector moved"
    """
    from kinacc.config.edit import with_added
    from kinacc.errors import Problem, first_few, refuse
    from kinacc.kinematics import robot
    from kinacc.measurements.reader import excluded_lines, read
    from kinacc.tables.atomic import write_whole

    name, settings = measured_data_set(file, dataset)
    section = settings["measurements"]["file"]
    numbers = _numbers(lines)
    known = [entry for entry in numbers if entry in excluded_lines(section)]
    problems = [Problem("--lines", f"{first_few(known)} excluded already")] if known else []
    problems += [] if reason.strip() else [Problem("--reason", "is empty", "why, in words")]
    refuse(problems)
    item = {"lines": numbers, "reason": reason}
    read({**section, "exclude": [*section["exclude"], item]}, robot.load(settings["robot"]))
    path = ("datasets", name, "measurements", "file", "exclude")
    text = with_added(Path(file).read_text("utf-8"), path, [item], file)
    write_whole(file, text.encode())
    if as_json:
        click.echo(json.dumps({"file": file, "dataset": name, **item}))
        return
    count = f"{len(numbers)} line{'s' if len(numbers) > 1 else ''}"
    click.echo(f"{file}: {count} of {section['path']} excluded\nnext:\n  kinacc check-data {file}")


def measured_data_set(file: str, dataset: str | None) -> tuple[str, dict]:
    """Name and settings of a measured data set; InputError where it is not clear which."""
    from kinacc.checks.contradictions import load
    from kinacc.errors import InputError, Problem

    measured = {
        name: subset
        for name, subset in load([file]).items()
        if subset["measurements"]["source"] == "file" and not {"line_of", "series"} & {*subset}
    }
    name = dataset or (next(iter(measured)) if len(measured) == 1 else "")
    if name not in measured:
        message = f"{name!r} is not a data set of one file" if name else "is not given"
        raise InputError(Problem("--dataset", message, ", ".join(measured) or "a measured file"))
    return name, measured[name]


def _numbers(text: str) -> list[int]:
    """Line numbers of a text such as 12,15-18. InputError for others."""
    from kinacc.errors import InputError, Problem

    numbers: set[int] = set()
    if re.fullmatch(r"\d{1,9}(-\d{1,9})?(,\d{1,9}(-\d{1,9})?)*", text):
        for part in text.split(","):
            first, _, last = part.partition("-")
            numbers |= {*range(int(first), min(int(last or first), int(first) + 100_000) + 1)}
    if not numbers:
        raise InputError(Problem("--lines", repr(text), "numbers and ranges such as 12,15-18"))
    return sorted(numbers)

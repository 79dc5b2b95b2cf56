"""``kinacc check-data``: what a file of measurements holds, and what looks wrong in it."""

from __future__ import annotations

import shlex
import sys
from dataclasses import asdict
from pathlib import Path

import click

from kinacc.checks.check import examined
from kinacc.checks.contradictions import load
from kinacc.checks.report import UNUSABLE, VERDICTS, to_json
from kinacc.cli.choice import CONFIG
from kinacc.cli.exclude import measured_data_set
from kinacc.cli.output import Output, answers
from kinacc.config.edit import with_added
from kinacc.errors import InputError, Problem, refuse
from kinacc.progress import reporting
from kinacc.tables.atomic import write_whole


@click.command("check-data")
@click.argument("files", nargs=-1, type=click.Path())
@click.option("--dataset", multiple=True, help="Data set of the configuration. [all that are read]")
@click.option("--accept", metavar="FINDING", help="Finding to go on with, kept in FILE.yaml.")
@click.option("--reason", default="", help="Reason for --accept.")
@answers("Print the report as JSON.", picture="Draw one data set to a .svg, .png or .pdf file.")
def check_data(
    files: tuple[str, ...], dataset: tuple[str, ...], accept: str | None, reason: str, out: Output
) -> None:
    """Check measured files before anything is fitted: what is there, and what looks wrong.

    FILES are configuration files with data sets, config.yaml if none is given. Every suspicion
    names the lines of the measured file it concerns. Exit code 0: nothing suspicious; 1: there are
    suspicions; 2: the file or its description cannot be used.

    \b
    Example:
      kinacc check-data examples/ur10_published.yaml --picture checked.svg
      kinacc check-data config.yaml examples/ur10.yaml --dataset ur10_b --json
    """
    files = files or (CONFIG,)
    if accept is not None:
        _accept(files, dataset, accept, reason)
    sections = _sections(files, dataset)
    if out.picture is not None and len(sections) > 1:
        message = "draws one data set, and there are several"
        raise InputError(Problem("--picture", message, ", ".join(sections), "give --dataset"))
    code, reports, following = 0, [], []
    for name, settings in sections.items():
        try:
            with reporting(f"check-data {name}", bar=True) as progress:
                report = examined(settings, name, progress)
        except InputError as error:
            code = UNUSABLE
            path = settings["measurements"]["file"]["path"]
            problems = [asdict(problem) for problem in error.problems]
            facts = {"dataset": name, "path": path, "verdict": VERDICTS[code]}
            reports.append({**facts, "problems": problems})
            text = f"{error}\n"
        else:
            code = max(code, report.code)
            reports.append(report.as_dict())
            following += [line for item in report.stopping for line in item.commands(files[0])]
            text = report.as_text() + "\n"
            if out.picture is not None:
                out.draw(_drawn(report))
        if not out.as_json:
            click.echo(text, err="problems" in reports[-1])
    if out.as_json:
        click.echo(to_json(reports))
    elif code < UNUSABLE:
        lines = following or [shlex.join(["kinacc", "calibrate", *files])]
        first = "next: correct what is named above and check again, or" if following else "next:"
        click.echo("\n  ".join([first, *lines]))
    sys.exit(code)


def _accept(files: tuple[str, ...], dataset: tuple[str, ...], kind: str, reason: str) -> None:
    """Write to the configuration that the workflow goes on with a finding."""
    problems = [] if reason.strip() else [Problem("--reason", "is empty", "why, in words")]
    problems += [] if len(files) == 1 else [Problem("--accept", "needs one FILE.yaml")]
    refuse(problems)
    name, _ = measured_data_set(files[0], next(iter(dataset), None))
    path = ("datasets", name, "data_check", "accept")
    text = with_added(Path(files[0]).read_text("utf-8"), path, {kind: reason}, files[0])
    write_whole(files[0], text.encode())


def _sections(files: tuple[str, ...], wanted: tuple[str, ...]) -> dict[str, dict]:
    """The data sets to check: those asked for, or all that are read from a file."""
    full = load(files)
    measured = [name for name, c in full.items() if c["measurements"]["source"] == "file"]
    # The newest line of a series is the arm's own file.
    chosen = wanted or [name for name in measured if "series" not in full[name]]
    refuse(
        Problem("--dataset", f"{name!r} is not read from a file", ", ".join(measured))
        for name in chosen
        if name not in measured
    )
    if not chosen:
        raise InputError(Problem(", ".join(files), "no data set is read from a file"))
    return {name: full[name] for name in chosen}


def _drawn(report):
    from kinacc.figures.checked_data import draw

    suspects = {item.kind: item.lines for item in report.suspicions}
    limit_mm = report.facts.get("quick_fit", {}).get("most_expected_mm", float("nan"))
    return draw(report.facts["joint_coverage"], report.line, report.left_mm, limit_mm, suspects)

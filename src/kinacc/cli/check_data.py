"""``kinacc check-data``: what a file of measurements holds, and what looks wrong in it."""

from __future__ import annotations

import shlex
import sys
from dataclasses import asdict
from pathlib import Path

import click

from kinacc.cli.choice import CONFIG


@click.command("check-data")
@click.argument("files", nargs=-1, type=click.Path())
@click.option("--dataset", multiple=True, help="Data set of the configuration. [all that are read]")
@click.option(
    "--picture", type=click.Path(), help="Draw one data set to a .svg, .png or .pdf file."
)
@click.option("--force", is_flag=True, help="Replace a picture that is there.")
@click.option("--json", "as_json", is_flag=True, help="Print the report as JSON.")
@click.option("--accept", metavar="FINDING", help="Finding to go on with, kept in FILE.yaml.")
@click.option("--reason", default="", help="Reason for --accept.")
def check_data(
    files: tuple[str, ...],
    dataset: tuple[str, ...],
    picture: str | None,
    force: bool,
    as_json: bool,
    accept: str | None,
    reason: str,
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
    from kinacc.checks.report import UNUSABLE, to_json
    from kinacc.errors import InputError

    try:
        if accept is not None:
            _accept(files or (CONFIG,), dataset, accept, reason)
        sections = _sections(files or (CONFIG,), dataset)
        _check_picture(picture, force, list(sections))
    except InputError as error:
        if not as_json:
            raise
        click.echo(to_json([_unusable(", ".join(files or (CONFIG,)), "", error)]))
        sys.exit(UNUSABLE)
    stopped: list[str] = []
    code = report_on(sections, as_json, picture, stopped, shlex.join((files or (CONFIG,))[:1]))
    if not as_json and code < UNUSABLE:
        following = stopped or [shlex.join(["kinacc", "calibrate", *(files or (CONFIG,))])]
        click.echo("\n  ".join(["next:", *following]))
    sys.exit(code)


def _accept(files: tuple[str, ...], dataset: tuple[str, ...], kind: str, reason: str) -> None:
    """Write to the configuration that the workflow goes on with a finding."""
    from kinacc.cli.exclude import measured_data_set
    from kinacc.config.edit import with_added
    from kinacc.errors import Problem, refuse
    from kinacc.tables.atomic import write_whole

    problems = [] if reason.strip() else [Problem("--reason", "is empty", "why, in words")]
    problems += [] if len(files) == 1 else [Problem("--accept", "needs one FILE.yaml")]
    refuse(problems)
    name, _ = measured_data_set(files[0], next(iter(dataset), None))
    path = ("datasets", name, "data_check", "accept")
    text = with_added(Path(files[0]).read_text("utf-8"), path, {kind: reason}, files[0])
    write_whole(files[0], text.encode())


def report_on(
    sections: dict[str, dict],
    as_json: bool,
    picture: str | None = None,
    stopped: list[str] | None = None,
    config: str = "FILE.yaml",
) -> int:
    """Check data sets (complete configurations by name) and print; returns the exit code.

    ``stopped`` takes the commands to go on with after findings that stop the workflow.
    """
    from kinacc.checks.check import examined
    from kinacc.checks.report import UNUSABLE, to_json
    from kinacc.errors import InputError
    from kinacc.progress import reporting

    worst, told = 0, []
    for name, settings in sections.items():
        file = settings["measurements"]["file"]
        try:
            with reporting(f"check-data {name}", bar=True) as progress:
                report = examined(settings, name, progress)
        except InputError as error:
            worst = UNUSABLE
            told.append(_unusable(name, file["path"], error))
            if not as_json:
                click.echo(f"{error}\n", err=True)
            continue
        worst = max(worst, report.code)
        if picture is not None:
            _draw(report, picture)
        told.append(report.as_dict())
        for each in report.stopping:
            (stopped if stopped is not None else []).extend(each.commands(config))
        if not as_json:
            click.echo(report.as_text() + "\n")
    if as_json:
        click.echo(to_json(told))
    return worst


def _sections(files: tuple[str, ...], wanted: tuple[str, ...]) -> dict[str, dict]:
    """The data sets to check: those asked for, or all that are read from a file."""
    from kinacc.checks.contradictions import load
    from kinacc.errors import Problem, refuse

    full = load(files)
    measured = [n for n, c in full.items() if c["measurements"]["source"] == "file"]
    allowed = ", ".join(measured) or "none of these files' data sets is read from a file"
    problems = [
        Problem(
            "--dataset",
            f"{name!r} is {'synthetic' if name in full else 'not in the configuration'}",
            allowed,
        )
        for name in wanted
        if name not in measured
    ]
    if not measured and not wanted:
        what = "no data set is read from a file: there is nothing to check"
        problems.append(Problem(", ".join(files), what, "measurements.source: file"))
    refuse(problems)
    # The newest line of a series is the arm's own file.
    return {name: full[name] for name in wanted or measured if wanted or "series" not in full[name]}


def _check_picture(picture: str | None, force: bool, datasets: list[str]) -> None:
    from kinacc.cli.output import PICTURES, require_writable
    from kinacc.errors import InputError, Problem

    if picture is not None and len(datasets) > 1:
        what = "draws one data set, and there are several"
        raise InputError(Problem("--picture", what, ", ".join(datasets), "choose with --dataset"))
    require_writable([picture], force, PICTURES)


def _draw(report, picture: str) -> None:
    from kinacc.cli.output import Output
    from kinacc.figures.checked_data import draw

    suspects = {each.kind: each.lines for each in report.suspicions}
    limit_mm = report.facts.get("quick_fit", {}).get("most_expected_mm", float("nan"))
    drawn = draw(report.facts["joint_coverage"], report.line, report.left_mm, limit_mm, suspects)
    Output(picture=picture).draw(drawn)


def _unusable(dataset: str, path: str, error) -> dict:
    return {
        "dataset": dataset,
        "path": path,
        "verdict": "unusable",
        "problems": [asdict(each) for each in error.problems],
    }

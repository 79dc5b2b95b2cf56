"""``kinacc gate``: results held to what is good enough, and to the accepted run."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from kinacc.errors import InputError, Problem, first_few
from kinacc.workflow.plan import RESULTS

if TYPE_CHECKING:
    from kinacc.gate.outcome import Outcome
    from kinacc.workflow.plan import Plan
    from kinacc.workflow.verification.check import Report

_CONFIG = "config.yaml"


@click.command("gate")
@click.argument("results", type=click.Path(path_type=Path), default=RESULTS)
@click.option(
    "--config",
    multiple=True,
    metavar="FILE",
    help="Configuration with the gates, whose results these should be.  [config.yaml]",
)
@click.option("--dataset", "datasets", multiple=True, metavar="NAME", help="These alone.")
def gate(results: Path, config: tuple[str, ...], datasets: tuple[str, ...]) -> None:
    """Hold RESULTS to the gates of the configuration and to the accepted run.

    First every file is held to its record and tables to what they were made from, as `kinacc
    check-results` does, without numbers computed again. Then the section `gates` of the
    configuration says what is good enough.

    Exit code 0 where nothing failed (what warns does not fail), 1 where something did, 2 where what
    is given cannot be used.

    \b
    Example:
      kinacc gate results --config tracker.yaml
    """
    from kinacc.gate.gates import judged
    from kinacc.gate.outcome import FAILED, Verdicts

    files = _configured(config)
    full, plan = _configurations(files, datasets)
    report = _checked(results, files, plan)
    outcomes = (*_sound(report), *judged(results, full, None))
    verdicts = Verdicts(str(results), "", report.digest, outcomes, {})
    for each in sorted(outcomes, key=lambda one: one.verdict != FAILED):
        click.echo(f"{each.verdict:9} {each.dataset}, {each.name}: {each.says}")
        if each.fix:
            click.echo(f"          {each.fix}")
    sys.exit(0 if verdicts.passed else 1)


def _configured(given: Sequence[str]) -> list[str]:
    """The configuration files: those given, or config.yaml where it is there."""
    if given or Path(_CONFIG).is_file():
        return list(given or [_CONFIG])
    what = f"is not given, and there is no {_CONFIG} here"
    raise InputError(Problem("--config", what, "the file that describes the data sets"))


def _configurations(
    files: Sequence[str], datasets: Sequence[str]
) -> tuple[dict[str, Mapping[str, Any]], Plan]:
    """Full settings of the data sets that are meant, and the plan of what their results are."""
    from dataclasses import replace

    from kinacc.workflow.contradictions import load
    from kinacc.workflow.plan import planned

    plan, full = planned(files), load(files)
    unknown = [each for each in datasets if each not in full]
    if unknown:
        what = f"{first_few(unknown)} is none of the configuration"
        raise InputError(Problem("--dataset", what, ", ".join(full)))
    kept = list(datasets or full)
    own = {
        name: settings
        for name, settings in plan.datasets.items()
        if name in kept or settings.get("line_of") in kept
    }
    return {name: full[name] for name in kept}, replace(plan, datasets=own)


def _checked(results: Path, files: Sequence[str], plan: Plan) -> Report:
    from kinacc.workflow.results_lock import refuse_while_running
    from kinacc.workflow.verification.check import check_results

    refuse_while_running(results)
    return check_results(results, plan, files, again=False)


def _sound(report: Report) -> tuple[Outcome, ...]:
    """What the check of the results found, an outcome for each data set."""
    from kinacc.gate.outcome import FAILED, PASSED, Outcome

    found = [
        Outcome("", "results", "results", FAILED, str(each), report.advice)
        for each in report.problems
    ]
    for each in report.datasets:
        if each.problems:
            count = len(each.problems)
            says = f"{count} problem{'s' if count > 1 else ''}: {first_few(each.problems, 3)}"
            found.append(Outcome(each.name, "results", "results", FAILED, says, report.advice))
        else:
            says = f"{len(each.checked)} files are as their records say"
            found.append(Outcome(each.name, "results", "results", PASSED, says))
    return tuple(found)

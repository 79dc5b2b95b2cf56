"""``kinacc gate``: results held to what is good enough, and to the accepted run."""

from __future__ import annotations

import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from kinacc.errors import InputError, Problem, first_few, refuse
from kinacc.workflow.plan import RESULTS

if TYPE_CHECKING:
    from kinacc.gate.outcome import Outcome, Verdicts
    from kinacc.workflow.plan import Plan
    from kinacc.workflow.verification.check import Report

_CONFIG, _ACCEPTED = "config.yaml", "accepted"
_DIALECTS = ("github", "gitlab", "azure", "plain")


@click.command("gate")
@click.argument("results", type=click.Path(path_type=Path), default=RESULTS)
@click.option(
    "--config",
    multiple=True,
    metavar="FILE",
    help="Configuration with the gates, whose results these should be.  [config.yaml]",
)
@click.option(
    "--against",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Hold every table to the accepted run in this folder.",
)
@click.option("--exact", is_flag=True, help="Files have to be those accepted to the last byte.")
@click.option("--dataset", "datasets", multiple=True, metavar="NAME", help="These alone.")
@click.option("--json", "as_json", is_flag=True, help="Print the outcome as JSON.")
@click.option(
    "--out",
    "files",
    multiple=True,
    type=click.Path(path_type=Path),
    help="Write it too, by the ending: .json, .xml (JUnit), .md, .txt, .codequality.json (GitLab).",
)
@click.option(
    "--annotations",
    type=click.Choice(_DIALECTS),
    help="Print lines that a build server shows at the files they name.",
)
@click.option("--schema", is_flag=True, help="Print the JSON Schema of the JSON, and do no more.")
def gate(
    results: Path,
    config: tuple[str, ...],
    against: Path | None,
    exact: bool,
    datasets: tuple[str, ...],
    as_json: bool,
    files: tuple[Path, ...],
    annotations: str | None,
    schema: bool,
) -> None:
    """Hold RESULTS to the gates of the configuration and to the accepted run.

    First every file is held to its record, and tables to what they were made from, as by `kinacc
    check-results`; no number is computed again. Then the section `gates` of the configuration says
    what is good enough. With --against every table is held to the accepted run, which `kinacc
    accept` makes, and what explains a difference is named; gates against the accepted run look for
    it in that folder, or in accepted/.

    Exit code 0 where nothing failed (what warns does not fail), 1 where something did, 2 where what
    is given cannot be used.

    \b
    Example:
      kinacc gate results --config tracker.yaml
      kinacc gate results --config tracker.yaml --against accepted --out gate.xml --out gate.md
    """
    from kinacc.gate import outputs

    if schema:
        click.echo(outputs.schema_text(), nl=False)
        return
    _refuse(against, exact, as_json, annotations, files)
    screens = as_json or any(path.suffix in (".json", ".md") for path in files)
    verdicts = _verdicts(results, config, datasets, against, exact, screens)
    for path in files:
        outputs.written(verdicts, path)
    if as_json:
        click.echo(outputs.json_text(verdicts), nl=False)
    elif annotations:
        click.echo("\n".join([*outputs.annotations(verdicts, annotations)]))
    else:
        click.echo(outputs.as_text(verdicts))
    sys.exit(0 if verdicts.passed else 1)


def _refuse(
    against: Path | None, exact: bool, as_json: bool, annotations: str | None, files: Sequence[Path]
) -> None:
    from kinacc.gate import outputs

    problems = []
    if exact and against is None:
        problems.append(Problem("--exact", "is of a comparison", "with --against FOLDER"))
    if as_json and annotations:
        problems.append(Problem("--json", "and --annotations both print", "one of them"))
    for path in files:
        try:
            outputs.writer(path)
        except InputError as error:
            problems += error.problems
        if not path.absolute().parent.is_dir():
            problems.append(Problem(str(path), "stands in a folder that is not there"))
    refuse(problems, "Nothing was looked at" if problems else "")


def _verdicts(
    results: Path,
    config: Sequence[str],
    datasets: Sequence[str],
    against: Path | None,
    exact: bool,
    with_screens: bool,
) -> Verdicts:
    from kinacc.gate import golden
    from kinacc.gate.gates import judged
    from kinacc.gate.outcome import FAILED, Verdicts
    from kinacc.workflow.verification.check import is_dataset

    if is_dataset(results):  # one data set was named in place of the folder of all
        results, datasets = results.resolve().parent, [*datasets, results.resolve().name]
    files = list(config) or [each for each in [_CONFIG] if Path(each).is_file()]
    if not files and against is None:
        what = f"is not given, and there is no {_CONFIG} here: no gate is known"
        raise InputError(Problem("--config", what, "a configuration, or --against FOLDER"))
    full, plan = _configurations(files, datasets)
    report = _checked(results, files, plan, datasets)
    outcomes = _sound(report)
    broken = {each.dataset for each in outcomes if each.verdict == FAILED}
    accepted = _accepted(full, against)
    found = judged(results, full, accepted, broken)
    outcomes += [replace(each, file=_file(each, files)) for each in found]
    if not files:
        outcomes.append(_ungated(results))
    if against is not None:
        meant = list(datasets) and list(plan.datasets if plan else datasets)
        outcomes += golden.compared(results, against, meant, exact)
    names = list(full) or [each.name for each in report.datasets]
    screens = _screens(results, names, broken) if with_screens else {}
    shown = "" if accepted is None else str(accepted)
    return Verdicts(str(results), shown, report.digest, tuple(outcomes), screens)


def _screens(results: Path, names: Sequence[str], broken: Collection[str]) -> dict[str, str]:
    """The first screen of every data set, for the forms that have them."""
    from kinacc.gate.first_screens import first_screens

    screens = first_screens(results, [each for each in names if each not in broken])
    return screens | dict.fromkeys(broken, "The results do not hold: nothing is told of them.\n")


def _configurations(
    files: Sequence[str], datasets: Sequence[str]
) -> tuple[dict[str, Mapping[str, Any]], Plan | None]:
    """Full settings of the data sets that are meant, and the plan of what their results are."""
    from kinacc.workflow.contradictions import load
    from kinacc.workflow.plan import planned

    if not files:
        return {}, None
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
    told = {name: full[name] for name in kept if "line_of" not in full[name]}
    return told, replace(plan, datasets=own)


def _checked(
    results: Path, files: Sequence[str], plan: Plan | None, datasets: Sequence[str]
) -> Report:
    from kinacc.workflow.results_lock import refuse_while_running
    from kinacc.workflow.verification.check import check_results

    refuse_while_running(results)
    report = check_results(results, plan, files, again=False)
    if plan is None and datasets:
        meant = tuple(each for each in report.datasets if each.name in datasets)
        report = replace(report, datasets=meant)
    return report


def _sound(report: Report) -> list[Outcome]:
    """What the check of the results found, an outcome for each data set."""
    from kinacc.gate.outcome import FAILED, PASSED, Outcome

    def failed(dataset: str, problems: Sequence[Problem]) -> Outcome:
        count = len(problems)
        says = f"{count} problem{'s' if count > 1 else ''}: {first_few(problems, 3)}"
        where = problems[0].where.partition(", column")[0]
        return Outcome(dataset, RESULTS, RESULTS, FAILED, says, report.advice, file=where)

    found = [failed(Path(each.where).name, [each]) for each in report.problems]
    for each in report.datasets:
        if each.problems:
            found.append(failed(each.name, each.problems))
        else:
            says = f"{len(each.checked)} files are as their records say"
            figures = {"files": len(each.checked)}
            found.append(Outcome(each.name, RESULTS, RESULTS, PASSED, says, figures=figures))
    return found


def _accepted(full: Mapping[str, Mapping[str, Any]], against: Path | None) -> Path | None:
    """The accepted run that is meant, held to its records; None where there is none."""
    from kinacc.gate.accepted import held

    asked = any(gate["kind"] == "against" for own in full.values() for gate in own["gates"])
    if against is None and asked and Path(_ACCEPTED).is_dir():
        against = Path(_ACCEPTED)
    if against is not None:
        held(against)
    return against


def _file(outcome: Outcome, files: Sequence[str]) -> str:
    """The configuration file that states a gate: the last in which its name stands."""
    named = [each for each in files if outcome.name in Path(each).read_text("utf-8", "replace")]
    return named[-1] if named else files[-1]


def _ungated(results: Path) -> Outcome:
    from kinacc.gate.outcome import WARNED, Outcome

    says = f"no configuration was given, and there is no {_CONFIG} here: no gate was read"
    fix = f"kinacc gate {results} --config FILE.yaml"
    return Outcome("", "gates", "value", WARNED, says, fix)

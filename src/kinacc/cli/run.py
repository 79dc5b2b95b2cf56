"""``kinacc run``: one stage of the workflow by hand."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path

import click

from kinacc.cli.choice import CONFIG, option
from kinacc.cli.group import Lazy
from kinacc.cli.output import Output, answers
from kinacc.errors import InputError, Problem, refuse
from kinacc.workflow.catalogue import STAGES, Stage


def _stage_command(name: str) -> click.Command:
    """The command that runs one stage."""
    stage = STAGES[name]

    @option("--dataset", help="Data set of the configuration; needed if there are two.")
    @option("--config", multiple=True, help=f"Configuration file; may be repeated. [{CONFIG}]")
    @option("--results", default="results", help="Results folder.")
    @answers("Print what was written as JSON.")
    def command(
        dataset: str | None,
        config: tuple[str, ...],
        results: str,
        out: Output,
        part: str | None = None,
    ) -> None:
        written = _run(stage, dataset, config or (CONFIG,), results, part)
        words = "\n".join(f"written: {path}" for path in written)
        out.say({"stage": name, "written": written}, words)

    if stage.scattered:
        words = "Part to compute, e.g. 1-of-2; all if left out."
        command = option("--part", help=words)(command)
    return click.command(name, help=_help(stage), short_help=stage.message)(command)


@click.group(
    cls=Lazy,
    sections={"Commands": {name: stage.message for name, stage in STAGES.items()}},
    make=_stage_command,
)
def run() -> None:
    """Run one stage by hand, as the workflow would.

    Reads the artefacts of earlier stages in results/<dataset>/ and writes its own there. The stages
    are listed in their order.

    \b
    Example:
      kinacc run dh --dataset mh180
    """


def _help(stage: Stage) -> str:
    reads = ", ".join((*stage.inputs, *(f"{name} (if there)" for name in stage.optional)))
    words = stage.message[0].upper() + stage.message[1:]
    settings = ", ".join((*stage.settings, *stage.synthetic_settings)) or "nothing"
    return (
        f"{words}.\n\nReads: {reads or 'no artefact'}.\n\nLeaves: {', '.join(stage.outputs)}."
        f"\n\nConfiguration used: {settings}."
        f"\n\n\b\nExample:\n  kinacc run {stage.name} --dataset mh180"
    )


def _run(
    stage: Stage, dataset: str | None, config: tuple[str, ...], results: str, part: str | None
) -> list[str]:
    """Run one stage of one data set and say what it wrote; InputError if it cannot be run."""
    # Here and not above: a stage says what it reads and leaves without a numerical library.
    from kinacc.workflow import cost
    from kinacc.workflow.local_executor import execute_all
    from kinacc.workflow.plan import planned
    from kinacc.workflow.results_lock import running, sharing

    plan = planned(config, results=results)
    names = list(plan.datasets)
    if dataset not in names and not (dataset is None and len(names) == 1):
        what = "is not given" if dataset is None else f"{dataset!r} is not in the configuration"
        raise InputError(Problem("--dataset", what, ", ".join(names)))
    dataset = dataset or names[0]
    if stage.name in plan.left_out(dataset):
        what = f"the data set cannot go through it: {plan.left_out(dataset)[stage.name]}"
        raise InputError(Problem(f"{dataset}, {stage.name}", what))
    absent = plan.absent(stage.name, dataset)
    absent += [
        Problem(path, "no such file", fix=f"make it first: kinacc run {Path(path).stem}")
        for path in plan.gates(stage.name, dataset)
        if not Path(path).is_file()
    ]
    parts = plan.part_names(stage.name, dataset)
    if part is not None and part not in parts:
        absent.append(Problem("--part", repr(part), ", ".join(map(str, parts))))
    refuse(absent, f"{stage.name} cannot be run")
    ahead = {(dataset, stage.name): cost.of_stage(stage.name, plan.datasets[dataset])}
    for line in cost.expected(ahead):
        click.echo(line, err=True)
    given = [word for name in config for word in ("--config", name)]
    words = shlex.join([*given, "--results", results])
    remake = f"kinacc run {{stage}} --dataset {{dataset}} {words}"
    jobs = [
        replace(plan.job(stage.name, dataset, each), remake=remake)
        for each in (parts if part is None else [part])
    ]
    with running(results) if part is None else sharing(results):
        return [path for job in execute_all(jobs) for path in job.outputs.values()]

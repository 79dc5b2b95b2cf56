"""The command line: every stage by hand, and the check of a results folder."""

from __future__ import annotations

import sys
from collections.abc import Callable

import click

from kinacc import __version__
from kinacc.commands.campaign import campaign
from kinacc.commands.check_data import check_data
from kinacc.commands.compare import compare
from kinacc.commands.compensate import compensate
from kinacc.commands.export import export
from kinacc.commands.init import init
from kinacc.commands.plan_campaign import plan_campaign
from kinacc.commands.plan_poses import plan_poses
from kinacc.commands.predict import predict
from kinacc.commands.tournament import tournament
from kinacc.errors import InputError, Problem
from kinacc.stages.catalogue import STAGES, Stage, maker_of

CONFIG = "config.yaml"


class Commands(click.Group):
    """A group whose commands report bad input as a list of problems, without a traceback."""

    def invoke(self, context: click.Context) -> object:
        """Run the command; exit code 2 on bad input."""
        try:
            return super().invoke(context)
        except InputError as error:
            click.echo(str(error), err=True)
            context.exit(2)


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="kinacc")
def main() -> None:
    """How accurate is a robot's kinematic model, and how large can its error be?

    `snakemake -c2` runs the whole study of config.yaml; here are its stages one by one, and the
    check of what it leaves.
    """


@main.group()
def run() -> None:
    """Run one stage by hand, as the workflow would.

    Reads the artefacts of earlier stages in results/<dataset>/ and writes its own there.
    """


@main.command("check-results")
@click.argument("folder", type=click.Path(), default="results")
@click.option("--json", "as_json", is_flag=True, help="Print the findings as JSON.")
@click.option("--config", multiple=True, help="Configuration the results should come from.")
def check_results(folder: str, as_json: bool, config: tuple[str, ...]) -> None:
    """Check every artefact in FOLDER: there, as the contract says, made from one another.

    With --config also that every data set of the configuration is there and was made with these
    values. Exit code 0 if all is well, 1 if anything is not.
    """
    from kinacc.artifacts import check
    from kinacc.stages.plan import planned

    sys.exit(check.main(folder, as_json, planned(config) if config else None))


@main.command("draw-robots")
@click.argument("output", type=click.Path(dir_okay=False))
@click.option("--draws", type=click.IntRange(1, 1000), default=21, show_default=True)
def draw_robots(output: str, draws: int) -> None:
    """Search synthetic arms like the paper's and write them to OUTPUT, a CSV file.

    Random arms are tried in order of their seeds, under the default configuration; those that meet
    Tables I to III and the true accuracy of 0.906 mm are kept, with the number tried. The table
    shipped with kinacc is src/kinacc/synthetic/accepted_draws.csv; `make test` says when it no
    longer follows from the code and the defaults, and this command makes it again (minutes).
    """
    from kinacc.synthetic import search

    tried = search.write(output, draws)
    click.echo(f"{tried} seeds tried for {draws} draws: {output}")


def _stage_command(stage: Stage) -> click.Command:
    """The command that runs one stage."""

    def command(dataset: str | None, config: tuple[str, ...], results: str, part: str | None):
        run_stage(stage, dataset, config or (CONFIG,), results, part)

    options = [
        click.Option(["--dataset"], help="Data set of the configuration; needed if there are two."),
        click.Option(
            ["--config"], multiple=True, help=f"Configuration file; may be repeated. [{CONFIG}]"
        ),
        click.Option(["--results"], default="results", show_default=True, help="Results folder."),
    ]
    if stage.scattered:
        options.append(
            click.Option(["--part"], help="Part to compute, e.g. 1-of-2; all if left out.")
        )
    callback = command if stage.scattered else _without_part(command)
    return click.Command(
        stage.name, params=options, callback=callback, help=_help(stage), short_help=stage.message
    )


def _without_part(command: Callable) -> Callable:
    return lambda **given: command(**given, part=None)


def _help(stage: Stage) -> str:
    reads = ", ".join((*stage.inputs, *(f"{name} (if there)" for name in stage.optional)))
    words = stage.message[0].upper() + stage.message[1:]
    settings = ", ".join(stage.settings) or "nothing"
    return (
        f"{words}.\n\nReads: {reads or 'no artefact'}.\n\nLeaves: {', '.join(stage.outputs)}."
        f"\n\nConfiguration used: {settings}."
    )


for _stage in STAGES.values():
    run.add_command(_stage_command(_stage))
main.add_command(init)
main.add_command(check_data)
main.add_command(predict)
main.add_command(compensate)
main.add_command(export)
main.add_command(compare)
main.add_command(plan_poses)
main.add_command(tournament)
main.add_command(plan_campaign)
main.add_command(campaign)


def run_stage(
    stage: Stage,
    dataset: str | None,
    config: tuple[str, ...],
    results: str = "results",
    part: str | None = None,
) -> None:
    """Run one stage of one data set; InputError if it cannot be run as asked."""
    from pathlib import Path

    from kinacc.stages.plan import planned
    from kinacc.stages.runner import Job, execute

    plan = planned(config, results=results)
    names = list(plan.datasets)
    if dataset not in names and not (dataset is None and len(names) == 1):
        what = "is not given" if dataset is None else f"{dataset!r} is not in the configuration"
        raise InputError(Problem("--dataset", what, ", ".join(names)))
    dataset = dataset or names[0]
    if stage.name in plan.left_out(dataset):
        what = f"the data set cannot go through it: {plan.left_out(dataset)[stage.name]}"
        raise InputError(Problem(f"{dataset}, {stage.name}", what))
    inputs = plan.inputs(stage.name, dataset)
    absent = [
        Problem(path, "no such file", fix=f"make it first: kinacc run {maker_of(name).name}")
        for name, given in inputs.items()
        for path in ([given] if isinstance(given, str) else given)
        if not Path(path).is_file()
    ]
    parts = plan.part_names(stage.name, dataset)
    if part is not None and part not in parts:
        absent.append(Problem("--part", repr(part), ", ".join(map(str, parts))))
    if absent:
        raise InputError(absent, f"{stage.name} cannot be run")
    for each in parts if part is None else [part]:
        execute(
            Job(
                stage.module,
                inputs,
                plan.outputs(stage.name, dataset, each),
                plan.settings(stage.name, dataset),
                plan.seed(dataset),
                part=each,
                label=" ".join(filter(None, [dataset, stage.name, each])),
                log=plan.log(stage.name, dataset, each),
            ),
            bar=True,
        )


if __name__ == "__main__":
    main()

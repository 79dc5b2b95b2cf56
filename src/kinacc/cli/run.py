"""``kinacc calibrate`` and ``study``: the workflow up to a target, and what it made."""

from __future__ import annotations

import os
import shlex
from contextlib import nullcontext
from pathlib import Path

import click

from kinacc.cli.choice import CONFIG, option, together
from kinacc.cli.output import Output, answers
from kinacc.cli.results import as_plain, written
from kinacc.errors import input_error
from kinacc.report.summarise import summarise_all
from kinacc.report.terminal import FEW, print_summaries
from kinacc.workflow.data_sets import RESULTS, read_data_sets
from kinacc.workflow.running import held
from kinacc.workflow.start import SNAKEFILE, run_workflow

_options = together(
    option("--cores", "-c", type=click.IntRange(1), help="Processor cores. [all]"),
    click.argument("arguments", nargs=-1, type=click.UNPROCESSED, metavar="[FILE.yaml|FOLDER]..."),
)


@click.command("calibrate", context_settings={"ignore_unknown_options": True})
@_options
@answers()
def calibrate(arguments: tuple[str, ...], cores: int | None, out: Output) -> None:
    """Fit the models of the data sets of FILE.yaml, and show their held-out errors.

    Results go to results/ in the current folder. Several files, or all of a FOLDER, are merged in
    order. Words after -- go to Snakemake.

    \b
    Example:
      kinacc calibrate tracker.yaml
      kinacc calibrate tracker.yaml -- --dry-run
    """
    configs, folders = _carried_out("calibration", arguments, cores, None)
    if not folders:
        return
    if out.as_json:
        out.show(as_plain(summarise_all(folders)))
        return
    pages = [written(str(folder)) for folder in folders if len(folders) <= FEW]
    print_summaries(folders)
    if pages:
        click.echo(f"Page: {', '.join(map(str, pages))}")
    click.echo(f"Accuracy map, study and claims: {shlex.join(['kinacc', 'study', *configs])}")


@click.command("study", context_settings={"ignore_unknown_options": True})
@_options
@answers()
def study(arguments: tuple[str, ...], cores: int | None, out: Output) -> None:
    """Carry out the whole study of the data sets of FILE.yaml.

    Calibration, map of errors, operating points, the paper's assessors under noise, figures and
    claims. Without FILE.yaml: config.yaml or, where there is none, the paper. Words after -- go to
    Snakemake.

    \b
    Example:
      kinacc study tracker.yaml
    """
    configs, folders = _carried_out("all", arguments, cores, SNAKEFILE.with_name("config.yaml"))
    if not folders:
        return
    if out.as_json:
        out.show({"results": folders})
        return
    print_summaries(folders)
    options = [word for name in configs for word in ("--config", name)]
    check = shlex.join(["kinacc", "check-results", RESULTS, *options])
    click.echo(f"Tables and figures: {', '.join(map(str, folders))}. Check them: {check}")


def _carried_out(
    target: str, arguments: tuple[str, ...], cores: int | None, default: Path | None
) -> tuple[list[str], list[Path]]:
    """Run the workflow up to a target: the configuration files and, after a real run, folders.

    ``arguments`` are configuration files, folders of these and, from the first that begins with
    ``-``, Snakemake's; without files config.yaml is meant, or the ``default`` where there is none.
    Leaves with Snakemake's exit code where that is not 0. InputError for bad configuration.
    """
    first = next((i for i, word in enumerate(arguments) if word.startswith("-")), len(arguments))
    names, options = arguments[:first], list(arguments[first:])
    if not names and Path(CONFIG).is_file():
        names = (CONFIG,)
    elif not names and default is not None:
        names = (str(default),)
    elif not names:
        message = f"no configuration file is given, and there is no {CONFIG} here"
        fix = "kinacc init MEASUREMENTS writes one; then: kinacc calibrate NAME.yaml"
        raise input_error("FILE.yaml", message, fix=fix)
    configs: list[str] = []
    for name in names:
        files = [name]
        if Path(name).is_dir():
            files = sorted(map(str, Path(name).glob("*.yaml")))
            files = [file for file in files if not file.endswith(".robot.yaml")]
        if not files:
            fix = "kinacc init MEASUREMENTS --out FOLDER writes one"
            message = "is a folder without configuration files"
            raise input_error(name, message, "*.yaml", fix)
        configs += files
    data = read_data_sets(configs)
    is_run = {"-n", "--dry-run", "--dryrun", "--lint"}.isdisjoint(options)
    with held(RESULTS) if is_run else nullcontext():  # --no-hooks leaves out the lock
        code = run_workflow(target, configs, cores or os.cpu_count() or 1, options)
    if code:
        raise SystemExit(code)
    return configs, [Path(RESULTS, name) for name in data.reported] if is_run else []

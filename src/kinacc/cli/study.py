"""``kinacc study``: everything the workflow makes of a data set."""

from __future__ import annotations

import json
import shlex

import click

from kinacc.cli.calibrate import CORES, JSON, TARGETS, WORDS, carried_out, show_many


@click.command("study", context_settings=WORDS)
@CORES
@JSON
@TARGETS
def study(words: tuple[str, ...], cores: int | None, as_json: bool) -> None:
    """Carry out the whole study of the data sets of FILE.yaml.

    Beside the calibration: the map of errors, the operating points, the paper's assessors under
    noise, figures and claims. Without a FILE.yaml the study is that of config.yaml
    or, where there is none, of the paper. Words after -- go to Snakemake.

    \b
    Example:
      kinacc study tracker.yaml
      kinacc study config.yaml tracker.yaml -- --dry-run
    """
    from kinacc.workflow.answer import answer, read
    from kinacc.workflow.fleet import FEW
    from kinacc.workflow.plan import SNAKEFILE

    paper = SNAKEFILE.parent / "config.yaml"
    configs, plan = carried_out("all", words, cores, default=paper)
    if plan is None:
        return
    if as_json:
        click.echo(json.dumps({"results": [f"{plan.results}/{name}" for name in plan.told]}))
        return
    options = [word for name in configs for word in ("--config", name)]
    check = shlex.join(["kinacc", "check-results", plan.results, *options])
    if len(plan.told) > FEW:
        show_many([f"{plan.results}/{name}" for name in plan.told], [check])
        return
    for dataset in plan.told:
        folder = f"{plan.results}/{dataset}"
        lines = answer(folder, read(folder), following=[check])
        click.echo("\n".join(["", *lines, f"tables and figures are in {folder}"]))

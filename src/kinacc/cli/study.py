"""``kinacc study``: everything the workflow makes of a data set."""

from __future__ import annotations

import json
import shlex

import click

from kinacc.cli.calibrate import carried_out, workflow_options
from kinacc.report.terminal import print_summaries
from kinacc.workflow.data_sets import RESULTS
from kinacc.workflow.start import SNAKEFILE


@click.command("study", context_settings={"ignore_unknown_options": True})
@workflow_options
def study(arguments: tuple[str, ...], cores: int | None, as_json: bool) -> None:
    """Carry out the whole study of the data sets of FILE.yaml.

    Beside the calibration: the map of errors, the operating points, the paper's assessors under
    noise, figures and claims. Without a FILE.yaml the study is that of config.yaml
    or, where there is none, of the paper. Words after -- go to Snakemake.

    \b
    Example:
      kinacc study tracker.yaml
      kinacc study config.yaml tracker.yaml -- --dry-run
    """
    configs, folders = carried_out("all", arguments, cores, SNAKEFILE.with_name("config.yaml"))
    if not folders:
        return
    if as_json:
        click.echo(json.dumps({"results": [str(folder) for folder in folders]}))
        return
    print_summaries(folders)
    options = [word for name in configs for word in ("--config", name)]
    check = shlex.join(["kinacc", "check-results", RESULTS, *options])
    click.echo(f"Tables and figures: {', '.join(map(str, folders))}. Check them: {check}")

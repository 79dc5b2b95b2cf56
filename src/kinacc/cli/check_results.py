"""``kinacc check-results``: a results folder held to its contract."""

from __future__ import annotations

import sys

import click

from kinacc.cli.output import Output, answers
from kinacc.workflow.plan import planned
from kinacc.workflow.results_lock import refuse_while_running
from kinacc.workflow.verification import check


@click.command("check-results")
@click.argument("folder", type=click.Path(), default="results")
@answers("Print the findings as JSON.")
@click.option("--config", multiple=True, help="Configuration the results should come from.")
@click.option(
    "--all", "every", is_flag=True, help="Compute all simulations and cells again, not a sample."
)
@click.option("--expect", metavar="DIGEST", help="Digest of all records that has to be found.")
def check_results(
    folder: str, config: tuple[str, ...], every: bool, expect: str | None, out: Output
) -> None:
    """Check every artefact in FOLDER: there, as the contract says, made from one another.

    Numbers are computed again from the tables they were made from. With --config also that every
    data set of the configuration is there and was made with these values. The digest of all records
    is printed: kept elsewhere, it tells with --expect whether anything was written anew. Exit code
    0 if all is well, 1 if anything is not.

    \b
    Example:
      kinacc check-results results/
      kinacc check-results results/ --config config.yaml --config my-robot.yaml --json
    """
    refuse_while_running(folder)
    report = check.check_results(folder, planned(config) if config else None, config, every, expect)
    out.say(report.to_dict(), str(report))
    sys.exit(report.exit_code)

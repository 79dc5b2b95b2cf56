"""``kinacc check-results``: a results folder held to its schemas, thresholds and accepted run."""

from __future__ import annotations

import re
from pathlib import Path

import click

from kinacc.cli.choice import CONFIG


@click.command("check-results")
@click.argument("results", type=click.Path(path_type=Path), default="results")
@click.option(
    "--config", multiple=True, metavar="FILE", help=f"Configuration with thresholds.  [{CONFIG}]"
)
@click.option("--against", type=click.Path(path_type=Path), metavar="FOLDER", help="Accepted run.")
@click.option("--dataset", "datasets", multiple=True, metavar="NAME", help="Data sets checked.")
@click.option(
    "--accept",
    "accepted",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Folder of the accepted run, made from RESULTS where nothing fails.",
)
@click.option("--reason", default="", help="Reason for --accept.")
@click.option("--json", "as_json", is_flag=True, help="Output as JSON.")
@click.option(
    "--out",
    "-o",
    "files",
    multiple=True,
    type=click.Path(path_type=Path),
    help="Further output file: .json, metrics.json, .xml (JUnit), .md or .txt.",
)
def check_results(
    results: Path,
    config: tuple[str, ...],
    against: Path | None,
    datasets: tuple[str, ...],
    accepted: Path | None,
    reason: str,
    as_json: bool,
    files: tuple[Path, ...],
) -> None:
    """Check tables, digests, thresholds and, with --against, an accepted run.

    Exit code 0 where nothing failed, 1 where something did, 2 where the input cannot be used.

    \b
    Example:
      kinacc check-results results --config tracker.yaml --against accepted --out check.xml
    """
    from kinacc.checks.contradictions import load
    from kinacc.gate import accepted as runs
    from kinacc.gate import check, outputs
    from kinacc.tables import sums

    if (results / sums.FOLDER).is_dir():  # one data set was named in place of the folder of all
        results, datasets = results.resolve().parent, (*datasets, results.resolve().name)
    configs = config
    if not config and Path(CONFIG).is_file():  # beside another workflow it may be that workflow's
        is_own = re.search("^datasets:", Path(CONFIG).read_text("utf-8"), re.MULTILINE)
        configs = (CONFIG,) if is_own else ()
    report = check.check_results(results, load(configs) if configs else {}, against, datasets)
    for path in files:
        outputs.write(report, path)
    click.echo(outputs.as_json(report) if as_json else outputs.as_text(report), nl=not as_json)
    if not report.passed:
        raise SystemExit(1)
    if accepted is not None:
        names = list(datasets) or check.data_sets_in(results)
        note = runs.accept(results, accepted, names, reason)
        click.echo(f"accepted: {', '.join(note['datasets'])} in {accepted}", err=as_json)

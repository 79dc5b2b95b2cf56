"""``kinacc report``: one page that says what the results of a data set are worth."""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

import click

from kinacc.cli.output import Output, answers

if TYPE_CHECKING:
    from kinacc.workflow.runner import Job

_PAGE = "report.html"


@click.command("report")
@click.argument("folder", type=click.Path())
@click.option(
    "--out", "-o", "path", type=click.Path(), help=f"Where to write it.  [FOLDER/{_PAGE}]"
)
@answers()
def report(folder: str, path: str | None, out: Output) -> None:
    """Write one page on FOLDER, the results of a data set, to read, mail and keep.

    How accurate the calibrated model is, how sure that is and what to do next; then residuals, the
    check of the data, what the poses leave open, parameters, maps and campaigns, as far as they are
    there, with pictures to explore. One HTML file that needs no network. Tables that were made from
    others than those now in FOLDER are left out, and named.

    \b
    Example:
      kinacc report results/ur10_b
      kinacc report results/ur10_b --out ur10_b.html
    """
    page = written(folder, path)
    size = page.stat().st_size
    out.say(
        {"page": str(page), "bytes": size},
        f"{page}: {size / 1e6:.1f} MB, one file that needs no network",
    )


def written(folder: str, out: str | None = None, without: Collection[str] = ()) -> Path:
    """Write the page of a results folder, and return where it is.

    ``without``: tables to leave out. Raises InputError naming all tables missing.
    """
    from kinacc.workflow.runner import perform

    job = _job(Path(folder), out or str(Path(folder) / _PAGE), without)
    perform(job)
    return Path(job.outputs["html"])


def _job(folder: Path, out: str, without: Collection[str]) -> Job:
    from kinacc.artifacts import records
    from kinacc.artifacts.store import read_metadata
    from kinacc.campaign.journal import of_results
    from kinacc.workflow.answer import read
    from kinacc.workflow.catalogue import STAGES
    from kinacc.workflow.plan import RESULTS, campaign_files
    from kinacc.workflow.runner import Job
    from kinacc.workflow.verification.lineage import outdated

    stage = STAGES["report"]
    read(folder, stage.inputs)
    old = outdated(folder, set(stage.optional) - set(without))
    shown = [name for name in (*stage.inputs, *stage.optional) if name not in {*without, *old}]
    paths = {name: folder / f"{name}.parquet" for name in shown}
    inputs = {name: str(path) for name, path in paths.items() if path.is_file()}
    inputs |= campaign_files(of_results(folder))
    settings: dict[str, object] = {"dataset": folder.resolve().name}
    if folder != Path(RESULTS) / folder.resolve().name:
        settings["folder"] = str(folder)
    if old:
        settings["outdated"] = sorted(old)
    seed = int(read_metadata(paths["summary"])["seed"])
    uses = stage.used(settings, inputs)
    own = os.path.abspath(out) == os.path.abspath(folder / _PAGE)
    return Job(
        stage.module,
        inputs,
        {"html": out},
        settings,
        seed,
        label="report",
        uses=uses,
        stage=stage.name,
        record=records.place(folder, stage.name) if own else "",
    )

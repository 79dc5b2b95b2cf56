"""``kinacc report``: one page that says what the results of a data set are worth."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import click

from kinacc.cli import choice
from kinacc.cli.output import Output, answers

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
    from kinacc import __version__
    from kinacc.campaign.folder import of_results
    from kinacc.deployment.folder import read_tables
    from kinacc.report import dataset
    from kinacc.report.page import html
    from kinacc.report.summarise import ON_PAGE, PAGE_TABLES
    from kinacc.tables import sums
    from kinacc.tables.atomic import write_whole
    from kinacc.workflow.data_sets import campaign_files

    place = Path(folder)
    reason = choice.say_outdated(folder)
    old = {Path(name).stem for name in sums.outdated(place)} - {Path(_PAGE).stem, *PAGE_TABLES}
    tables = read_tables(place, needed=PAGE_TABLES, optional=ON_PAGE)
    shown = {name: table for name, table in tables.items() if name not in {*without, *old}}
    campaigns = {role: Path(path) for role, path in campaign_files(of_results(place)).items()}
    settings = {
        "dataset": place.resolve().name,
        "folder": folder,
        "outdated": sorted(old),
        "reason": reason,
    }
    path = Path(out or place / _PAGE)
    page = dataset.run({**shown, **campaigns}, settings)
    write_whole(path, html(page, {"kinacc_version": __version__}).encode())
    return path

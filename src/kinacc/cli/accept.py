"""``kinacc accept``: make a run the accepted one, by a person."""

from __future__ import annotations

from pathlib import Path

import click

from kinacc.cli.output import Output, answers
from kinacc.workflow.plan import RESULTS


@click.command("accept")
@click.argument("results", type=click.Path(path_type=Path), default=RESULTS)
@click.option("--reason", required=True, help="Why this run is as it should be.")
@click.option(
    "--to",
    "folder",
    type=click.Path(path_type=Path),
    default="accepted",
    show_default=True,
    help="Folder of the accepted run.",
)
@click.option(
    "--dataset", "datasets", multiple=True, metavar="NAME", help="These alone; others stay."
)
@click.option("--by", metavar="NAME", help="Who accepts it.  [who is logged in]")
@answers("Print what was accepted as JSON.")
def accept(
    results: Path,
    reason: str,
    folder: Path,
    datasets: tuple[str, ...],
    by: str | None,
    out: Output,
) -> None:
    """Make the run in RESULTS the accepted one, to which `kinacc gate --against` holds later runs.

    Its tables and records are copied, with the reason, the date and who accepted it; what was
    accepted before is named there. Commit the folder to version control. A person does this after
    a look at the results: it is refused on a build server, in a workflow, and where `kinacc
    check-results` finds anything wrong.

    \b
    Example:
      kinacc accept results --reason "first run of the new cell, looked through with J. Weber"
    """
    import os
    from dataclasses import asdict
    from datetime import UTC, datetime

    from kinacc.gate import accepted
    from kinacc.workflow.verification.check import check_results

    problems = [*accepted.refusals(os.environ)]
    report = check_results(results)
    meant = [each for each in report.datasets if not datasets or each.name in datasets]
    problems += [problem for each in meant for problem in each.problems]
    problems += report.problems
    acceptance = {
        "reason": " ".join(reason.split()),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "by": by or _user(),
    }
    note = accepted.accept(results, folder, acceptance, datasets, problems)
    last = note.last
    words = [f"{folder}: accepted {', '.join(datasets or last.datasets)}, digest {last.digest}"]
    if note.before:
        words.append(f"before: {note.before[0].reason} ({note.before[0].date})")
    out.say(asdict(last), "\n".join(words))


def _user() -> str:
    import getpass

    try:
        return getpass.getuser()
    except (KeyError, OSError):  # a container may run as a number without a name
        return "not known"

"""``kinacc show``: a table in the terminal, a picture of it, or the same for a spreadsheet."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from kinacc.cli.output import Output, answers
from kinacc.errors import Problem, refuse

if TYPE_CHECKING:
    from kinacc.cli.screen import Screen
    from kinacc.cli.sheet import Sheet

_ALL = "all"
_ROWS = 20


class _Rows(click.ParamType):
    name = "rows"

    def convert(self, value, param, ctx) -> int:
        """A number of rows; more than any table has for all of them."""
        if isinstance(value, int) or value == _ALL:
            return sys.maxsize if value == _ALL else value
        if not value.isdecimal() or int(value) < 1:
            self.fail(f"{value!r} is neither a number of rows nor {_ALL}", param, ctx)
        return int(value)


@click.command("show")
@click.argument("path", type=click.Path(), default="results")
@click.argument("name", metavar="[TABLE]", required=False)
@click.option("--columns", metavar="A,B,..", help="Show these columns, in this order; q* for q1 ..")
@click.option(
    "--where",
    "conditions",
    multiple=True,
    metavar="COLUMN=VALUE",
    help="Take only rows that say so, - where there is no value; may be repeated.",
)
@click.option(
    "--rows",
    type=_Rows(),
    metavar="N|all",
    help=f"Rows: of both ends on the screen [{_ROWS}], the first in CSV, JSON and --out [all].",
)
@click.option("--describe", is_flag=True, help="Say what the columns mean, and what they hold.")
@click.option("--csv", "as_csv", is_flag=True, help="Print rows with all digits as CSV.")
@answers("Print rows as JSON.", table=True)
def show(
    path: str,
    name: str | None,
    columns: str | None,
    conditions: tuple[str, ...],
    rows: int | None,
    describe: bool,
    as_csv: bool,
    out: Output,
) -> None:
    """Show a TABLE of results, or what is in the folder PATH, of results or of a campaign.

    A table is a Parquet file, named with or without its ending, alone or after its folder. What is
    the same in every row stands above the table; what does not fit the screen is named.

    \b
    Example:
      kinacc show
      kinacc show results/ur10_b
      kinacc show results/ur10_b residuals --where fold=-
      kinacc show results/ur10_b/measurements --columns "pose,q*" --csv > joints.csv
    """
    from kinacc.cli import show_files, show_table

    refuse(at_odds({"--csv": as_csv, "--json": out.as_json}))
    refuse(at_odds({"--describe": describe, "--out": out.table is not None}))
    answer = Answer(out, as_csv)
    place = show_files.found(path, name)
    if place.is_dir():
        given = {"--columns": columns, "--where": conditions, "--describe": describe}
        refuse(_of_tables(place, given))
        listed = show_files.listing(place)
        answer.give(listed.sheet, rows, below=listed.below)
        return
    kept = show_table.where(show_table.read(place), conditions)
    chosen = show_table.choose(kept, columns)
    above, below = show_table.words(chosen, describe)
    if describe:
        answer.give(show_table.described(chosen), rows, above, below)
    else:
        answer.give(chosen.sheet, rows, above, below, columns is None, is_table=True)


@dataclass(frozen=True)
class Answer:
    """Where a sheet goes: to the screen, or to a machine."""

    out: Output
    as_csv: bool = False

    def give(
        self,
        sheet: Sheet,
        rows: int | None,
        above: Iterable[str] = (),
        below: Iterable[str] = (),
        hoist: bool = False,
        is_table: bool = False,
    ) -> None:
        """Hand out a sheet, ``rows`` of it at most where that is said.

        What stands ``above`` and ``below`` is for the screen, and so is leaving out rows of a table
        unasked.
        """
        from kinacc.cli.screen import Screen

        if self.out.as_json or self.out.table is not None:
            self.out.deliver(sheet.first(rows))
            return
        if self.as_csv:
            click.echo(sheet.first(rows).as_csv(), nl=False)
            return
        screen = Screen.here()
        screen.words(sheet.title, "bold")
        for line in above:
            screen.words(line)
        if is_table and len(sheet) == 1:
            screen.record(sheet)
        else:
            more = ["--columns {0},.. shows them"] if is_table else []
            screen.table(sheet, rows or (_ROWS if is_table else None), hoist, *more)
        for line in below:
            screen.words(line, "dim")
        self.show(screen)

    def show(self, screen: Screen) -> None:
        """Print what was composed; what is coloured was decided by the terminal and NO_COLOR."""
        click.echo(screen.text(), nl=False, color=True)


def at_odds(given: dict[str, bool]) -> list[Problem]:
    """The problem with options of which only one can be had."""
    both = [name for name, is_given in given.items() if is_given]
    return [Problem(" and ".join(both), "cannot be had together", "one")] if both[1:] else []


def _of_tables(folder: Path, given: dict[str, object]) -> list[Problem]:
    """The problem with options that are about a table, where a folder was given."""
    names = [name for name, value in given.items() if value]
    if not names:
        return []
    fix = f"name one as well; `{shlex.join(['kinacc', 'show', str(folder)])}` lists them"
    return [Problem(str(folder), f"is a folder, {', '.join(names)} is about one table", "", fix)]

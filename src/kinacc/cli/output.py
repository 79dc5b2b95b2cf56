"""Where the answer of a command goes: the screen, as words or JSON, a table, a picture."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from kinacc.errors import InputError, Problem

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from kinacc.cli.sheet import Sheet
    from kinacc.report.page import Page

TABLES = (".csv", ".json", ".parquet", ".xlsx")
PICTURES = (".svg", ".png", ".pdf")
PAGES = (".html",)


@dataclass(frozen=True)
class Output:
    """What the options of :func:`answers` say."""

    as_json: bool = False
    table: str | None = None
    picture: str | None = None
    page: str | None = None
    force: bool = False

    def say(self, facts: object, words: str) -> None:
        """Print the answer for a machine or for a person."""
        click.echo(json.dumps(plain(facts), indent=1) if self.as_json else words)

    def deliver(self, sheet: Sheet, words: str = "") -> None:
        """Write the table; print it, and ``words`` below it, where no file or machine takes it."""
        if self.table is not None:
            sheet.write(self.table)
        if self.as_json:
            click.echo(sheet.as_json())
            return
        if self.table is None:
            click.echo(sheet.as_text())
        else:
            named = f"{sheet.title}\n{len(sheet)} rows: " if sheet.title else ""
            click.echo(f"{named}{self.table}")
        if words:
            click.echo(words)

    def draw(self, figure: Figure) -> None:
        """Write the picture."""
        from kinacc.figures.save import write

        path = Path(self.picture or "")
        write(figure, {path.suffix[1:]: path})

    def write_page(self, page: Page) -> None:
        """Write the page a person reads in a browser."""
        from kinacc.report.page import html
        from kinacc.tables.atomic import write_whole

        write_whole(Path(self.page or ""), html(page).encode())


def answers(
    as_json: str = "Print the answer as JSON.",
    table: bool = False,
    picture: str = "",
    page: str = "",
    force: str = "",
) -> Callable[[Callable], Callable]:
    """Options of a command's answer, handed over as ``out``; its files can be written then.

    ``as_json``, ``picture``, ``page`` and ``force`` are helps of options, ``table`` is for --out.
    """
    options = [click.option("--json", "as_json", is_flag=True, help=as_json)]
    if table:
        words = "Write to a .csv, .xlsx, .json or .parquet file."
        options.insert(0, click.option("--out", "-o", "table", type=click.Path(), help=words))
    if page:
        options.insert(0, click.option("--page", type=click.Path(), help=page))
    if picture:
        options.insert(0, click.option("--picture", type=click.Path(), help=picture))
    if table or picture or page or force:
        words = force or "Replace a file that is there."
        options.append(click.option("--force", is_flag=True, help=words))

    def decorate(command: Callable) -> Callable:
        @wraps(command)
        def called(**given: object) -> None:
            out = Output(**{name: given.pop(name) for name in _NAMES if name in given})
            require_writable([out.table], out.force, TABLES)
            require_writable([out.picture], out.force, PICTURES)
            require_writable([out.page], out.force, PAGES)
            command(out=out, **given)

        for option in reversed(options):
            called = option(called)
        return called

    return decorate


_NAMES = tuple(each.name for each in fields(Output))


def plain(value: Any) -> Any:
    """What JSON and Arrow know, whatever it is nested in; None for a number that is not finite."""
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    value = value.item() if hasattr(value, "item") else value
    return None if isinstance(value, float) and not math.isfinite(value) else value


def require_writable(
    paths: Iterable[Path | str | None], force: bool, kinds: Sequence[str] = ()
) -> None:
    """Raise InputError where a file could not or should not be written."""
    problems = []
    for path in [Path(each) for each in paths if each is not None]:
        if path.is_dir():
            problems.append(Problem(str(path), "is a folder", "a file"))
            continue
        if kinds and path.suffix not in kinds:
            problems.append(Problem(str(path), f"ends in {path.suffix!r}", ", ".join(kinds)))
        if path.exists() and not force:
            problems.append(
                Problem(str(path), "is there already", fix="give --force to replace it")
            )
    if problems:
        raise InputError(problems, "Nothing was written")

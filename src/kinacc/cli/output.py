"""Where the answer of a command goes: the screen, as text or JSON, a table, a picture, a page."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np
import pandas as pd
from pydantic_core import to_jsonable_python

from kinacc.config.names import in_csv
from kinacc.errors import as_seen
from kinacc.report.terminal import print_table
from kinacc.tables.atomic import require_writable, write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TABLES = (".csv", ".json", ".parquet", ".xlsx")
PICTURES = (".svg", ".png", ".pdf")
PAGES = (".html",)
Command = Callable[..., None]


@dataclass(frozen=True)
class Output:
    """Values of the options of :func:`answers`."""

    as_json: bool = False
    table: str | None = None
    picture: str | None = None
    page: str | None = None
    force: bool = False
    verbose: bool = False

    def __post_init__(self) -> None:
        """Raise InputError where a file could not or should not be written."""
        require_writable([self.table], self.force, TABLES)
        require_writable([self.picture], self.force, PICTURES)
        require_writable([self.page], self.force, PAGES)

    def show(
        self,
        answer: object,
        table: pd.DataFrame | None = None,
        lines: Iterable[str] = (),
        shown: pd.DataFrame | None = None,
        most: int = 24,
    ) -> None:
        """Write ``table``; print ``answer`` as JSON, or ``lines`` and the table.

        ``answer`` is the result of the command, a dataclass or a mapping; ``shown`` are the rows
        of the screen, where they are not those of ``table``, and ``most`` the number of these.
        """
        table = pd.DataFrame() if table is None else table
        if self.table is not None:
            write_table(table, self.table, answer)
        if self.as_json:
            click.echo(json.dumps(plain(answer), indent=1))
            return
        for line in lines:
            click.echo(as_seen(line))
        shown = table if shown is None else shown
        if self.table is not None:
            click.echo(f"{self.table}: {len(table)} rows")
        elif len(shown):
            print_table(shown, most)

    def draw(self, figure: Figure) -> None:
        """Write the picture."""
        from kinacc.figures.save import write

        path = Path(self.picture or "")
        write(figure, {path.suffix[1:]: path})


def answers(
    table: bool = False,
    picture: str = "",
    page: str = "",
    force: bool = False,
    verbose: bool = False,
) -> Callable[[Command], Command]:
    """Options of a command's answer, handed over as ``out``; its files can be written then.

    ``picture`` and ``page`` are helps of options; ``table`` is for --out; ``force``
    for a command that writes other files.
    """
    file = click.Path()
    options = (
        (table, ("--out", "-o", "table"), "Table as .csv, .xlsx, .json or .parquet.", file),
        (picture, ("--picture",), picture, file),
        (page, ("--page",), page, file),
        (True, ("--json", "as_json"), "Answer as JSON.", None),
        (verbose, ("--verbose",), "Every row and detail.", None),
        (table or picture or page or force, ("--force",), "Replacement of existing files.", None),
    )

    def decorate(command: Command) -> Command:
        @wraps(command)
        def run(**options: Any) -> None:
            values = {item.name: options.pop(item.name) for item in fields(Output)
                      if item.name in options}  # fmt: skip
            command(out=Output(**values), **options)

        for has, names, text, kind in reversed(options):
            if has:
                run = click.option(*names, type=kind, is_flag=kind is None, help=text)(run)
        return run

    return decorate


def write_table(table: pd.DataFrame, path: Path | str, answer: object = None) -> None:
    """Write a table whole, by the ending: .csv, .xlsx, .parquet, or .json of the whole answer."""
    suffix, content = Path(path).suffix, io.BytesIO()
    if suffix == ".json":
        write_whole(path, (json.dumps(plain(answer), indent=1) + "\n").encode())
        return
    if suffix == ".parquet":
        table.to_parquet(content, index=False)
    else:
        # No text is a formula, or steers a terminal.
        safe = table.rename(columns=in_csv).map(
            lambda value: in_csv(as_seen(value)) if isinstance(value, str) else value
        )
        if suffix == ".csv":
            safe.to_csv(content, index=False, float_format="%.12g", lineterminator="\n")
        else:
            safe.to_excel(content, index=False, freeze_panes=(1, 0))
    write_whole(path, content.getvalue())


def plain(value: object) -> Any:
    """What JSON holds, of results however nested; None for a number that is not finite."""
    return to_jsonable_python(value, inf_nan_mode="null", fallback=_plain)


def _plain(value: Any) -> Any:
    if isinstance(value, pd.DataFrame):
        return value.to_dict("records")
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else str(value)

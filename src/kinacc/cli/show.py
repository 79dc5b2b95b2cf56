"""``kinacc show``: the tables of a folder, and one table in the terminal or in a file."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path

import click
import pandas as pd
import pyarrow as pa
from rich.table import Table

from kinacc.campaign.journal import PLAN
from kinacc.cli.output import plain, require_writable
from kinacc.cli.summary import write
from kinacc.config.values import nearest
from kinacc.errors import InputError, Problem, as_seen, first_few, refuse
from kinacc.report.terminal import screen
from kinacc.tables import store
from kinacc.tables.contract import ARTEFACTS

_ROWS = 20
_NONE = "-"
_SENTENCE = 40  # characters: longer texts are wrapped


@click.command("show")
@click.argument("path", type=click.Path(path_type=Path), default=Path("results"))
@click.argument("name", metavar="[TABLE]", required=False)
@click.option("--columns", metavar="A,B,..", help="Columns, in this order; q* for q1 ..")
@click.option(
    "--where",
    "conditions",
    multiple=True,
    metavar="COLUMN=VALUE",
    help="Rows with this value, - for none; may be repeated.",
)
@click.option("--rows", type=click.IntRange(1), help=f"Number of rows.  [{_ROWS} on the screen]")
@click.option("--describe", is_flag=True, help="Unit, meaning and contents of the columns.")
@click.option("--csv", "as_csv", is_flag=True, help="Rows with all digits as CSV.")
@click.option("--json", "as_json", is_flag=True, help="Rows as JSON.")
@click.option("--out", "-o", type=click.Path(), help="Table as .csv, .xlsx or .parquet.")
@click.option("--force", is_flag=True, help="Replacement of an existing file.")
def show(path, name, columns, conditions, rows, describe, as_csv, as_json, out, force) -> None:
    """Show a TABLE of results, or list the tables of the folder PATH.

    \b
    Example:
      kinacc show results/ur10_b
      kinacc show results/ur10_b residuals --where fold=-
      kinacc show results/ur10_b/measurements --columns "pose,q*" --csv > joints.csv
    """
    require_writable([out], force, (".csv", ".xlsx", ".parquet"))
    place = find(path, name)
    units: Mapping[str, str] = {}
    if place.is_dir():
        of_table = {"--columns": columns, "--where": conditions, "--describe": describe}
        named = [option for option, value in of_table.items() if value]
        if named:
            what = f"is a folder, and {', '.join(named)} is about one table"
            raise InputError(Problem(str(place), what, fix=f"{_typed(place)} lists its tables"))
        frame = listing(place)
    else:
        frame, units = read(place)
        frame = choose(frame, columns, conditions)
        if describe:
            frame, units = described(frame, units, place.stem), {}
    cut = frame if rows is None else frame[:rows]
    if out is not None:
        write(cut, Path(out))
        click.echo(f"{out}: {len(cut)} rows")
    elif as_json:
        found = [plain(each) for each in cut.to_dict("records")]
        click.echo(json.dumps({"units": dict(units), "rows": found}, indent=1))
    elif as_csv:
        click.echo(cut.to_csv(index=False, float_format="%.12g"), nl=False)
    else:
        most = len(frame) if place.is_dir() or describe else rows or _ROWS
        print_table(frame, units, most, f"{place}: {len(frame)} rows" if place.is_file() else "")
        if place.is_dir():
            click.echo(_next(place, frame))
        elif (known := ARTEFACTS.get(place.stem)) is not None:
            click.echo(known.meaning)


def find(path: Path, name: str | None) -> Path:
    """The file or folder meant. Raises InputError with what is there instead."""
    asked = path if name is None else path / name
    for each in (asked, asked.with_name(f"{asked.name}.parquet") if asked.name else asked):
        if each.is_file():
            return each
    if asked.is_dir():
        return asked
    above = next(each for each in asked.parents if each.exists())
    if above.is_file():
        raise InputError(Problem(str(above), f"is a file, and holds no {asked.name}", "a folder"))
    there = sorted(each.stem for each in above.glob("*.parquet"))
    there += sorted(each.name for each in above.iterdir() if each.is_dir() and each.name[0] != ".")
    elsewhere = sorted(Path().glob(f"results/*/{asked.stem}.parquet"))
    fix = f"there is {elsewhere[0]}" if elsewhere else ""
    if close := nearest(asked.stem, tuple(there)):
        fix = f"did you mean {above / close}?"
    raise InputError(Problem(str(asked), "no such table or folder", first_few(there, 30), fix))


def listing(folder: Path) -> pd.DataFrame:
    """Tables of a folder with rows and meaning, or its folders with tables. InputError if none."""
    paths = {each.stem: each for each in folder.glob("*.parquet") if each.name[0] != "."}
    names = [name for name in ARTEFACTS if name in paths]
    names += sorted(paths.keys() - names)
    rows: list[tuple] = []
    for name in names:
        meaning = ARTEFACTS[name].meaning.partition(". ")[0] if name in ARTEFACTS else ""
        try:
            rows.append((name, str(store.row_count(paths[name])), meaning))
        except InputError as error:
            rows.append((name, "", error.problems[0].what))
    if rows:
        return pd.DataFrame(rows, columns=["table", "rows", "meaning"])
    within = [each for each in sorted(folder.iterdir()) if each.is_dir()]
    rows = [(each.name, len(list(each.glob("*.parquet")))) for each in within]
    rows = [row for row in rows if row[1]]
    if rows:
        return pd.DataFrame(rows, columns=["folder", "tables"])
    if (folder / PLAN).is_file():
        fix = f"kinacc campaign report {shlex.quote(str(folder))} writes them"
        raise InputError(Problem(str(folder), "is a campaign without tables so far", fix=fix))
    allowed = "the folder of a data set, or of all results"
    raise InputError(Problem(str(folder), "holds no table", allowed))


def read(path: Path) -> tuple[pd.DataFrame, dict[str, str]]:
    """A Parquet file and the units of its columns. InputError where it is none, or damaged."""
    table = store.read_arrow(path, any_type=True)
    units = {each.name: (each.metadata or {}).get(b"unit", b"").decode() for each in table.schema}
    try:
        table.validate(full=True)
        return table.to_pandas(), units
    except (ValueError, pa.ArrowException) as error:
        what = f"cannot be shown: {error}"
        raise InputError(Problem(str(path), what, fix=store.remake(path))) from None


def choose(
    frame: pd.DataFrame, columns: str | None, conditions: Sequence[str] = ()
) -> pd.DataFrame:
    """Rows that meet the conditions, and the columns named. InputError for unknown columns."""
    problems = []
    for condition in conditions:
        name, mark, value = condition.partition("=")
        if not mark or name not in frame:
            problems.append(_unknown("--where", name, frame))
            continue
        values = frame[name]
        if value in ("", _NONE):
            frame = frame[values.isna()]
        elif pd.api.types.is_numeric_dtype(values):
            wanted = pd.to_numeric(pd.Series([value]), errors="coerce")[0]
            frame = frame[(values - wanted).abs() <= 1e-9 * abs(wanted)]
        else:
            frame = frame[values.astype(str) == value]
    wanted_names: list[str] = []
    for pattern in columns.split(",") if columns else frame.columns:
        own = [each for each in frame.columns if fnmatchcase(each, pattern.strip())]
        if not own:
            problems.append(_unknown("--columns", pattern.strip(), frame))
        wanted_names += own
    refuse(problems)
    if not len(frame):
        raise InputError(Problem("--where", "no row meets " + " and ".join(conditions)))
    return frame[list(dict.fromkeys(wanted_names))]


def described(frame: pd.DataFrame, units: Mapping[str, str], artefact: str) -> pd.DataFrame:
    """Unit, meaning and contents of every column."""
    known = {}
    if artefact in ARTEFACTS:
        contract = ARTEFACTS[artefact]
        known = {each.name: each.meaning for each in contract.columns}
    rows = []
    for name, values in frame.items():
        stem = str(name).rstrip("0123456789") + "*"
        there = values.dropna()
        if pd.api.types.is_numeric_dtype(values) and len(there):
            holds = f"{there.min():.6g} to {there.max():.6g}"
        else:
            kinds = list(dict.fromkeys(map(str, there)))
            holds = first_few(kinds, 4) if len(kinds) <= 4 else f"{len(kinds)} different texts"
        absent = f", {len(values) - len(there)} without" if len(there) < len(values) else ""
        meaning = known.get(str(name), known.get(stem, ""))
        rows.append((name, units.get(str(name), ""), meaning, holds + absent))
    return pd.DataFrame(rows, columns=["column", "unit", "meaning", "holds"])


def print_table(frame: pd.DataFrame, units: Mapping[str, str], most: int, title: str = "") -> None:
    """Print at most so many rows, both ends; constant columns once, above the table."""
    console = screen()
    if title:
        console.print(as_seen(title), soft_wrap=True)
    heads = {name: _heading(str(name), units.get(str(name), "")) for name in frame}
    cells = {name: _cells(values) for name, values in frame.items()}
    alike = [name for name in cells if len(frame) > 1 and len(set(cells[name])) == 1]
    if alike and len(alike) < len(cells):
        constant = ", ".join(f"{heads[name]} {cells[name][0]}" for name in alike)
        console.print(as_seen(f"in every row: {constant}"))
        cells = {name: each for name, each in cells.items() if name not in alike}
    head = len(frame) if len(frame) <= most else most - most // 3
    tail = len(frame) if head == len(frame) else len(frame) - most // 3
    rows = [*range(head), *range(tail, len(frame))]
    table = Table(box=None, pad_edge=False)
    left, hidden = console.width, []
    for name, texts in cells.items():
        width = max(len(heads[name]), *(len(texts[row]) for row in rows))
        wraps = width > _SENTENCE  # sentences take the room that is left
        left -= (_SENTENCE if wraps else width) + 2
        if left < 0 and table.columns:
            hidden.append(str(name))
            continue
        numeric = pd.api.types.is_numeric_dtype(frame[name])
        table.add_column(heads[name], justify="right" if numeric else "left", no_wrap=not wraps)
    kept = [each for name, each in cells.items() if str(name) not in hidden]
    for row in rows:
        if row == tail:
            table.add_row(f".. {tail - head} more")
        table.add_row(*(each[row] for each in kept))
    console.print(table)
    if hidden:
        console.print(as_seen(f"not shown: {', '.join(hidden)} (--columns {hidden[0]},..)"))


def _heading(name: str, unit: str) -> str:
    told = unit in ("", "1") or unit.startswith("see ") or name.endswith(f"_{unit}")
    return as_seen(name if told else f"{name} [{unit}]")


def _cells(values: pd.Series) -> list[str]:
    """Values as text: numbers with six significant digits, - for none."""
    if pd.api.types.is_float_dtype(values):
        return [_NONE if each != each else f"{each:.6g}" for each in values]
    return [_NONE if each is None or each != each else as_seen(str(each)) for each in values]


def _unknown(place: str, name: str, frame: pd.DataFrame) -> Problem:
    names = tuple(map(str, frame.columns))
    close = nearest(name, names)
    fix = f"did you mean {close}?" if close else ""
    return Problem(place, f"there is no column {name!r}", ", ".join(names), fix)


def _next(folder: Path, frame: pd.DataFrame) -> str:
    first = folder / str(frame.iloc[0, 0])
    return f"{_typed(first)} shows one; --describe explains its columns"


def _typed(place: Path) -> str:
    return shlex.join(["kinacc", "show", str(place)])

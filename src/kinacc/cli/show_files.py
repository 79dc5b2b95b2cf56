"""Which file or folder ``kinacc show`` is asked for, and what a folder holds."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

from kinacc.campaign.journal import PLAN
from kinacc.cli.sheet import Field, Sheet
from kinacc.config.values import nearest
from kinacc.errors import InputError, Problem, first_few
from kinacc.tables import store, sums
from kinacc.tables.columns import texts
from kinacc.tables.contract import ARTEFACTS

_CALIBRATED = {
    *("measurements", "robot", "vec_model", "dh_model", "frames", "residuals", "pose_errors"),
    *("model_selection", "summary"),
}


@dataclass(frozen=True)
class Listing:
    """What is in a folder, and what is said below it."""

    sheet: Sheet
    below: tuple[str, ...] = ()


def found(path: str, table: str | None) -> Path:
    """The file or folder meant. InputError with what is there, where that is not."""
    asked = Path(path) if table is None else Path(path) / table
    named = asked.with_name(f"{asked.name}.parquet") if asked.name else asked
    for each in (asked, named):
        if each.is_file():
            return each
    if asked.is_dir():
        return asked
    raise InputError(_absent(asked))


def _absent(asked: Path) -> Problem:
    """What to say of a name that is nothing."""
    above = asked.parent
    if above.is_file():
        return Problem(str(above), f"is a file, and holds no {asked.name}", "a folder")
    if not above.is_dir():
        return _absent(above)
    name = asked.stem if asked.suffix == ".parquet" else asked.name
    tables = _tables(above)
    others = [each.name for each in above.iterdir() if each.is_dir() and each.name[0] != "."]
    close = nearest(name, (*tables, *others))
    fix = f"did you mean {above / close}?" if close else ""
    elsewhere = sorted(
        str(each) for each in Path().glob("results/*") if (each / f"{name}.parquet").is_file()
    )
    if name in ARTEFACTS and _of_dataset(above):
        fix = f"{_command(name)} makes it" if _command(name) else ""
    elif name in ARTEFACTS and elsewhere:
        fix = f"there is one in {first_few(elsewhere)}: {_typed('show', elsewhere[0], name)}"
    what = "no such table" if tables else "no such file or folder"
    return Problem(str(asked), what, first_few([*tables, *sorted(others)], 30), fix)


def listing(folder: Path) -> Listing:
    """The tables of a data set, a campaign or any folder, or the data sets of a results folder.

    Raises InputError for a folder without any.
    """
    tables = _tables(folder)
    if tables:
        return _of_tables(folder, tables)
    within = sorted(each for each in folder.iterdir() if each.is_dir() and _tables(each))
    if within:
        return _of_folders(folder, within)
    if (folder / PLAN).is_file():
        report, status = (_typed("campaign", each, folder) for each in ("report", "status"))
        fix = f"`{report}` writes them, `{status}` says where it stands"
        raise InputError(Problem(str(folder), "a campaign without tables so far", fix=fix))
    raise InputError(
        Problem(str(folder), "holds no table", "the folder of a data set, or of all results")
    )


def _tables(folder: Path) -> list[str]:
    """Names of the tables in a folder: those of the contract in its order, then the others."""
    names = {each.stem for each in folder.glob("*.parquet") if not each.name.startswith(".")}
    own = [name for name in ARTEFACTS if name in names]
    return [*own, *sorted(names - set(own), key=_by_numbers)]


def _by_numbers(name: str) -> tuple[int, str]:
    numbers = re.match(r"\d+", name)
    return (int(numbers[0]) if numbers else 0, name)


def _of_tables(folder: Path, names: list[str]) -> Listing:
    part_of = ARTEFACTS.get(folder.name)
    rows: list[tuple[str, int | None, str | None]] = []
    for name in names:
        artefact = ARTEFACTS.get(name, part_of)
        what = None if artefact is None else _short(artefact.meaning)
        try:
            count = _rows(folder / f"{name}.parquet")
        except InputError as error:
            count, what = None, error.problems[0].what
        rows.append((name, count, what))
    sheet = Sheet(
        f"{folder}: {len(names)} table{'s' if len(names) != 1 else ''}",
        {"folder": str(folder)},
        [
            Field("table", texts(row[0] for row in rows), "", "name of the table"),
            Field("rows", texts(row[1] for row in rows), "", "number of its rows"),
            Field("what it is", texts(row[2] for row in rows), "", "what it holds"),
        ],
    )
    below = [f"{_typed('show', folder, names[0])} shows one; --describe says what its columns mean"]
    if _of_dataset(folder) and (missing := _missing(folder, names)):
        below.insert(0, f"missing: {', '.join(missing)} ({_command(missing[0])})")
    pictures = sorted({each.stem for each in (folder / "figures").glob("*.*")})
    if pictures:
        below.insert(0, f"figures/: {', '.join(pictures)}")
    return Listing(sheet, tuple(below))


def _missing(folder: Path, names: list[str]) -> list[str]:
    """Tables that every calibration leaves, or that a stage left here, and that are gone."""
    left = {Path(name).stem for name in sums.stated(folder) if name.endswith(".parquet")}
    return [name for name in ARTEFACTS if name in left | _CALIBRATED and name not in names]


def _of_folders(folder: Path, within: list[Path]) -> Listing:
    rows = []
    for each in within:
        rows.append(
            (
                each.name,
                _robot(each),
                _count(each / "measurements.parquet"),
                len(_tables(each)),
            )
        )
    columns = [texts(row[i] for row in rows) for i in range(4)]
    sheet = Sheet(
        f"{folder}: {len(within)} folder{'s' if len(within) != 1 else ''} with tables",
        {"folder": str(folder)},
        [
            Field("folder", columns[0], "", "name of the data set, or of another folder"),
            Field("robot", columns[1], "", "its arm"),
            Field("readings", columns[2], "", "rows of its measurements"),
            Field("tables", columns[3], "", "number of tables"),
        ],
    )
    below = [f"{_typed('show', within[0])} lists the tables of one"]
    if (folder / PLAN).is_file():
        below.append(f"a campaign: {_typed('campaign', 'status', folder)} says where it stands")
    return Listing(sheet, tuple(below))


def _typed(*words: object) -> str:
    """A command of kinacc as it is typed."""
    return shlex.join(["kinacc", *map(str, words)])


def _of_dataset(folder: Path) -> bool:
    return (folder / "measurements.parquet").is_file()


def _robot(folder: Path) -> str | None:
    try:
        return str(store.read(folder / "robot.parquet")["name"][0])
    except (InputError, KeyError, IndexError):
        return None


def _count(path: Path) -> int | None:
    try:
        return _rows(path)
    except InputError:
        return None


def _rows(path: Path) -> int:
    """Number of rows of a table; InputError if it is none."""
    import pyarrow.parquet as pq

    store.read_schema(path)  # says what is wrong with a file that is no table
    return int(pq.read_metadata(path).num_rows)


def _short(meaning: str) -> str:
    """The first sentence, up to a colon or semicolon that comes after some words."""
    sentence = re.split(r"(?<!Fig)(?<!Figs)\. |\.$", meaning)[0]
    head = re.split(r"[:;] ", sentence)[0]
    return head if " " in head else sentence


def _command(name: str) -> str:
    """The command that makes a table of the workflow."""
    studied = name in ARTEFACTS and ARTEFACTS[name].topic == "assessment"
    return "kinacc study" if studied else "kinacc calibrate"

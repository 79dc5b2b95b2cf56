"""A measurement file as a table of named columns, whatever it is written in."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.measurements import robot_programs
from kinacc.measurements.grid import decoder, rows_of_text, tabled
from kinacc.measurements.table import RawTable
from kinacc.measurements.written import FEATURES, SPHERICAL, Written

GROUPS, POINT = ("Collection", "Group"), "Point"  # columns of a list of points without names
PARQUET = (".parquet", ".pq")
EXCEL = (".xlsx", ".xlsm")
_OTHERS = {
    ".xls": "a workbook of the old Excel format",
    ".xlsb": "a binary workbook",
    ".ods": "an OpenDocument sheet",
    ".pdf": "a PDF file",
    ".docx": "a text document",
}
_LOOKED_AT = 100_000  # characters
_KINDS = "a CSV, text, Excel (.xlsx) or Parquet file"


def load(path: str | Path, written: Written | None = None, source: str | None = None) -> RawTable:
    """Read a file that is ``written`` so. Raises InputError where it is missing, empty or ragged.

    ``source``: where the data comes from, said when the file is missing.
    """
    path, written = Path(path), written or Written()
    refuse_other_files(path, source)
    kind = path.suffix.lower()
    if kind in PARQUET:
        from kinacc.measurements import parquet_file

        table = parquet_file.load(path)
    elif kind in EXCEL:
        from kinacc.measurements import workbook

        table = workbook.load(path, written)
    elif (program := robot_programs.read(path)) is not None:
        return program
    else:
        table = tabled(str(path), rows_of_text(path, written), written)
        if written.encoding == "utf-8" and any("\ufffd" in name for name in table.columns):
            told = "names of columns hold characters that are not UTF-8: set "
            told += "measurements.file.encoding, such as latin-1 or cp932"
            table = replace(table, notes=(*table.notes, told))
    table = robot_programs.expanded(table)
    if written.names is not None and {*written.names[:-3]} <= {*GROUPS, POINT}:
        table = in_natural_order(table)
    if written.layout == FEATURES:
        from kinacc.measurements.features import by_feature

        return by_feature(table)
    if written.layout == SPHERICAL:
        from kinacc.measurements.spherical import cartesian

        return cartesian(table, written.directions)
    return table


def in_natural_order(table: RawTable) -> RawTable:
    """A list of points with P2 before P10, within groups as they come; each keeps its line."""
    if POINT not in table.columns:
        return table
    names = [str(cell).strip() for cell in table.columns[POINT]]
    others = [table.columns[name] for name in GROUPS if name in table.columns]
    groups = list(zip(*others, strict=True)) or [()] * len(table)
    place = {group: number for number, group in enumerate(dict.fromkeys(groups))}
    order = sorted(range(len(table)), key=lambda row: (place[groups[row]], _natural(names[row])))
    if order == list(range(len(table))):
        return table
    told = f"points in their natural order, {names[order[0]]} first, and not in that of the file"
    return replace(table.select(np.array(order)), notes=(*table.notes, told))


def _natural(name: str) -> list[tuple[int, int | str]]:
    """A key that puts P2 before P10."""
    parts = re.findall(r"\d{1,18}|\D+|\d", name)
    return [(0, int(part)) if part.isdecimal() else (1, part) for part in parts]


def quotes_numbers(path: Path, written: Written) -> bool:
    """Whether numbers with the delimiter within them are one cell: in quotes, or in a workbook."""
    if path.suffix.lower() in (*EXCEL, *PARQUET):
        return True
    codec, otherwise = decoder(written.encoding)
    with open(path, encoding=codec, errors=otherwise) as stream:
        text = stream.read(_LOOKED_AT)
    number = rf'"\s*[+\-−]?\d[\d.,\'\s]*{re.escape(written.delimiter)}\d[\d.,]*\s*"'
    return bool(re.search(number, text))


def refuse_other_files(path: Path, source: str | None = None) -> None:
    """Raise InputError where there is no file, or one that is none of those that are read."""
    if not path.is_file():
        origin = f"the data comes from: {source}" if source else "check measurements.file.path"
        raise InputError(Problem(str(path), "no such file", _KINDS, origin))
    kind = _OTHERS.get(path.suffix.lower())
    if kind:
        fix = "save it as .xlsx or as CSV" if "." in kind or "sheet" in kind else "export it as CSV"
        fix = "save it as .xlsx or as CSV" if path.suffix.lower() in (".xls", ".xlsb") else fix
        raise InputError(Problem(str(path), f"is {kind}, which is not read", _KINDS, fix))

"""Rows a command hands out: as text or Excel for people, CSV, JSON or Parquet for machines."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kinacc.cli.output import plain
from kinacc.config.names import csv_text, in_csv
from kinacc.errors import as_seen
from kinacc.tables.atomic import write_whole

_SHOWN_ROWS = 24
_PLAIN_UNITS = ("mm", "mrad", "rad", "deg", "kg")
_NOTHING = 5e-5  # less is no digit of the four shown after the point


@dataclass(frozen=True)
class Field:
    """One column: values (n,), NaN or None for none; its unit and what it means.

    ``on_screen``: shown to a person too, not only in files.
    """

    name: str
    values: np.ndarray
    unit: str = ""
    meaning: str = ""
    on_screen: bool = True

    @property
    def heading(self) -> str:
        """The name, with the unit where it does not say it: q1 [rad]."""
        told = self.unit not in _PLAIN_UNITS or self.name.endswith(f"_{self.unit}")
        return self.name if told else f"{self.name} [{self.unit}]"


@dataclass(frozen=True)
class Sheet:
    """Named columns of equal length and a few facts about all of them.

    ``with_units``: CSV has headings instead of names, so that no unit has to be known.
    """

    title: str
    facts: Mapping[str, object]
    fields: Sequence[Field]
    shown_rows: int = _SHOWN_ROWS
    with_units: bool = False

    def __len__(self) -> int:
        return len(self.fields[0].values) if self.fields else 0

    def first(self, rows: int | None) -> Sheet:
        """The first ``rows`` of it; None for all."""
        if rows is None or rows >= len(self):
            return self
        return replace(self, fields=[replace(f, values=f.values[:rows]) for f in self.fields])

    def as_json(self) -> str:
        """The facts, units and rows as one JSON object."""
        columns = [(field.name, [plain(value) for value in field.values]) for field in self.fields]
        rows = [{name: values[i] for name, values in columns} for i in range(len(self))]
        units = {field.name: field.unit for field in self.fields if field.unit}
        return json.dumps({**plain(self.facts), "units": units, "rows": rows}, indent=1)

    def as_csv(self) -> str:
        """Column names, then one line per row; empty cells for none."""
        names = [field.heading if self.with_units else field.name for field in self.fields]
        rows = ([_cell(field.values[i]) for field in self.fields] for i in range(len(self)))
        return csv_text([map(in_csv, names), *rows])

    def as_text(self) -> str:
        """Aligned columns of the first rows for a screen."""
        count = min(len(self), self.shown_rows)
        columns = [
            [as_seen(field.name), *(_short(field.values[i]) for i in range(count))]
            for field in self.fields
            if field.on_screen
        ]
        widths = [max(map(len, column)) for column in columns]
        lines = [as_seen(self.title)] if self.title else []
        for i in range(count + 1):
            cells = (column[i].rjust(width) for column, width in zip(columns, widths, strict=True))
            lines.append("  ".join(cells).rstrip())
        if count < len(self):
            lines.append(f".. {len(self) - count} rows more; give --out to have them all")
        return "\n".join(lines)

    def write(self, path: Path | str) -> None:
        """Write a .csv, .xlsx, .json or .parquet file, whole or not at all."""
        write_whole(path, self.content(Path(path).suffix))

    def content(self, ending: str) -> bytes:
        """Bytes of a file with this ending: .csv, .xlsx, .json or .parquet."""
        if ending == ".parquet":
            return self._parquet()
        if ending == ".xlsx":
            return self._excel()
        text = self.as_csv() if ending == ".csv" else self.as_json() + "\n"
        return text.encode()

    def _excel(self) -> bytes:
        """Names, units and rows on one sheet."""
        from openpyxl import Workbook
        from openpyxl.styles import Font

        book = Workbook()
        page = book.active
        page.append([_in_excel(field.name) for field in self.fields])
        page.append([_in_excel(field.unit) for field in self.fields])
        columns = [[_in_excel(value) for value in field.values] for field in self.fields]
        for row in zip(*columns, strict=True):
            page.append(row)
        for cell in page[1]:
            cell.font = Font(bold=True)
        page.freeze_panes = "A3"
        written = io.BytesIO()
        book.save(written)
        return written.getvalue()

    def _parquet(self) -> bytes:
        import pyarrow as pa
        import pyarrow.parquet as pq

        arrays, described = [], []
        for field in self.fields:
            array = pa.array([plain(value) for value in field.values])
            arrays.append(array)
            about = {"unit": field.unit, "meaning": field.meaning}
            described.append(pa.field(field.name, array.type, metadata=about))
        facts = {key: json.dumps(value) for key, value in plain(self.facts).items()}
        sink = pa.BufferOutputStream()
        table = pa.Table.from_arrays(arrays, schema=pa.schema(described, metadata=facts))
        pq.write_table(table, sink, compression="zstd", version="2.6")
        return sink.getvalue().to_pybytes()


def _cell(value: object) -> str:
    value = plain(value)
    if value is None:
        return ""
    # Twelve digits: a nanometre in ten metres, and a text that ends where the digits end.
    return f"{value:.12g}" if isinstance(value, float) else in_csv(str(value))


def _in_excel(value: object) -> object:
    """A value as a cell takes it: a text is a text, and never a formula."""
    value = plain(value)
    return in_csv(as_seen(value)) if isinstance(value, str) else value


def _short(value: object) -> str:
    value = plain(value)
    if value is None:
        return "-"
    if isinstance(value, float):
        if abs(value) < _NOTHING:
            return f"{0.0:.4f}"
        return f"{value:.4f}" if abs(value) >= 0.01 else f"{value:.3g}"
    return as_seen(str(value))

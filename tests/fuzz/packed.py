"""Changes of Parquet files and workbooks: columns, types, cells, sheets, and the bytes within."""

from __future__ import annotations

import io
import re
from typing import Any

from fuzz.texts import HEADERS, Random, UnfitError, grid, odd, plain_bytes, text


def parquet(data: bytes, rng: Random) -> bytes:
    """Columns of other types, names, values, nulls, lengths and metadata."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        held = pq.read_table(io.BytesIO(data))
    except (pa.ArrowException, OSError, ValueError) as error:
        raise UnfitError from error
    if not held.num_columns:
        raise UnfitError
    at, kind = rng.randrange(held.num_columns), rng.randrange(13)
    name, values = held.column_names[at], held.column(at)
    if kind <= 3:
        held = held.set_column(at, held.schema.field(at).with_type(new.type), new) if (
            new := _other_type(values, rng)) is not None else held  # fmt: skip
    elif kind <= 5:
        held = held.set_column(at, held.schema.field(at), _other_values(values, rng))
    elif kind == 6:
        held = held.drop_columns([name]) if held.num_columns > 1 else held
    elif kind == 7:
        names = list(held.column_names)
        names[at] = rng.choice((rng.choice(HEADERS), rng.choice(names), odd(rng)))
        held = held.rename_columns([each.replace("\ud7ff", "") for each in names])
    elif kind == 8:
        rows = (
            [
                rng.randrange(len(held))
                for _ in range(rng.choice((0, 1, 2, len(held), 3 * len(held))))
            ]
            if len(held)
            else []
        )
        held = held.take(pa.array(rows, pa.int64()))
    elif kind == 9:
        held = held.append_column(rng.choice((*HEADERS, name)), values)
    elif kind == 10:
        kept = dict(held.schema.metadata or {})
        keys = [*kept, b"x", b"pandas"]
        kept[rng.choice(keys)] = rng.choice((b"\xff\xfe", odd(rng).encode("utf-8", "replace")))
        held = held.replace_schema_metadata(kept)
    elif kind == 11:
        field = held.schema.field(at)
        units = {b"unit": rng.choice((b"mm", b"rad", b"deg", b"", b"\xff", b"m"))}
        held = held.cast(
            held.schema.set(at, field.with_metadata({**(field.metadata or {}), **units}))
        )
    else:
        order = rng.sample(range(held.num_columns), held.num_columns)
        held = held.select(order) if len(set(held.column_names)) == len(order) else held
    written = io.BytesIO()
    try:
        pq.write_table(held, written, compression=rng.choice(("snappy", "none", "zstd")))
    except (pa.ArrowException, NotImplementedError, ValueError) as error:
        raise UnfitError from error
    return written.getvalue()


def _other_type(values: Any, rng: Random) -> Any:
    """The same values in another type, or as many values of a type that no number fits."""
    import pyarrow as pa

    count = len(values)
    kinds = (
        *(pa.float32(), pa.float16(), pa.int8(), pa.int64(), pa.uint64(), pa.string(), pa.binary()),
        *(pa.bool_(), pa.date32(), pa.timestamp("ns"), pa.time64("us"), pa.large_string()),
        *(pa.decimal128(38, 10), pa.decimal256(76, 3), pa.dictionary(pa.int32(), pa.string())),
    )
    if rng.random() < 0.6:
        try:
            return values.combine_chunks().cast(rng.choice(kinds), safe=False)
        except (pa.ArrowException, NotImplementedError, ValueError):
            return None
    made = (
        lambda: pa.nulls(count, rng.choice((pa.null(), pa.float64(), pa.string(), pa.int32()))),
        lambda: pa.array([[1.0, 2.0]] * count),
        lambda: pa.array([{"a": 1}] * count),
        lambda: pa.array([2**63] * count, pa.uint64()),
        lambda: pa.array([2**31 - 1] * count, pa.int32()).cast(pa.date32()),
        lambda: pa.array([-(2**62)] * count, pa.int64()).cast(
            pa.timestamp(rng.choice(("s", "ms", "us")))
        ),
        lambda: pa.array([2**62] * count, pa.int64()).cast(
            pa.duration(rng.choice(("s", "ms", "ns")))
        ),
        lambda: pa.array([b"\xff\xfe"] * count, pa.binary()),
        lambda: pa.array([odd(rng) for _ in range(count)]),
        lambda: pa.array([odd(rng) for _ in range(count)]).dictionary_encode(),
        lambda: pa.DictionaryArray.from_arrays(pa.array([0] * count, pa.int32()), pa.array([1.5])),
        lambda: pa.array([float("nan")] * count),
        lambda: pa.array([True] * count),
        lambda: pa.MapArray.from_arrays(list(range(count + 1)), ["a"] * count, [1] * count),
        lambda: pa.Array.from_buffers(
            pa.string(), 1, [None, pa.py_buffer(b"\0\0\0\0\2\0\0\0"), pa.py_buffer(b"\xff\xfe")]
        ).take(pa.array([0] * count, pa.int32())),
    )
    return rng.choice(made)()


def _other_values(values: Any, rng: Random) -> Any:
    """Some values of a column changed within its type."""
    import pyarrow as pa

    held = values.to_pylist()
    if not held:
        return values
    many = rng.random() < 0.3
    for at in range(len(held)) if many else [rng.randrange(len(held))]:
        if isinstance(held[at], bool) or held[at] is None:
            held[at] = None
        elif isinstance(held[at], int):
            held[at] = rng.choice((0, -1, 1, 127, -128, None, held[at] + 1, 2**31 - 1, -(2**31)))
        elif isinstance(held[at], float):
            held[at] = rng.choice(
                (0.0, float("nan"), float("inf"), 1e308, None, -held[at], held[at] * 1e3, 1e-300)
            )
        else:
            held[at] = rng.choice((None, odd(rng), held[0]))
    try:
        return pa.array(held, values.type)
    except (pa.ArrowException, TypeError, ValueError, OverflowError) as error:
        raise UnfitError from error


def workbook(data: bytes, rng: Random) -> bytes:
    """Cells of other types, columns, rows and sheets of a workbook; or the XML within."""
    import datetime
    import warnings
    import zipfile

    if rng.random() < 0.25:
        return _within_archive(data, rng)
    if _FAR_ROW.search(_sheets(data)):
        raise UnfitError  # what to read would take for ever
    import openpyxl
    from openpyxl.utils.exceptions import IllegalCharacterError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            book = openpyxl.load_workbook(io.BytesIO(data))
    except Exception as error:
        raise UnfitError from error
    if not book.worksheets or any(each.max_row > 10_000 for each in book.worksheets):
        raise UnfitError
    sheet = rng.choice(book.worksheets)
    rows = [list(row) for row in sheet.iter_rows(values_only=True)]
    kind = rng.randrange(10)

    def cell(rng: Random) -> Any:
        return rng.choice(
            (
                *(
                    odd(rng),
                    odd(rng),
                    odd(rng),
                    None,
                    True,
                    1e308,
                    -5,
                    10**400,
                    0.1,
                    "=A1*2",
                    "#N/A",
                ),
                *(
                    datetime.datetime(2021, 3, 4, 5, 6),
                    datetime.date(1900, 1, 1),
                    datetime.time(5, 6),
                ),
                datetime.timedelta(hours=30),
            )
        )

    if kind == 0:
        sheet.sheet_state = rng.choice(("hidden", "visible", "veryHidden"))
    elif kind == 1:
        sheet.title = rng.choice(("Points", "Joints", "x", "1", sheet.title))
    elif kind == 2 and len(book.worksheets) > 1:
        book.remove(sheet)
    elif kind == 3:
        book.copy_worksheet(sheet)
    elif kind == 4 and sheet.max_row > 2:
        at = rng.randrange(1, sheet.max_row)
        sheet.merge_cells(
            start_row=at,
            start_column=1,
            end_row=at + rng.choice((0, 2)),
            end_column=rng.choice((2, 9)),
        )
    elif rows and any(rows):
        grid(rows, rng, max(map(len, rows)), cell)
        for row in list(sheet.merged_cells.ranges):
            sheet.unmerge_cells(str(row))
        sheet.delete_rows(1, sheet.max_row)
        for row in rows:
            try:
                sheet.append(row)
            except (IllegalCharacterError, ValueError, TypeError):
                sheet.append([None])
    written = io.BytesIO()
    try:
        book.save(written)
    except (ValueError, TypeError, IndexError, AttributeError, zipfile.BadZipFile) as error:
        raise UnfitError from error
    return written.getvalue()


_FAR_ROW = re.compile(rb' r="[A-Z]*\d{6,}|r="[A-Z]{3,}')


def _sheets(data: bytes) -> bytes:
    """The text of all sheets of a workbook."""
    import zipfile

    try:
        with zipfile.ZipFile(io.BytesIO(data)) as held:
            return b"".join(held.read(name) for name in held.namelist() if "sheet" in name)
    except Exception as error:  # damaged
        raise UnfitError from error


def _within_archive(data: bytes, rng: Random) -> bytes:
    import zipfile

    try:
        with zipfile.ZipFile(io.BytesIO(data)) as held:
            parts = {name: held.read(name) for name in held.namelist()}
    except (
        zipfile.BadZipFile,
        ValueError,
        EOFError,
        OSError,
        RuntimeError,
        NotImplementedError,
    ) as error:
        raise UnfitError from error
    if not parts:
        raise UnfitError
    name = rng.choice(
        [each for each in parts if "sheet" in each or "shared" in each] or list(parts)
    )
    if rng.random() < 0.2:
        name = rng.choice(list(parts))
    kind = rng.randrange(4)
    if kind == 0:
        del parts[name]
    elif kind == 1:
        parts[name] = plain_bytes(parts[name], rng)
    elif kind == 2:
        whole = parts[name].decode("utf-8", "replace")
        found = list(re.finditer(r'="([^"]*)"|<v>([^<]*)</v>', whole))
        if found:
            one = rng.choice(found)
            said = odd(rng).replace("<", "").replace('"', "").replace("&", "")
            new = f'="{said}"' if one.group(1) is not None else f"<v>{said}</v>"
            whole = whole[: one.start()] + new + whole[one.end() :]
        parts[name] = whole.encode("utf-8", "replace")
    else:
        parts[name] = text(parts[name], rng)
    written = io.BytesIO()
    with zipfile.ZipFile(
        written, "w", rng.choice((zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED))
    ) as held:
        for each, content in parts.items():
            held.writestr(each, content)
    return written.getvalue()

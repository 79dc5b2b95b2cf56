"""Changes by structure: cells, columns, names, units, encodings, trees of YAML, XML and JSON.

Each function takes the content of a file and a random generator and returns other content. Most
inputs get one or two changes, so that what reads them goes beyond the first refusal.
"""

from __future__ import annotations

import copy
import io
import json
import random
import re
from collections.abc import Callable, Sequence
from pathlib import PurePath
from typing import Any

Random = random.Random

NUMBERS = (
    *("0", "-0", "1", "-1", "0.5", "1e-320", "1e308", "-1e308", "1e400", "9" * 25, "9" * 400),
    *("1" * 5000, "1e999999999", "0x10", "1_000", "\uff11\uff12", "\u22125", "1,5", "1.234,5"),
    *("1,234.5", "1'000", "1 000,5", "1\u00a0000", "+5", "5.", ".5", "5e", "1e5", "1E+05", "--5"),
    *("2147483648", "9223372036854775808", "253402300800", "-62135596801", "1e18", "6.283185307"),
    *("12 mm", "12mm", "3\u00b0", '3"', "1/2", "12:30", "1;2", "[1,2,3]", "{X 1,Y 2}", "1e-9"),
)
WORDS = (
    *("", " ", "nan", "NaN", "inf", "-inf", "null", "NULL", "None", "NA", "#REF!", "TRUE", "false"),
    *("yes", "no", "?", "-", "--", "---.---", "*", "=1+1", "=1/0", "@x", "+x", "'", '"', '""'),
    *("a,b", "a;b", "a\tb", "\x00", "\ufeff", "\u2028", "\x85", "\x0b", "\x1c", "\ud7ff", "\ufffe"),
    *("2021-03-04", "12.3.21", "3/4/2021 5:06", "9999-99-99", "1970-01-01T00:00:00Z", "25:61:99"),
    *("2021-03-04T05:06:07.123456789+14:00", "12:00", "%s", "{}", "{0}", "\\", "x" * 300, "<x>&"),
    *("~", "!!python/object:os.system", "&a", "*a", "0o17", "on", "../x", "/etc/passwd", "ur10"),
    *("mm", "deg", "x_mm", "q1_deg", "\u6a2a", "\u0130", "\u00df", "e\u0301", "P12_1", "lost"),
)
HEADERS = (
    *(
        "q1_deg",
        "q2_deg",
        "q7_deg",
        "q1_rad",
        "q1",
        "J1",
        "A1 [deg]",
        "joint_1",
        "q1_cmd",
        "S",
        "L",
    ),
    *(
        "x_mm",
        "x_m",
        "X",
        "Y",
        "Z",
        "x (in)",
        "x [mm]",
        "y_mm",
        "z_mm",
        "mA_x_mm",
        "nominal_x",
        "dx",
    ),
    *("rx_deg", "Rx", "rx_rad", "e1", "qw", "qx", "quat1", "quat_w", "a", "b", "c", "Hz", "V", "d"),
    *("std_x_mm", "Ux", "Ux (k=2)", "sigma_x", "cov_xx_mm2", "s1", "pose", "repeat", "session"),
    *("target", "temperature_c", "Temp", "time", "Time [s]", "Timestamp", "Point", "Group", "name"),
    *(
        "payload_kg",
        "Collection",
        "counts_1",
        "q1_pulse",
        "azimuth",
        "elevation",
        "range",
        "status",
    ),
    *(
        "Feature",
        "Control",
        "Axis",
        "Measured",
        "Nominal",
        "Dev",
        "TCP_x",
        "actual_q_0",
        "target_q_0",
        *("J\u00b2", "x\u00b2", "J\u0661", "q\u00b9_deg", "\u2460"),
    ),
)
ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "latin-1", "cp932", "utf-32", "cp1252")
MARKS = (",", ";", "\t", " ", "|")
_NUMBER = re.compile(r"[-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?")
OTHERS: list[bytes] = []  # texts that pieces of other files are taken from


def content(name: str, data: bytes, rng: Random) -> bytes:
    """A file's content, changed as its ending says."""
    change = _BY_ENDING.get(PurePath(name).suffix.lower(), table)
    if rng.random() < 0.06:
        change = plain_bytes
    for _ in range(_few(rng)):
        try:
            data = change(data, rng)
        except Exception:  # no longer of its kind, or beyond what a library writes
            data = (text if rng.random() < 0.7 else plain_bytes)(data, rng)
    return data


class _Unfit(Exception):
    """The content is no longer of the kind that a change is for."""


def _few(rng: Random) -> int:
    return rng.choice((1, 1, 1, 1, 2, 2, 3, 5))


def odd(rng: Random) -> str:
    """A cell nobody expects."""
    return rng.choice(NUMBERS if rng.random() < 0.5 else WORDS)


# --- bytes ----------------------------------------------------------------------------------------


def plain_bytes(data: bytes, rng: Random) -> bytes:
    """Bytes flipped, cut, doubled, filled with zeros."""
    size = len(data)
    at, to = sorted((rng.randrange(size + 1), rng.randrange(size + 1)))
    kind = rng.randrange(7)
    if kind == 0 and size:
        flipped = bytearray(data)
        for _ in range(rng.choice((1, 1, 4, 20))):
            flipped[rng.randrange(size)] ^= 1 << rng.randrange(8)
        return bytes(flipped)
    if kind == 1:
        return data[:at]
    if kind == 2:
        return data[:at] + data[to:]
    if kind == 3:
        return data[:to] + data[at:]
    if kind == 4:
        return data[:at] + b"\0" * min(to - at, 512) + data[min(to, at + 512) :]
    if kind == 5:
        return data[:at] + rng.randbytes(rng.choice((1, 3, 40))) + data[at:]
    return (
        b"" if rng.random() < 0.2 else data[:at] + odd(rng).encode("utf-8", "replace") + data[at:]
    )


# --- text -----------------------------------------------------------------------------------------


def _decoded(data: bytes) -> tuple[str, str]:
    for start, codec in (
        (b"\xff\xfe", "utf-16"),
        (b"\xfe\xff", "utf-16"),
        (b"\xef\xbb\xbf", "utf-8-sig"),
    ):
        if data.startswith(start):
            return data.decode(codec, "replace"), codec
    try:
        return data.decode(), "utf-8"
    except UnicodeDecodeError:
        return data.decode("latin-1"), "latin-1"


def _encoded(whole: str, codec: str) -> bytes:
    return whole.encode(codec, "replace")


def text(data: bytes, rng: Random) -> bytes:
    """Words, numbers and lines of any text."""
    whole, codec = _decoded(data)
    found = list(_NUMBER.finditer(whole))
    kind = rng.randrange(8)
    if kind <= 2 and found:
        one = rng.choice(found)
        whole = whole[: one.start()] + _number(one.group(), rng) + whole[one.end() :]
    elif kind == 3:
        parts = re.split(r"(\W+)", whole)
        at = rng.randrange(len(parts))
        parts[at] = rng.choice((odd(rng), "", parts[rng.randrange(len(parts))], parts[at] * 2))
        whole = "".join(parts)
    elif kind <= 6:
        whole = "\n".join(_lines(whole.split("\n"), rng))
    else:
        return _encoded(whole, rng.choice(ENCODINGS))
    return _encoded(whole, codec)


def _number(word: str, rng: Random) -> str:
    """Another number in the place of one."""
    try:
        value = float(word.replace(",", "."))
    except ValueError:
        return odd(rng)
    kind = rng.randrange(9)
    if kind == 0:
        return rng.choice(NUMBERS)
    if kind == 1:
        return repr(value * rng.choice((10, 1000, 1e-3, -1, 57.29577951308232, 25.4, 1e6, 1e12)))
    if kind == 2:
        return word.replace(".", ",") if "." in word else word.replace(",", ".")
    if kind == 3:
        return f"{value:.3e}"
    if kind == 4:
        return f'"{word}"'
    if kind == 5:
        return f"{value:,.3f}".replace(",", rng.choice((",", "'", " ", ".", "\u2019")))
    if kind == 6:
        return str(int(value) if abs(value) < 1e15 else 0)
    if kind == 7:
        return word + rng.choice((" mm", "mm", " deg", "\u00b0", "*", " m", "e5", ".1"))
    return odd(rng)


def _lines(lines: list[str], rng: Random) -> list[str]:
    """Lines dropped, doubled, moved, joined, blanked; from another file; remarks between them."""
    lines, at = list(lines), rng.randrange(len(lines))
    to = min(len(lines), at + rng.choice((1, 1, 2, 10, 100)))
    kind = rng.randrange(11)
    if kind == 0:
        del lines[at:to]
    elif kind == 1:
        lines[at:at] = lines[at:to] * rng.choice((1, 2, 30))
    elif kind == 2:
        rng.shuffle(lines)
    elif kind == 3:
        lines[at:to] = ["".join(lines[at:to])]
    elif kind == 4:
        lines[at:at] = [
            rng.choice(("", " ", "# remark", "// x", ";", ",,,,,,,", "Units: mm", "sep=;"))
        ]
    elif kind == 5:
        lines[at] = lines[at] * 2
    elif kind == 6:
        lines[at:at] = [lines[0]]
    elif kind == 7 and OTHERS:
        other = _decoded(rng.choice(OTHERS))[0].split("\n")
        begin = rng.randrange(len(other))
        lines[at:at] = other[begin : begin + rng.choice((1, 3, 20))]
    elif kind == 8:
        lines[at] = lines[at][: rng.randrange(len(lines[at]) + 1)]
    elif kind == 9:
        lines = lines[:to] if rng.random() < 0.5 else lines[at:]
    else:
        lines[at] += rng.choice((",", ";", "\t", " ", '"', "\r", "\\", "#", ",,,,", '"a'))
    return lines or [""]


# --- tables of text -------------------------------------------------------------------------------


def table(data: bytes, rng: Random) -> bytes:
    """Cells, columns, names, rows, marks and encoding of a table of text."""
    if rng.random() < 0.2:
        return text(data, rng)
    whole, codec = _decoded(data)
    lines = whole.split("\n")
    mark = max(
        MARKS, key=lambda each: (whole.count(each) if each != " " else whole.count("  "), each)
    )
    rows = [line.split(mark) for line in lines]
    widest = max(map(len, rows))
    if widest < 2:
        return text(data, rng)
    kind = rng.randrange(9)
    if kind == 0:
        other = rng.choice(MARKS)
        whole = "\n".join(other.join(row) for row in rows)
        if rng.random() < 0.5:
            whole = whole.replace(".", ",") if rng.random() < 0.7 else whole.replace(",", ".")
        return _encoded(whole, codec)
    if kind == 1:
        return _encoded(
            whole.replace("\n", rng.choice(("\r\n", "\r", "\n\n", "\n\r"))), rng.choice(ENCODINGS)
        )
    grid(rows, rng, widest)
    return _encoded("\n".join(mark.join(map(str, row)) for row in rows), codec)


def grid(rows: list[list], rng: Random, widest: int, cell: Callable[[Random], Any] = odd) -> None:
    """Change cells, names, columns or rows of a table in place."""
    full = [row for row in rows if len(row) == widest] or rows
    column, kind = rng.randrange(widest), rng.randrange(13)
    if kind <= 3:  # a cell
        row = rng.choice(full)
        if row:
            at = rng.randrange(len(row))
            row[at] = _number(row[at], rng) if isinstance(row[at], str) and kind else cell(rng)
    elif kind <= 5:  # a name
        row = full[0] if rng.random() < 0.8 else rng.choice(full)
        if row:
            at = rng.randrange(len(row))
            row[at] = rng.choice((rng.choice(HEADERS), row[rng.randrange(len(row))], cell(rng)))
            if rng.random() < 0.3:
                row[at] = (
                    f"{row[at]}{rng.choice((' [mm]', '_deg', '_rad', ' (m)', '.1', '_2', ' '))}"
                )
    elif kind == 6:  # a whole column
        value, share = cell(rng), rng.random()
        for row in full[1:]:
            if column < len(row) and rng.random() < share:
                row[column] = value
    elif kind == 7:
        for row in rows:
            del row[column : column + rng.choice((1, 1, 3))]
    elif kind == 8:
        other = rng.randrange(widest)
        for row in full:
            if max(column, other) < len(row):
                row[column], row[other] = row[other], row[column]
    elif kind == 9:
        for row in full:
            if column < len(row):
                row.insert(column, row[column])
    elif kind == 10:
        values = rng.choice((list(map(str, range(len(full)))), [cell(rng) for _ in full]))
        for row, value in zip(full, [rng.choice(HEADERS), *values], strict=False):
            row.insert(min(column, len(row)), value)
    elif kind == 11:
        rows[:] = [[str(each) for each in row] for row in _lines_of(rows, rng)]
    else:  # every number of a column in another unit, or in another way
        factor = rng.choice(
            (1e-3, 1e3, 57.29577951308232, 0.017453292519943295, 0.0, -1.0, 25.4, 1e9)
        )
        for row in full:
            try:
                row[column] = str(float(str(row[column]).replace(",", ".")) * factor)
            except (ValueError, IndexError):
                continue


def _lines_of(rows: list[list], rng: Random) -> list[list]:
    at = rng.randrange(len(rows))
    kind = rng.randrange(6)
    if kind == 0:
        return rows[:at] + rows[at + rng.choice((1, 5, 100)) :] or [[""]]
    if kind == 1:
        return rows[:at] + rows[max(at - 3, 0) : at] + rows[at:]
    if kind == 2:
        return [rows[0], *rng.sample(rows[1:], len(rows) - 1)]
    if kind == 3:
        return [*rows[:at], [], *rows[at:]]
    if kind == 4:
        return [list(each) for each in zip(*rows, strict=False)] or [[""]]
    return rows[: rng.choice((1, 2, 3, 4))]


# --- trees ----------------------------------------------------------------------------------------


def _value(rng: Random) -> Any:
    """A value nobody expects in a tree."""
    return rng.choice(
        (
            *(
                None,
                True,
                False,
                0,
                -1,
                1,
                2**31,
                2**63,
                10**30,
                10**400,
                -(10**18),
                0.5,
                1e308,
                1e-300,
            ),
            *(
                float("nan"),
                float("inf"),
                -float("inf"),
                "",
                " ",
                "x",
                odd(rng),
                odd(rng),
                odd(rng),
            ),
            *([], {}, [[]], {"": {}}, [None], [1, 2], [0.0, 1.0, 0.0], [[1, 0], [0, 1]], {"a": 1}),
            *("ur10", "auto", "data", "1e-6", "2021-03-04", rng.choice(HEADERS)),
        )
    )


def _places(tree: Any, path: tuple = ()) -> list[tuple]:
    found = [path]
    if isinstance(tree, dict):
        items = list(tree.items())
    elif isinstance(tree, list):
        items = list(enumerate(tree[:40]))
    else:
        return found
    for key, value in items:
        found += _places(value, (*path, key))
    return found


def tree(data: Any, rng: Random) -> Any:
    """One change of nested dictionaries and lists: values, keys, types, items."""
    data = copy.deepcopy(data)
    path = rng.choice(_places(data))
    if not path:
        return _value(rng) if rng.random() < 0.1 else tree(data, rng)
    around = data
    for step in path[:-1]:
        around = around[step]
    key, value, kind = path[-1], around[path[-1]], rng.randrange(12)
    if kind <= 2 and isinstance(value, int | float | str) and not isinstance(value, bool):
        word = _number(str(value), rng) if not isinstance(value, str) else odd(rng)
        try:
            around[key] = float(word) if not isinstance(value, str) else word
        except ValueError:
            around[key] = word
    elif kind <= 4:
        around[key] = _value(rng)
    elif kind == 5:
        del around[key]
    elif kind == 6:
        other = rng.choice(_places(data))
        taken = data
        for step in other:
            taken = taken[step]
        around[key] = copy.deepcopy(taken)
    elif kind == 7 and isinstance(around, dict):
        name = rng.choice(
            (odd(rng), str(key).upper(), f"{key}_", str(key).replace("deg", "rad"), 1, None)
        )
        around[name] = around.pop(key)
    elif kind == 8 and isinstance(around, dict):
        around[rng.choice((odd(rng), "name", 1, True, None, 0.5))] = _value(rng)
    elif kind == 9 and isinstance(around, list):
        around[key:key] = [copy.deepcopy(value)] * rng.choice((1, 1, 2, 20))
    elif kind == 10:
        around[key] = rng.choice(([value], {"a": value}, str(value), [value, value]))
    elif kind == 11 and isinstance(value, list):
        rng.shuffle(value)
    else:
        around[key] = _value(rng)
    return data


def yaml_text(data: bytes, rng: Random) -> bytes:
    """A YAML file: its tree, or its text with what only YAML has."""
    import yaml

    whole, _ = _decoded(data)
    if rng.random() < 0.25 or "[" * 1000 in whole:  # nested without end: no tree is made of it
        return _yaml_marks(whole, rng).encode("utf-8", "replace")
    try:
        changed = tree(yaml.load(whole, Loader=yaml.CSafeLoader), rng)
        return yaml.dump(
            changed,
            Dumper=yaml.CSafeDumper,
            default_flow_style=rng.choice((None, True, False)),
            sort_keys=False,
        ).encode("utf-8", "replace")
    except (yaml.YAMLError, ValueError, TypeError, AttributeError, OverflowError) as error:
        raise _Unfit from error


_TAGS = (
    *("!!int", "!!float", "!!binary", "!!set", "&a", "!x", "!!timestamp", "!!bool", "!!null"),
    *("!!omap", "!!str", "!!python/object:os.system", "!!float x", "!!timestamp 2021-13-45"),
)


def _yaml_marks(whole: str, rng: Random) -> str:
    lines = whole.split("\n")
    at = rng.randrange(len(lines))
    kind = rng.randrange(10)
    if kind == 0:
        key, colon, value = lines[at].partition(":")
        lines[at] = f"{key}{colon} {rng.choice(_TAGS)}{value}"
    elif kind == 1:
        lines[at:at] = [lines[at]]
    elif kind == 2:
        lines[at] = "\t" + lines[at]
    elif kind == 3:
        lines[at] = "  " * rng.choice((1, 2, 20)) + lines[at]
    elif kind == 4:
        lines[at:at] = [
            rng.choice(("<<: *a", "? [a, b]", "---", "...", "%YAML 1.1", "&a a: *a", "- - -"))
        ]
    elif kind == 5:
        lines[at] = lines[at].split(":")[0] + ": " + "[" * rng.choice((3, 11, 13, 100_000))
    elif kind == 6:
        lines[at] = lines[at].split(":")[0] + ": " + odd(rng).replace("\n", " ")
    elif kind == 7:
        depth = rng.choice((2, 6, 12, 40))
        lines[at:at] = [" " * i + "a:" for i in range(depth)]
    elif kind == 8:
        words = [f"a0: &a0 [{'1, ' * 9}1]"]
        words += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 9)]
        lines[at:at] = rng.choice((words, words[:3], ["seed: &a [*a, *a]"]))
    else:
        return "\n".join(_lines(lines, rng))
    return "\n".join(lines)


def json_text(data: bytes, rng: Random) -> bytes:
    """A JSON file: its tree, sometimes with a key twice."""
    try:
        whole = json.dumps(tree(json.loads(data), rng))
    except (ValueError, TypeError) as error:
        raise _Unfit from error
    if rng.random() < 0.05:
        whole = whole.replace("{", '{"a": 1, "a": [], ', 1)
    if rng.random() < 0.02:
        whole = rng.choice(
            ("[" * 100_000, '{"format": 1, "seed": ' + "9" * 100_000 + "}", whole * 2)
        )
    return whole.encode()


def xml_text(data: bytes, rng: Random) -> bytes:
    """An XML file: elements and attributes dropped, doubled, moved, renamed, with other values."""
    from lxml import etree

    try:
        root = etree.fromstring(data)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise _Unfit from error
    elements = list(root.iter("*"))
    one, kind = rng.choice(elements), rng.randrange(9)
    try:
        if kind <= 3:
            names = list(one.attrib)
            if names and rng.random() < 0.85:
                name = rng.choice(names)
                if kind == 0:
                    del one.attrib[name]
                else:
                    one.set(name, _attribute(one.get(name), rng))
            else:
                one.set(rng.choice(("name", "xyz", "lower", "link", "type")), odd(rng))
        elif kind == 4 and one.getparent() is not None:
            one.getparent().remove(one)
        elif kind == 5:
            rng.choice(elements).append(
                copy.deepcopy(one) if one is not root else etree.Element("joint")
            )
        elif kind == 6:
            one.tag = rng.choice(
                ("joint", "link", "robot", "parent", "child", "axis", "limit", "x")
            )
        elif kind == 7:
            one.append(
                etree.Element(rng.choice(("joint", "link", "mimic", "origin", "parent", "axis")))
            )
        else:
            one.text = odd(rng)
    except ValueError:  # what XML cannot hold
        return text(data, rng)
    return etree.tostring(root)


def _attribute(value: str, rng: Random) -> str:
    kinds = ("revolute", "prismatic", "fixed", "continuous", "planar", "floating", "l0", "l3", "j1")
    words = value.split()
    if words and rng.random() < 0.5:
        at = rng.randrange(len(words))
        words[at] = _number(words[at], rng)
        return " ".join(words)
    return rng.choice(
        (rng.choice(kinds), odd(rng), value + " 1", "", "0 0 0", "1 0 0", "0 0 1e-12")
    )


# --- Parquet and workbooks ------------------------------------------------------------------------


def parquet(data: bytes, rng: Random) -> bytes:
    """Columns of other types, names, values, nulls, lengths and metadata."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        held = pq.read_table(io.BytesIO(data))
    except (pa.ArrowException, OSError, ValueError) as error:
        raise _Unfit from error
    if not held.num_columns:
        raise _Unfit
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
        kept[rng.choice(keys)] = odd(rng).encode("utf-8", "replace")
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
        raise _Unfit from error
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
        raise _Unfit from error


def workbook(data: bytes, rng: Random) -> bytes:
    """Cells of other types, columns, rows and sheets of a workbook; or the XML within."""
    import datetime
    import warnings
    import zipfile

    if rng.random() < 0.25:
        return _within_archive(data, rng)
    if _FAR_ROW.search(_sheets(data)):
        raise _Unfit  # what to read would take for ever
    import openpyxl
    from openpyxl.utils.exceptions import IllegalCharacterError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            book = openpyxl.load_workbook(io.BytesIO(data))
    except Exception as error:
        raise _Unfit from error
    if not book.worksheets or any(each.max_row > 10_000 for each in book.worksheets):
        raise _Unfit
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
                    10**15,
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
        raise _Unfit from error
    return written.getvalue()


_FAR_ROW = re.compile(rb' r="[A-Z]*\d{6,}|r="[A-Z]{3,}')


def _sheets(data: bytes) -> bytes:
    """The text of all sheets of a workbook."""
    import zipfile

    try:
        with zipfile.ZipFile(io.BytesIO(data)) as held:
            return b"".join(held.read(name) for name in held.namelist() if "sheet" in name)
    except Exception as error:  # damaged
        raise _Unfit from error


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
        raise _Unfit from error
    if not parts:
        raise _Unfit
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


_BY_ENDING: dict[str, Callable[[bytes, Random], bytes]] = {
    ".yaml": yaml_text,
    ".json": json_text,
    ".urdf": xml_text,
    ".xlsx": workbook,
    ".parquet": parquet,
    **dict.fromkeys((".ls", ".mod", ".jbi", ".log"), text),
}


def chosen(options: dict[str, Sequence], rng: Random, most: int = 2) -> dict[str, Any]:
    """Some of the options, each with one of its values."""
    names = rng.sample(list(options), min(rng.randrange(most + 1), len(options)))
    return {name: rng.choice(list(options[name])) for name in names}

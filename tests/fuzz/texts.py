"""Changes of any text, and of tables of text: words, numbers, lines, cells, columns, encodings."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
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


class UnfitError(Exception):
    """The content is no longer of the kind that a change is for."""


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


def decoded(data: bytes) -> tuple[str, str]:
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


def encoded(whole: str, codec: str) -> bytes:
    return whole.encode(codec, "replace")


def text(data: bytes, rng: Random) -> bytes:
    """Words, numbers and lines of any text."""
    whole, codec = decoded(data)
    found = list(_NUMBER.finditer(whole))
    kind = rng.randrange(8)
    if kind <= 2 and found:
        one = rng.choice(found)
        whole = whole[: one.start()] + number(one.group(), rng) + whole[one.end() :]
    elif kind == 3:
        parts = re.split(r"(\W+)", whole)
        at = rng.randrange(len(parts))
        parts[at] = rng.choice((odd(rng), "", parts[rng.randrange(len(parts))], parts[at] * 2))
        whole = "".join(parts)
    elif kind <= 6:
        whole = "\n".join(lines_changed(whole.split("\n"), rng))
    else:
        return encoded(whole, rng.choice(ENCODINGS))
    return encoded(whole, codec)


def number(word: str, rng: Random) -> str:
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


def lines_changed(lines: list[str], rng: Random) -> list[str]:
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
        other = decoded(rng.choice(OTHERS))[0].split("\n")
        begin = rng.randrange(len(other))
        lines[at:at] = other[begin : begin + rng.choice((1, 3, 20))]
    elif kind == 8:
        lines[at] = lines[at][: rng.randrange(len(lines[at]) + 1)]
    elif kind == 9:
        lines = lines[:to] if rng.random() < 0.5 else lines[at:]
    else:
        lines[at] += rng.choice(
            ('"' + "1" * 140_000, ",", ";", "\t", " ", '"', "\r", "\\", "#", ",,,,", '"a')
        )
    return lines or [""]


# --- tables of text -------------------------------------------------------------------------------


def table(data: bytes, rng: Random) -> bytes:
    """Cells, columns, names, rows, marks and encoding of a table of text."""
    if rng.random() < 0.2:
        return text(data, rng)
    whole, codec = decoded(data)
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
        return encoded(whole, codec)
    if kind == 1:
        return encoded(
            whole.replace("\n", rng.choice(("\r\n", "\r", "\n\n", "\n\r"))), rng.choice(ENCODINGS)
        )
    grid(rows, rng, widest)
    return encoded("\n".join(mark.join(map(str, row)) for row in rows), codec)


def grid(rows: list[list], rng: Random, widest: int, cell: Callable[[Random], Any] = odd) -> None:
    """Change cells, names, columns or rows of a table in place."""
    full = [row for row in rows if len(row) == widest] or rows
    column, kind = rng.randrange(widest), rng.randrange(13)
    if kind <= 3:  # a cell
        row = rng.choice(full)
        if row:
            at = rng.randrange(len(row))
            row[at] = number(row[at], rng) if isinstance(row[at], str) and kind else cell(rng)
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

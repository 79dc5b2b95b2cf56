"""Files that nobody would write: each is read or refused with a message, never with a traceback."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from command_line import call
from hypothesis import example, given, settings
from hypothesis import strategies as st
from shared_data import EXAMPLES

DATA = "data/ur10_tmac/series_B.csv"
SERIES = "".join((EXAMPLES / DATA).read_text().splitlines(keepends=True)[:11])
CONFIG = (EXAMPLES / "ur10.yaml").read_text().partition("  ur10_d:")[0]

WORDS = "- nan inf -1e400 1e99 0x1F 1,5 =1/0 null true [1,2] {a:1} *a &a !!binary 2020-13-01 12:61"
WORDS += " é \ufeff \0 ' \" <a> &lt; q1 x_mm ; ../x"
ODD = st.sampled_from([*WORDS.split(" "), "", "\n", "!!set x", "9" * 5000, "[" * 500, "x" * 3000])
ODD |= st.text(max_size=6) | st.floats().map(str) | st.integers().map(str)
TOKEN = re.compile(r"[^\s,;:<>\"\[\]{}=]+")
ENCODINGS = st.sampled_from(["utf-8"] * 5 + ["utf-8-sig", "utf-16", "latin-1", "cp932"])
COLUMNS = {
    "dates": lambda n: pa.array([2**31 - 1] * n, pa.int32()).cast(pa.date32()),
    "durations": lambda n: pa.array([2**62] * n, pa.duration("s")),
    "no text": lambda n: pa.array([b"\xff"] * n, pa.binary()).view(pa.string()),
    "lists": lambda n: pa.array([[1.0]] * n),
    "mappings": lambda n: pa.array([{"a": 1}] * n),
    "words": lambda n: pa.array(["word"] * n),
    "numbers": lambda n: pa.array([1.5] * n),
    "decimals": lambda n: pa.array([1] * n, pa.int64()).cast(pa.decimal128(30, 3)),
}
CHANGES = st.sampled_from([*COLUMNS, "gone", "twice", "no rows"])


@st.composite
def edited(draw, text: str) -> str:
    """A valid text after one to three edits of a token or a line."""
    for _ in range(draw(st.integers(1, 3))):
        lines, tokens = text.split("\n"), [*TOKEN.finditer(text)]
        if tokens and draw(st.integers(0, 3)):
            start, end = draw(st.sampled_from(tokens)).span()
            text = text[:start] + draw(ODD) + text[end:]
        else:
            row = draw(st.integers(0, len(lines) - 1))
            new = draw(st.sampled_from([[], [lines[row]] * 2, [lines[0]], [lines[row][:9]]]))
            text = "\n".join([*lines[:row], *new, *lines[row + 1 :]])
    return text


def changed(table: pa.Table, column: int, how: str) -> pa.Table:
    """The table with one column changed, and with the digest that fits: anyone can compute it."""
    place = column % table.num_columns
    field = table.schema.field(place)
    if how == "gone":
        table = table.remove_column(place)
    elif how == "twice":
        table = table.append_column(field, table.column(place))
    elif how == "no rows":
        table = table.slice(0, 0)
    else:
        values = COLUMNS[how](len(table))
        table = table.set_column(
            place, pa.field(field.name, values.type, True, field.metadata), values
        )
    return table


def taken_or_refused(*words: object) -> None:
    done = call(*words)
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code in (0, 1, 2), done.output


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("hostile")
    (path / "data/ur10_tmac").mkdir(parents=True)
    (path / "own.yaml").write_text(CONFIG)
    return path


@pytest.fixture(scope="module")
def results(study, tmp_path_factory) -> Path:
    return shutil.copytree(study, tmp_path_factory.mktemp("results") / "arm")


@settings(max_examples=10)
@given(edited(SERIES), ENCODINGS)
@example(SERIES.replace("383.76294", "1e300"), "utf-8")
def test_a_measured_file_with_a_description(folder, text, encoding):
    (folder / DATA).write_bytes(text.encode(encoding, "replace"))
    taken_or_refused("check-data", folder / "own.yaml")


@settings(max_examples=100)
@given(edited(CONFIG.replace("series_B", "absent")))
def test_a_configuration(folder, text):
    (folder / "odd.yaml").write_bytes(text.encode("utf-8", "replace"))
    taken_or_refused("check-data", folder / "odd.yaml")


TABLES = st.sampled_from(["vec_model", "dh_model", "frames", "dh_fit", "measurements", "robot"])


@settings(max_examples=40)
@given(TABLES, st.integers(0, 12), CHANGES)
@example("vec_model", -1, "gone")
@example("frames", 5, "gone")
@example("frames", 5, "no text")
@example("measurements", 1, "gone")
@example("robot", 0, "no rows")
@example("dh_fit", 2, "numbers")
@example("dh_fit", 3, "durations")
def test_a_table_of_results(results, name, column, how):
    path = results / f"{name}.parquet"
    kept = shutil.copy(path, results.parent / "kept")
    try:
        pq.write_table(changed(pq.read_table(kept), column, how), path)
        taken_or_refused("predict", results, "--joints-deg", "10,-20,30,0,45,0")
        taken_or_refused("show", path)
    finally:
        shutil.move(kept, path)

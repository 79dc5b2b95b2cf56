"""Digests of tables and records of stages: as they are described, and what they find."""

import hashlib
import json
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from recorded import MARKS

from kinacc.artifacts import provenance, records, store
from kinacc.artifacts.pictures import inputs_digests
from kinacc.errors import InputError

_VALUES = {"double": "<d", "int64": "<q", "int8": "<b"}


def digest_by_hand(table: pa.Table) -> str:
    """The digest as docs/artifacts.md says it, value by value."""
    out = b"kinacc columns 1\n" + struct.pack("<QQ", table.num_columns, table.num_rows)
    for field in table.schema:
        values = table[field.name].to_pylist()
        unit = (field.metadata or {}).get(b"unit", b"").decode()
        for text in (field.name, str(field.type), unit):
            out += struct.pack("<Q", len(text.encode())) + text.encode()
        out += bytes([field.nullable])
        bits = [value is not None for value in values]
        bits += [False] * (-len(bits) % 8)
        for first in range(0, len(bits), 8):
            out += bytes([sum(bit << place for place, bit in enumerate(bits[first : first + 8]))])
        if str(field.type) == "string":
            words = [(value or "").encode() for value in values]
            out += b"".join(struct.pack("<Q", len(word)) for word in words) + b"".join(words)
            continue
        for value in values:
            if value is not None and value != value:
                out += bytes.fromhex("7ff8000000000000")[::-1]
            else:
                out += struct.pack(_VALUES[str(field.type)], value or 0 if value != 0 else value)
    return hashlib.sha256(out).hexdigest()


def a_table(rows: int = 21) -> pa.Table:
    """Nulls, NaN of two kinds, -0, texts of several bytes a letter, and the smallest numbers."""
    rng = np.random.default_rng(rows)
    numbers = [None if i % 5 == 3 else float(each) for i, each in enumerate(rng.normal(size=rows))]
    numbers[:3] = [float("nan"), -0.0, 5e-324][:rows]
    words = [None if i % 4 == 1 else "µ§e" * (i % 3) for i in range(rows)]
    fields = [
        pa.field("x_mm", pa.float64(), metadata={"unit": "mm"}),
        pa.field("who", pa.string()),
        pa.field("n", pa.int64(), nullable=False, metadata={"unit": "1"}),
        pa.field("s1", pa.int8()),
    ]
    small = [None if i % 7 == 0 else i % 3 - 1 for i in range(rows)]
    columns = [numbers[:rows], words, [(-1) ** i * 2**62 for i in range(rows)], small]
    arrays = [pa.array(each, field.type) for each, field in zip(columns, fields, strict=True)]
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))


@pytest.mark.parametrize("rows", [0, 1, 8, 21, 257])
def test_a_digest_is_what_its_description_says(rows):
    assert store.columns_digest(a_table(rows)) == digest_by_hand(a_table(rows))


def test_a_digest_is_of_the_values_and_not_of_what_holds_them():
    table = a_table()
    wanted = store.columns_digest(table)
    pieces = pa.concat_tables([table.slice(0, 5), table.slice(5, 0), table.slice(5)])
    other = np.frombuffer(bytes.fromhex("010000000000f87f"), "<f8")  # NaN with another payload
    nan = pa.concat_arrays([pa.array(other), table["x_mm"].chunk(0).slice(1)])
    same = table.set_column(0, table.schema.field(0), nan)
    over = pa.Array.from_buffers(  # null over letters
        pa.string(), 2, [pa.py_buffer(b"\1"), pa.py_buffer(struct.pack("<3i", 0, 1, 3)),
                         pa.py_buffer(b"abc")],
    )  # fmt: skip
    plain = pa.array(["a", None])
    assert store.columns_digest(pieces) == wanted
    assert store.columns_digest(same) == wanted
    assert store.columns_digest(pa.table({"w": over})) == store.columns_digest(
        pa.table({"w": plain})
    )


def renamed(table):
    return table.rename_columns(["y_mm", *table.column_names[1:]])


def in_metres(table):
    field = table.schema.field(0).with_metadata({"unit": "m"})
    return table.set_column(0, field, table[0])


def required(table):
    return table.set_column(3, table.schema.field(3).with_nullable(False), table[3])


def shuffled(table):
    return table.take(pa.array(np.random.default_rng(1).permutation(len(table))))


@pytest.mark.parametrize(
    "change",
    [renamed, in_metres, required, shuffled, lambda table: table.slice(1)],
    ids=["name", "unit", "nullability", "order", "row"],
)
def test_whatever_a_table_says_counts(change):
    assert store.columns_digest(change(a_table())) != store.columns_digest(a_table())


def test_letters_count_where_they_stand():
    one, other = pa.table({"w": ["ab", "c"]}), pa.table({"w": ["a", "bc"]})
    assert store.columns_digest(one) != store.columns_digest(other)
    assert store.columns_digest(pa.table({"w": [""]})) != store.columns_digest(
        pa.table({"w": pa.array([None], pa.string())})
    )


def covariance(path: Path) -> bytes:
    count = 40
    names = [f"j{i}.d_mm" for i in range(count)]
    columns = {
        "parameter": names,
        "other": names,
        "covariance": np.random.default_rng(1).normal(size=count) ** 2,
        "correlation": np.ones(count),
    }
    store.write(path, "dh_covariance", columns, MARKS)
    return path.read_bytes()


def test_no_flipped_bit_of_a_covariance_changes_a_table_in_silence(tmp_path):
    path = tmp_path / "dh_covariance.parquet"
    whole, rng, changed = covariance(path), np.random.default_rng(15), 0
    right = store.read(path)
    for _ in range(300):
        content = bytearray(whole)
        content[rng.integers(len(content))] ^= 1 << rng.integers(8)
        path.write_bytes(content)
        try:
            read = store.read(path)
        except InputError:
            continue
        for name, values in right.items():
            changed += not np.array_equal(read[name], values)
    assert changed == 0


def test_a_table_edited_with_its_metadata_kept_is_refused_where_it_is_used(tmp_path):
    path = tmp_path / "dh_covariance.parquet"
    covariance(path)
    table = pq.read_table(path)
    edited = pa.array([1.0, *table["covariance"].to_pylist()[1:]])
    pq.write_table(table.set_column(2, table.schema.field(2), edited), path)
    with pytest.raises(InputError, match="not those it was written with"):
        store.read(path)


def test_a_table_of_a_version_without_digests_is_still_read(tmp_path):
    path = tmp_path / "dh_covariance.parquet"
    covariance(path)
    table = pq.read_table(path)
    old = {key: table.schema.metadata[key.encode()] for key in store.PROVENANCE_KEYS}
    pq.write_table(table.replace_schema_metadata(old), path)
    assert len(store.read(path)["covariance"]) == 40


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"[]", b"{}", b'{"files": {"a": 3}}', b"[" * 100_000, b"\xff", b'{"files": []}'],
)
def test_what_is_no_record_is_said_to_be_none(tmp_path, content):
    path = tmp_path / "dh.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match="is no record of a stage"):
        records.read(path)


def test_a_record_says_which_of_its_files_is_another_one(tmp_path):
    place = records.place(tmp_path, "dh")
    files = {str(tmp_path / name): (name.encode(), None) for name in ("a.parquet", "b.parquet")}
    records.leave(place, records.Record("dh", None, {"seed": "1"}, {}, {}), files)
    record = records.read(place)
    assert not records.misfits(place, record)
    (tmp_path / "a.parquet").write_bytes(b"b")
    (tmp_path / "b.parquet").unlink()
    told = [str(each) for each in records.misfits(place, record)]
    assert "is not the file that stage dh wrote" in told[0]
    assert told[1].endswith("b.parquet: missing")
    assert json.loads(Path(place).read_bytes())["files"].keys() == {"a.parquet", "b.parquet"}


def told_record() -> records.Record:
    """A record that tells what its marks fold."""
    code = provenance.Code({"kinacc.a": "ab" * 32}, {"python": "3.12", "numpy": "2.1"})
    settings = {"robot": "arm.yaml", "calibration": {"dh": {"truncation": 0.01}}}
    marks = {"config_hash": provenance.config_hash(settings), "code_hash": code.folded()}
    return records.Record("dh", None, marks, {}, {}, settings, code.files, code.versions)


def test_a_record_tells_settings_and_code_and_reads_as_it_was_written(tmp_path):
    place, record = records.place(tmp_path, "dh"), told_record()
    records.leave(place, record, {str(tmp_path / "a.parquet"): (b"a", None)})
    read = records.read(place)
    assert read.misfolded() == []
    assert (read.settings, read.code, read.versions) == (
        record.settings,
        record.code,
        record.versions,
    )
    assert read.content() == Path(place).read_bytes()


@pytest.mark.parametrize(
    ("what", "other", "mark"),
    [
        ("settings", {"calibration": {"dh": {"truncation": 0.1}}}, "config_hash"),
        ("code", {"kinacc.a": "cd" * 32}, "code_hash"),
        ("versions", {"python": "3.12", "numpy": "2.2"}, "code_hash"),
    ],
)
def test_a_record_whose_settings_or_code_were_edited_does_not_fold(what, other, mark):
    assert replace(told_record(), **{what: other}).misfolded() == [mark]


def test_a_record_of_before_settings_and_code_were_told_reads_as_it_did(tmp_path):
    place = Path(records.place(tmp_path, "dh"))
    records.leave(place, records.Record("dh", None, {"seed": "1"}, {}, {}), {})
    assert json.loads(place.read_bytes()).keys() == {
        *("stage", "part", "marks", "inputs_digests", "files")
    }
    read = records.read(place)
    assert (read.settings, read.misfolded()) == (None, [])
    assert read.content() == place.read_bytes()


def test_a_run_that_ends_between_two_files_leaves_no_record(tmp_path, monkeypatch):
    place = records.place(tmp_path, "dh")
    record = records.Record("dh", None, {"seed": "1"}, {}, {})
    names = [str(tmp_path / name) for name in ("a.parquet", "b.parquet")]
    records.leave(place, record, dict.fromkeys(names, (b"old", None)))
    rename = records.replacing.__globals__["os"].replace

    def killed(source, target):
        if str(target) == names[1]:
            raise SystemExit("killed")
        rename(source, target)

    monkeypatch.setattr("kinacc.artifacts.atomic.os.replace", killed)
    with pytest.raises(SystemExit):
        records.leave(place, record, dict.fromkeys(names, (b"new", None)))
    monkeypatch.undo()
    assert [Path(name).read_bytes() for name in names] == [b"new", b"old"]
    assert not Path(place).exists()


def test_every_format_of_a_picture_states_what_it_was_drawn_from():
    from kinacc.figures import fig1, save

    read = {"study_summary": "0" * 64, "assessment_points": "f" * 64}
    made = save.render(fig1.draw(), save.FORMATS, read)
    assert {kind: inputs_digests(kind, content) for kind, content in made.items()} == dict.fromkeys(
        save.FORMATS, read
    )
    assert save.render(fig1.draw(), save.FORMATS, read) == made
    plain = save.render(fig1.draw(), save.FORMATS)
    assert all(inputs_digests(kind, content) is None for kind, content in plain.items())

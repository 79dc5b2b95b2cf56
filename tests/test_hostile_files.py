"""Files that would hang or crash a reader: every command says what is wrong, soon and in a line."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

import limited_command
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from read_columns import Q_DEG, XYZ_MM

from kinacc.errors import InputError
from kinacc.tables import store

_SECONDS, _BYTES = 15, 3 << 30
COLUMNS = [*Q_DEG, *XYZ_MM]
BRACKETS = "[" * 100_000
LAUGHS = "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 10)
)


def refused(folder: Path, *words: object) -> str:
    """What a command says of a file it does not take, in seconds and 3 GB; never a traceback."""

    log = folder / "standard error"
    command = limited_command.FORKED.Process(
        target=limited_command.run, args=([*map(str, words)], folder, log, _SECONDS, _BYTES)
    )
    command.start()
    command.join(20 * _SECONDS)  # of a machine that has other work
    command.kill()
    printed = log.read_text(encoding="utf-8")
    assert command.exitcode == 2, (command.exitcode, printed[-1000:])
    assert "Traceback" not in printed
    assert len(printed) < 20_000
    return printed


def data_set(folder: Path, file: str) -> Path:
    """A configuration that reads ``file`` as measurements of positions."""
    path = folder / "own.yaml"
    path.write_text(
        "datasets: {own: {robot: ur10, measurements: {source: file, file: "
        f"{{path: '{file}', orientation: {{kind: none}}}}}}}}}}\n"
    )
    return path


DH_ROW = "- {theta_offset_deg: 0, d_mm: %s, a_mm: 0, alpha_deg: 0, limits_deg: [-170, 170]}\n"
YAML = {
    "nested brackets": f"seed: {BRACKETS}",
    "nested blocks": "".join(" " * i + "a:\n" for i in range(900)),
    "aliases of aliases": LAUGHS,
    "aliases of itself": "seed: &a [*a, *a]\n",
    "long digits": f"name: x\nseed: {'9' * 500_000}",
    "long digits to base 60": f"seed: {'1:' * 100_000}1",
    "long digits under a tag": f'datasets: {{a: {{seed: !!int "{"1:" * 4000}1"}}}}',
    "a large file": "# nothing\n" * 500_000,
    "many unknown keys": "".join(f"key_{i}: 0\n" for i in range(90_000)),
    "many values": "seed: [" + "1," * 300_000 + "1]",
    "tags that do not fit": "seed: !!timestamp x\n!!set y: !!bool z\n? !!int ''\n: 1\n",
    "many joints": "dh:\n" + "".join(f"- {{xd_mm: {i}, foo_rad: 1}}\n" for i in range(3000)),
    "large numbers": "dh:\n" + DH_ROW % ("9" * 90) * 6,
    "many data sets": "datasets:\n" + "".join(f"  a{i}:\n" for i in range(6000)),
}


# Read as a robot; all others as a configuration.
ROBOTS = ("aliases of aliases", "long digits", "many joints", "large numbers")


@pytest.mark.parametrize(
    ("command", "name"),
    [("check-data", name) for name in YAML if name not in ROBOTS[2:]]
    + [("plan-poses", name) for name in ROBOTS],
)
def test_a_yaml_file_made_to_do_harm_is_refused_by_its_name(tmp_path, command, name):
    (tmp_path / "harm.yaml").write_text(YAML[name])
    assert "harm.yaml" in refused(tmp_path, command, "harm.yaml")


def repeated(path: Path, columns: dict[str, pa.Array], times: int) -> None:
    """The same rows again and again: a small file of a large table."""
    table = pa.table(columns)
    with pq.ParquetWriter(path, table.schema, compression="zstd", store_schema=False) as writer:
        for _ in range(times):
            writer.write_table(table, row_group_size=len(table))


COMMANDS = {
    "check-data": lambda folder, file: ("check-data", data_set(folder, file)),
    "plan-poses": lambda folder, file: ("plan-poses", "ur10", "--candidates", file),
    "init": lambda folder, file: ("init", file, "--name", "own", "--robot", "ur10"),
}


@pytest.fixture(scope="module")
def much(tmp_path_factory) -> Path:
    """A folder with files of too many rows."""
    folder = tmp_path_factory.mktemp("much")
    repeated(folder / "much.parquet", dict.fromkeys(COLUMNS, pa.nulls(3_000_000, pa.int8())), 20)
    row = ",".join(["1"] * 9) + "\n"
    (folder / "much.csv").write_text(",".join(COLUMNS) + "\n" + row * 1_050_000)
    return folder


@pytest.mark.parametrize("file", ["much.parquet", "much.csv"])
@pytest.mark.parametrize("command", COMMANDS)
def test_millions_of_rows_are_refused(much, command, file):
    assert f"{file}: " in refused(much, *COMMANDS[command](much, file))


def workbook(path: Path, *rows: list) -> Path:
    book = openpyxl.Workbook()
    for row in (COLUMNS, *rows):
        book.active.append(row)
    book.save(path)
    return path


def changed(path: Path, change) -> None:
    """Change the parts of a workbook, given by name and content."""
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in change(parts).items():
            archive.writestr(name, content)


@pytest.mark.parametrize("command", ["check-data", "init"])
def test_a_small_workbook_of_much_text_is_refused(tmp_path, command):
    path = workbook(tmp_path / "much.xlsx", [1.0] * 9)
    changed(path, lambda parts: parts | {"xl/sharedStrings.xml": b" " * 200_000_000})
    assert path.stat().st_size < 1_000_000
    assert "MB" in refused(tmp_path, *COMMANDS[command](tmp_path, "much.xlsx"))


ENTITIES = {
    "a bomb": "".join(f'<!ENTITY a{i + 1} "{f"&a{i};" * 10}">' for i in range(9)),
    "a file": '<!ENTITY a9 SYSTEM "file:///etc/hostname">',
}


@pytest.mark.parametrize("entities", ENTITIES)
def test_entities_in_a_workbook_stand_for_nothing(tmp_path, entities):
    path = workbook(tmp_path / "bad.xlsx", *[[1.0] * 8 + ["two"]] * 5)
    declared = f'<!DOCTYPE x [<!ENTITY a0 "lol">{ENTITIES[entities]}]>'.encode()

    def declare(parts: dict[str, bytes]) -> dict[str, bytes]:
        sheet = declared + parts["xl/worksheets/sheet1.xml"]
        sheet = sheet.replace(b">two<", b">&a9;<").replace(b"<v>1</v>", b"<v>&a9;</v>")
        return parts | {"xl/worksheets/sheet1.xml": sheet}

    changed(path, declare)
    printed = refused(tmp_path, "check-data", data_set(tmp_path, "bad.xlsx"))
    assert Path("/etc/hostname").read_text().strip() not in printed


def texts(rows: int) -> pa.Array:
    """A column that names one long text again and again."""
    index = pa.array(np.zeros(rows, np.int32))
    return pa.DictionaryArray.from_arrays(index, pa.array(["x" * 100_000]))


def long_texts(path: Path) -> None:
    columns = {name: pa.array(np.zeros(100_000)) for name in COLUMNS}
    repeated(path, {**columns, "pose": texts(100_000)}, 5)


def cells(values: pa.Array):
    """Write a table whose last column has other values."""
    columns = {name: pa.array(np.arange(5.0)) for name in COLUMNS[:-1]}
    return lambda path: pq.write_table(pa.table({**columns, "z_mm": values}), path)


HEAD = ",".join(COLUMNS) + "\n"
FILES = {
    "entities as a cell.xlsx": lambda path: workbook(path, *[[1.0] * 8 + ["<!ENTITY"]] * 5),
    "many digits.xlsx": lambda path: workbook(path, *[[1.0] * 8 + ["9" * 40_000]] * 5),
    "a formula.xlsx": lambda path: workbook(path, *[[1.0] * 8 + ["=1/0"]] * 5),
    "long texts.parquet": long_texts,
    "a cell without end.csv": lambda path: path.write_text(HEAD + '"' + "1" * 200_000),
    "long digits.csv": lambda path: path.write_text(HEAD + ",".join(["9" * 100_000] * 9)),
    "no calendar.parquet": cells(pa.array([2**31 - 1] * 5, pa.int32()).cast(pa.date32())),
    "lists.parquet": cells(pa.array([[1.0, 2.0]] * 5)),
    "a column twice.parquet": lambda path: pq.write_table(
        pa.table([pa.array([1.0])] * 10, names=[*COLUMNS, "x_mm"]), path
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_what_is_no_measurement_is_named(tmp_path, name):
    FILES[name](tmp_path / name)
    assert name in refused(tmp_path, "check-data", data_set(tmp_path, name))


@pytest.mark.parametrize(
    ("words", "option"),
    [
        (("plan-poses", "ur10", "--candidates", 10**9), "--candidates"),
        (("plan-poses", "ur10", "--poses", 10**6, "--candidates", 10**5), "--poses"),
        (("plan-poses", "ur10", "--candidates", "many.parquet"), "many.parquet"),
        (("campaign", "plan", "--noise-mm", "0.05", "--candidates", 10**9), "--candidates"),
        (("campaign", "plan", "--noise-mm", "0.05", "--candidates", 50_000), "--budget"),
        (("campaign", "plan", "--noise-mm", "0.05", "--repetitions", 10**9), "--repetitions"),
        (("campaign", "start", "x", "--budget", 10**9), "--budget"),
    ],
    ids=lambda value: " ".join(map(str, value)) if isinstance(value, tuple) else "",
)
def test_an_option_beyond_any_machine_is_refused_with_what_is_allowed(tmp_path, words, option):
    zeros = pa.array(np.zeros(150_000, np.int8))
    pq.write_table(pa.table(dict.fromkeys(COLUMNS, zeros)), tmp_path / "many.parquet")
    assert option in refused(tmp_path, *words)


def no_unicode(path: Path) -> None:
    buffers = [None, pa.py_buffer(b"\0\0\0\0\2\0\0\0"), pa.py_buffer(b"\xff\xfe")]
    table = pa.table({"name": pa.Array.from_buffers(pa.string(), 1, buffers)})
    pq.write_table(table.replace_schema_metadata({b"seed": b"\xff"}), path)


RESULTS = {
    "no unicode": no_unicode,
    "long texts": lambda path: repeated(path, {"name": texts(10_000)}, 1),
    "a pipe": os.mkfifo,
    "many values": lambda path: repeated(
        path, dict.fromkeys(COLUMNS, pa.nulls(3_000_000, pa.int8())), 4
    ),
}


@pytest.mark.parametrize("name", RESULTS)
def test_a_table_of_results_that_would_do_harm_is_refused(tmp_path, name):
    RESULTS[name](path := tmp_path / "robot.parquet")
    with pytest.raises(InputError, match=r"robot\.parquet"):
        store.read(path)

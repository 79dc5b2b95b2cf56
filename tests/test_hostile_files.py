"""Files that would hang or crash a reader: every command says what is wrong, soon and in a line."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

_SECONDS, _BYTES = 15, 3 << 30
COLUMNS = [f"q{joint}_deg" for joint in range(1, 7)] + ["x_mm", "y_mm", "z_mm"]
BRACKETS = "[" * 100_000
LAUGHS = "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 10)
)


def refused(folder: Path, *words: object) -> str:
    """What a command says of a file it does not take, in seconds and 3 GB; never a traceback."""

    def limits() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (_BYTES, _BYTES))

    done = subprocess.run(
        [sys.executable, "-m", "kinacc", *map(str, words)],
        cwd=folder,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=_SECONDS,
        preexec_fn=limits,
    )
    assert done.returncode == 2, (done.returncode, done.stderr[-1000:])
    assert "Traceback" not in done.stderr
    assert len(done.stderr) < 20_000
    return done.stderr


def data_set(folder: Path, file: str) -> Path:
    """A configuration that reads ``file`` as measurements of positions."""
    path = folder / "own.yaml"
    path.write_text(
        "datasets: {own: {robot: ur10, measurements: {source: file, file: "
        f"{{path: {file}, orientation: {{kind: none}}}}}}}}}}\n"
    )
    return path


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
}


@pytest.mark.parametrize("name", YAML)
@pytest.mark.parametrize(
    "command", [("check-data",), ("plan-poses",)], ids=["configuration", "robot"]
)
def test_a_yaml_file_made_to_do_harm_is_refused_by_its_name(tmp_path, command, name):
    (tmp_path / "harm.yaml").write_text(YAML[name])
    assert "harm.yaml" in refused(tmp_path, *command, "harm.yaml")


def test_a_robot_file_of_many_faults_is_answered_at_once(tmp_path):
    rows = "".join(f"- {{xd_mm: {i}, foo_rad: 1}}\n" for i in range(3000))
    (tmp_path / "robot.yaml").write_text(f"dh:\n{rows}")
    assert "has 3000 joints" in refused(tmp_path, "plan-poses", "robot.yaml")
    keys = "".join(f"key_number_{i}: 0\n" for i in range(9000))
    (tmp_path / "robot.yaml").write_text(keys)
    assert "and 8901 more" in refused(tmp_path, "plan-poses", "robot.yaml")


def test_numbers_too_large_for_an_arm_are_named(tmp_path):
    row = "{theta_offset_deg: 0, d_mm: %s, a_mm: 0, alpha_deg: 0, limits_deg: [-170, 170]}"
    text = "dh:\n" + "".join(f"- {row % ('9' * 90)}\n" for _ in range(6))
    (tmp_path / "robot.yaml").write_text(text)
    said = refused(tmp_path, "plan-poses", "robot.yaml")
    assert "robot.yaml:2, dh[0].d_mm" in said


def test_thousands_of_data_sets_are_refused_before_they_are_completed(tmp_path):
    text = "datasets:\n" + "".join(f"  a{i}:\n" for i in range(6000))
    (tmp_path / "own.yaml").write_text(text)
    assert "at most 5000" in refused(tmp_path, "check-data", "own.yaml")


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
    zeros = pa.array(np.zeros(3_000_000, np.int8))
    repeated(folder / "much.parquet", dict.fromkeys(COLUMNS, zeros), 20)
    row = ",".join(["1"] * 9) + "\n"
    (folder / "much.csv").write_text(",".join(COLUMNS) + "\n" + row * 1_050_000)
    return folder


@pytest.mark.parametrize("command", COMMANDS)
def test_a_small_parquet_file_of_sixty_million_rows_is_refused(much, command):
    assert (much / "much.parquet").stat().st_size < 3_000_000
    said = refused(much, *COMMANDS[command](much, "much.parquet"))
    assert "much.parquet: 60000000 rows" in said
    assert "at most 1000000 rows" in said


@pytest.mark.parametrize("command", ["check-data", "init"])
def test_a_small_workbook_of_much_text_is_refused(tmp_path, command):
    import zipfile

    import openpyxl

    book = openpyxl.Workbook()
    book.active.append(COLUMNS)
    book.active.append([1.0] * 9)
    book.save(tmp_path / "good.xlsx")
    with (
        zipfile.ZipFile(tmp_path / "good.xlsx") as good,
        zipfile.ZipFile(tmp_path / "much.xlsx", "w", zipfile.ZIP_DEFLATED) as much,
    ):
        for name in good.namelist():
            much.writestr(name, good.read(name))
        much.writestr("xl/sharedStrings.xml", b" " * 200_000_000)
    assert (tmp_path / "much.xlsx").stat().st_size < 1_000_000
    assert "MB" in refused(tmp_path, *COMMANDS[command](tmp_path, "much.xlsx"))


ENTITIES = {
    "a bomb": "".join(f'<!ENTITY a{i + 1} "{f"&a{i};" * 10}">' for i in range(9)),
    "a file": '<!ENTITY a9 SYSTEM "file:///etc/hostname">',
}


@pytest.mark.parametrize("entities", ENTITIES)
@pytest.mark.parametrize("part", ["xl/worksheets/sheet1.xml", "xl/sharedStrings.xml"])
def test_entities_in_a_workbook_stand_for_nothing(tmp_path, part, entities):
    import zipfile

    import openpyxl

    book = openpyxl.Workbook()
    for row in (COLUMNS, *[[1.0] * 8 + ["two"]] * 5):
        book.active.append(row)
    book.save(tmp_path / "good.xlsx")
    declared = f'<!DOCTYPE x [<!ENTITY a0 "lol">{ENTITIES[entities]}]>'.encode()
    with (
        zipfile.ZipFile(tmp_path / "good.xlsx") as good,
        zipfile.ZipFile(tmp_path / "bad.xlsx", "w", zipfile.ZIP_DEFLATED) as bad,
    ):
        for name in good.namelist():
            content = good.read(name)
            if name == part:
                begin = content.index(b"?>") + 2 if content.startswith(b"<?xml") else 0
                content = content[:begin] + declared + content[begin:]
                content = content.replace(b">two<", b">&a9;<").replace(b"<v>1</v>", b"<v>&a9;</v>")
            bad.writestr(name, content)
    said = refused(tmp_path, "check-data", data_set(tmp_path, "bad.xlsx"))
    assert "bad.xlsx" in said
    assert Path("/etc/hostname").read_text().strip() not in said


@pytest.mark.parametrize("cell", ["<!ENTITY", "9" * 40_000, "=1/0"])
def test_cells_of_a_workbook_that_are_no_numbers_are_named(tmp_path, cell):
    import openpyxl

    book = openpyxl.Workbook()
    book.active.append(COLUMNS)
    for _ in range(5):
        book.active.append([1.0] * 8 + [2.0])
    book.active.cell(3, 9).value = cell
    book.save(tmp_path / "odd.xlsx")
    said = refused(tmp_path, "check-data", data_set(tmp_path, "odd.xlsx"))
    assert "odd.xlsx" in said


def test_long_texts_repeated_in_a_small_parquet_file_are_refused(tmp_path):
    rows = 100_000
    text = pa.DictionaryArray.from_arrays(
        pa.array(np.zeros(rows, np.int32)), pa.array(["x" * 100_000])
    )
    columns = {name: pa.array(np.zeros(rows)) for name in COLUMNS}
    repeated(tmp_path / "texts.parquet", {**columns, "pose": text}, 5)
    said = refused(tmp_path, "check-data", data_set(tmp_path, "texts.parquet"))
    assert "MB in one column" in said


@pytest.mark.parametrize("command", COMMANDS)
def test_a_csv_file_of_more_than_a_million_rows_is_refused(much, command):
    said = refused(much, *COMMANDS[command](much, "much.csv"))
    assert "at most 1000000 rows" in said


@pytest.mark.parametrize(
    ("cells", "words"),
    [
        ('"' + "1" * 200_000, "line 2: cannot be read: field larger"),
        (",".join(["9" * 100_000] * 9), "column x_mm, line 2: not a finite number: '999"),
    ],
    ids=["a cell without end", "long digits"],
)
def test_cells_without_end_are_named_with_their_line(tmp_path, cells, words):
    (tmp_path / "long.csv").write_text(",".join(COLUMNS) + "\n" + cells + "\n")
    said = refused(tmp_path, "check-data", data_set(tmp_path, "long.csv"))
    assert words in said


@pytest.mark.parametrize(
    "values",
    [
        pa.array([2**31 - 1] * 5, pa.int32()).cast(pa.date32()),
        pa.array([[1.0, 2.0]] * 5),
        pa.DictionaryArray.from_arrays(pa.array([0] * 5, pa.int32()), pa.array(["word"])),
    ],
    ids=["dates outside the calendar", "lists", "words"],
)
def test_parquet_cells_that_are_no_numbers_are_named(tmp_path, values):
    columns = {name: pa.array(np.arange(5.0)) for name in COLUMNS[:-1]}
    pq.write_table(pa.table({**columns, "z_mm": values}), tmp_path / "odd.parquet")
    said = refused(tmp_path, "check-data", data_set(tmp_path, "odd.parquet"))
    assert "column z_mm, lines 1, 2, 3, 4, 5: not a finite number" in said


def test_a_parquet_file_with_a_column_twice_is_refused(tmp_path):
    table = pa.table([pa.array([1.0])] * 10, names=[*COLUMNS, "x_mm"])
    pq.write_table(table, tmp_path / "twice.parquet")
    said = refused(tmp_path, "check-data", data_set(tmp_path, "twice.parquet"))
    assert "column names given twice: x_mm" in said


@pytest.mark.parametrize(
    ("words", "option"),
    [
        (("plan-poses", "ur10", "--candidates", 10**9), "--candidates"),
        (("plan-poses", "ur10", "--poses", 10**6, "--candidates", 10**5), "--poses"),
        (("campaign", "plan", "--noise-mm", "0.05", "--candidates", 10**9), "--candidates"),
        (
            ("campaign", "plan", "--noise-mm", "0.05", "--candidates", 50_000),
            "--candidates, --budget",
        ),
        (("campaign", "plan", "--noise-mm", "0.05", "--repetitions", 10**9), "--repetitions"),
        (("campaign", "start", "x", "--budget", 10**9), "--budget"),
    ],
    ids=lambda given: " ".join(map(str, given)) if isinstance(given, tuple) else "",
)
def test_an_option_beyond_any_machine_is_refused_with_what_is_allowed(tmp_path, words, option):
    said = refused(tmp_path, *words)
    assert option in said
    assert "range" in said or "at most" in said or "allowed" in said


def test_more_candidates_than_can_be_compared_are_refused(tmp_path):
    zeros = pa.array(np.zeros(150_000, np.int8))
    pq.write_table(pa.table(dict.fromkeys(COLUMNS, zeros)), tmp_path / "many.parquet")
    said = refused(tmp_path, "plan-poses", "ur10", "--candidates", "many.parquet")
    assert "many.parquet: 150000 candidates; allowed: at most 100000" in said


def test_a_line_of_units_that_does_not_fit_the_names_is_named(tmp_path):
    row = ",".join(["1.5"] * 9)
    units = "deg,deg,deg,deg,deg,deg,mm,mm"
    text = "\n".join([",".join(COLUMNS), units, *[row] * 5])
    (tmp_path / "units.csv").write_text(text + "\n")
    said = refused(tmp_path, "init", "units.csv", "--name", "own", "--robot", "ur10")
    assert "units" in said


def test_a_damaged_results_table_is_no_traceback(tmp_path):
    from kinacc.errors import InputError
    from kinacc.tables.store import read, read_metadata

    names = pa.Array.from_buffers(
        pa.string(), 1, [None, pa.py_buffer(b"\0\0\0\0\2\0\0\0"), pa.py_buffer(b"\xff\xfe")]
    )
    path = tmp_path / "robot.parquet"
    table = pa.table({"name": names}).replace_schema_metadata({b"seed": b"\xff"})
    pq.write_table(table, path)
    with pytest.raises(InputError, match=r"robot\.parquet: not a readable Parquet file"):
        read(path)
    assert set(read_metadata(path)) >= {"seed"}


def test_long_texts_repeated_in_a_results_table_are_refused_before_they_are_unpacked(tmp_path):
    from kinacc.errors import InputError
    from kinacc.tables.store import read

    text = pa.DictionaryArray.from_arrays(
        pa.array(np.zeros(10_000, np.int32)), pa.array(["x" * 100_000])
    )
    repeated(tmp_path / "texts.parquet", {"name": text}, 1)
    assert (tmp_path / "texts.parquet").stat().st_size < 1_000_000
    with pytest.raises(InputError, match="holds more than 400 MB"):
        read(tmp_path / "texts.parquet")


def test_a_pipe_in_place_of_a_results_table_is_not_waited_for(tmp_path):
    from kinacc.errors import InputError
    from kinacc.tables.store import read

    os.mkfifo(tmp_path / "robot.parquet")
    with pytest.raises(InputError):
        read(tmp_path / "robot.parquet")


def test_a_results_table_of_a_billion_values_is_refused_before_it_is_unpacked(tmp_path):
    from kinacc.errors import InputError
    from kinacc.tables.store import read

    zeros = pa.array(np.zeros(3_000_000, np.int8))
    repeated(tmp_path / "much.parquet", dict.fromkeys(COLUMNS, zeros), 4)
    with pytest.raises(InputError, match="holds more than 400 MB"):
        read(tmp_path / "much.parquet")

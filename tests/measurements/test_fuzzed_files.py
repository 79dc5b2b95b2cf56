"""Files that nobody meant: every reader returns or names what is wrong, soon, in little memory."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from contextlib import suppress
from datetime import timedelta
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from kinacc.errors import InputError
from kinacc.kinematics import robot
from kinacc.measurements.intake import guess
from kinacc.measurements.reader import read
from kinacc.measurements.rows import read_rows

ARM = robot.load("ur10")
GIGABYTE = 1 << 30
fuzzed = settings(
    deadline=timedelta(seconds=5),
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
# Pieces of measured files and what stands in wrong places of them.
NAMES = st.sampled_from(
    [
        "q1_deg",
        "q2",
        "J3 [°]",
        "A4",
        "Achse 5 (Grad)",
        "joint_6",
        "x_mm",
        "Y [in]",
        "Z gemessen",
        "A",
        "B",
        "C",
        "Hz [gon]",
        "V",
        "D [m]",
        "Nominal X",
        "std_x_mm",
        "Ux (k=2)",
        "rot_q1",
        "時間",
        "pose",
        "Target",
        "time",
        "#",
        "",
        "Mean",
        "[mm]",
        "deg",
        "radius",
        "{A1",
        "测",
        "\ufeff",
        "q99",
    ]
)
CELLS = st.one_of(
    st.floats(allow_nan=True).map(repr),
    st.integers().map(str),
    st.sampled_from(
        ["1.234,5", "1 234", "9999", "9E9", "---", "NaN", "12:30", "2,5", "−3", "1_000", '"']
    )
    | st.sampled_from(
        ["{E6AXIS: A1 1, A2 2}", "[[1,2,3],[1,0,0,0]]", "12.05.2021", "3°", "9" * 500]
    ),
    st.text(max_size=8),
)


@pytest.fixture(autouse=True)
def little_memory() -> Iterator[None]:
    """No more than a gigabyte beside what the process has."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + GIGABYTE, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


def look(path: Path) -> None:
    """All readers of measured files; what is wrong with one is an InputError."""
    for reader in (
        lambda: read(guess.look(path).section, ARM, strict=False),
        lambda: read({"path": str(path)}, ARM),
        *(
            lambda need=need: read_rows(path, ARM.dh.prismatic, need)
            for need in ("joints", "points", "poses")
        ),
    ):
        with suppress(InputError):
            reader()


@st.composite
def tables(draw) -> str:
    mark = draw(st.sampled_from([",", ";", "\t", " ", "  "]))
    width = draw(st.integers(1, 14))
    names = draw(st.lists(NAMES, min_size=width, max_size=width))
    row = st.lists(CELLS, min_size=max(width - 1, 0), max_size=width + 1) | st.just(names)
    rows = draw(st.lists(row, max_size=12))
    head = draw(st.sampled_from(["", "sep=;\n", "# a remark\n", "Title\n\n", "Units: Inches\n"]))
    return head + "\n".join(mark.join(cells) for cells in [names, *rows])


@fuzzed
@given(text=tables(), encoding=st.sampled_from(["utf-8", "utf-16", "cp1252", "cp932"]))
def test_text(text: str, encoding: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(text.encode(encoding, errors="ignore"))
    look(tmp_path / "a.csv")


@fuzzed
@given(one=tables(), other=tables())
def test_two_files(one: str, other: str, tmp_path: Path) -> None:
    paths = tmp_path / "joints.csv", tmp_path / "points.csv"
    for path, text in zip(paths, (one, other), strict=True):
        path.write_text(text, encoding="utf-8", errors="ignore")
    with suppress(InputError):
        read(guess.look(paths).section, ARM, strict=False)


@fuzzed
@given(
    content=st.binary(max_size=400),
    suffix=st.sampled_from(["csv", "txt", "xlsx", "parquet", "src"]),
)
def test_bytes(content: bytes, suffix: str, tmp_path: Path) -> None:
    (tmp_path / f"a.{suffix}").write_bytes(content)
    look(tmp_path / f"a.{suffix}")


POSITIONS = st.sampled_from(
    [
        "DECL E6AXIS XP1={A1 1,A2 2,A3 3,A4 4,A5 5,A6 6}",
        "DECL E6POS XP2={X 1,Y 2,Z 3,A 0,B 0,C 0}",
        "CONST jointtarget p:=[[1,2,3,4,5,6],[9E9]];",
        "CONST robtarget p:=[[1,2,3],[1,0,0,0]];",
        "P[1]{\n GP1:\n J1= 1 deg, J2= 2 deg,\n J3= 3 deg, J4= 4 deg\n};",
        "/JOB",
        "///PULSE",
        "PTP {A1 0}",
        "C00001=1,2,3,4,5,6",
        "P1=1,2",
        "{",
        "}",
        "[[",
        "E6AXIS X={",
        "P[",
        "P[3]{",
        ":=",
    ]
)


@fuzzed
@given(parts=st.lists(POSITIONS | st.text(max_size=10), max_size=12))
def test_programs(parts: list[str], tmp_path: Path) -> None:
    (tmp_path / "a.src").write_text("\n".join(parts), encoding="utf-8", errors="ignore")
    look(tmp_path / "a.src")


COLUMNS = st.sampled_from(
    [
        pa.array(np.arange(4.0)),
        pa.array(np.arange(4)),
        pa.array(["a", None, "1,5", ""]),
        pa.array([None] * 4),
        pa.array([[1.0]] * 4),
        pa.array([np.nan, np.inf, 1e300, 0.0]),
        pa.array([2**60, -(2**60), 0, 1], pa.timestamp("us")),
        pa.array([b"\xff"] * 4),
        pa.array([True] * 4),
    ]
)


@fuzzed
@given(columns=st.dictionaries(NAMES, COLUMNS, max_size=12))
def test_parquet(columns: dict[str, pa.Array], tmp_path: Path) -> None:
    pq.write_table(pa.table(columns), tmp_path / "a.parquet")
    look(tmp_path / "a.parquet")


KEYS = st.sampled_from(
    [
        "name: x",
        "dh:",
        "  - {theta_offset_deg: 0, d_mm: 0, a_mm: 1, alpha_deg: 0}",
        "convention: standard",
        "joint_map: [[1]]",
        "urdf: a.urdf",
        "dh: 3",
        "limits_deg: [1, 2]",
        "- 1",
        "name: [",
        "{",
        "&a [*a]",
    ]
)
LINKS = st.sampled_from(
    [
        '<robot name="r">',
        "</robot>",
        '<link name="a"/>',
        '<link name="b"/>',
        "<joint>",
        "</joint>",
        '<joint name="j" type="revolute"><parent link="a"/><child link="b"/></joint>',
        '<joint name="k" type="fixed"><parent link="b"/><child link="a"/></joint>',
        "<!ENTITY x",
        "&x;",
        '<origin xyz="1 nan" rpy="0 0 0"/>',
        '<limit lower="-1" upper="1e999"/>',
    ]
)


@fuzzed
@given(lines=st.lists(KEYS | st.text(max_size=8), max_size=10), xml=st.lists(LINKS, max_size=8))
def test_robot_files(lines: list[str], xml: list[str], tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("\n".join(lines), encoding="utf-8", errors="ignore")
    (tmp_path / "a.urdf").write_text("\n".join(xml), encoding="utf-8", errors="ignore")
    for name in ("a.yaml", "a.urdf"):
        with suppress(InputError):
            robot.load(str(tmp_path / name))

"""Valid inputs that mutations begin with: shipped robots, measured examples, generated files."""

from __future__ import annotations

import io
import shutil
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from fuzz.case import Case

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = ROOT / "src" / "kinacc" / "kinematics" / "robots"
_LINES = 45  # of an example; what matters in a file stands near its beginning
JOINTS = ("q1_deg", "q2_deg", "q3_deg", "q4_deg", "q5_deg", "q6_deg")
TURNED = ("rx_deg", "ry_deg", "rz_deg")


@contextmanager
def scratch() -> Iterator[Path]:
    """A folder for files that are made to be read back as bytes."""
    folder = Path(tempfile.mkdtemp(prefix="kinacc-fuzz-"))
    try:
        yield folder
    finally:
        shutil.rmtree(folder)


def _content(folder: Path) -> dict[str, bytes]:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def _short(content: bytes, lines: int = _LINES) -> bytes:
    return b"\n".join(content.split(b"\n")[:lines]) + b"\n"


@cache
def as_they_come() -> tuple[Case, ...]:
    """Files as instruments, controllers and spreadsheets write them, and the shipped examples."""
    from measurements.files_as_they_come import FILES

    cases = []
    for make in FILES.values():
        with scratch() as folder:
            made = make(folder)
            given = [path.name for path in made.files]
            robot = Path(made.robot).name
            files = _content(folder)
        if max(map(len, files.values())) > 50_000:
            continue  # says nothing that a shorter one does not
        cases.append(Case(files, {"given": given, "robot": robot}))
    for path in sorted((ROOT / "examples" / "data").glob("*/*.csv")):
        robot = "ur10" if "ur10" in str(path) else "../shared/ur5.robot.yaml"
        robot = robot if robot == "ur10" else "ur5.robot.yaml"
        files = {path.name: _short(path.read_bytes())}
        if robot != "ur10":
            files[robot] = (ROOT / "examples" / "ur5.robot.yaml").read_bytes()
        cases.append(Case(files, {"given": [path.name], "robot": robot}))
    return tuple(cases)


@cache
def columns() -> dict[str, Any]:
    """A good table of a simulated UR10: joints, points, orientations and what may stand beside."""
    import numpy as np
    from scipy.spatial.transform import Rotation

    from kinacc.kinematics import dh, robot

    arm, rng = robot.load("ur10"), np.random.default_rng(5)
    q_rad = rng.uniform(-1.5, 1.5, (24, 6))
    pose = dh.forward(arm.dh, q_rad)
    euler = Rotation.from_matrix(pose.rotation).as_euler("XYZ", degrees=True)
    table = dict(zip(JOINTS, np.rad2deg(q_rad).T, strict=True))
    table |= dict(zip(("x_mm", "y_mm", "z_mm"), pose.position_mm.T, strict=True))
    table |= dict(zip(TURNED, euler.T, strict=True))
    table |= {f"std_{axis}_mm": np.full(24, 0.02) for axis in "xyz"}
    table |= {"pose": np.arange(24) // 2, "temperature_c": np.linspace(20.0, 21.0, 24)}
    return table


_SECTION = {"orientation": {"kind": "euler", "convention": "XYZ", "order": "wxyz", "unit": "deg"}}


def _described(name: str, content: bytes, **section: Any) -> Case:
    given = {**_SECTION, "path": name, **section}
    return Case({name: content}, {"section": given, "robot": "ur10", "given": [name]})


@cache
def workbooks() -> tuple[Case, ...]:
    """Workbooks with a description."""
    import openpyxl

    book = openpyxl.Workbook()
    table = columns()
    book.active.append(list(table))
    for row in zip(*table.values(), strict=True):
        book.active.append([float(each) for each in row])
    written = io.BytesIO()
    book.save(written)
    return (_described("poses.xlsx", written.getvalue()),)


@cache
def parquet_files() -> tuple[Case, ...]:
    """Parquet files with a description: plain, with several targets, with a payload."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    cases = []
    table = columns()
    more = {f"mB_{axis}_mm": table[f"{axis}_mm"] + 100.0 for axis in "xyz"}
    load = {"payload_kg": table["temperature_c"], "session": ["a", "b"] * 12, "s1": [1, -1] * 12}
    for extra in ({}, more, load):
        written = io.BytesIO()
        pq.write_table(pa.table({**table, **extra}), written)
        cases.append(_described("poses.parquet", written.getvalue()))
    return tuple(cases)


@cache
def with_description() -> tuple[Case, ...]:
    """Text files and workbooks with the description that a look at them gives."""
    from kinacc.errors import KinaccError
    from kinacc.measurements.intake import guess as guesses

    cases = []
    answers = {"sigma": "2", "clock_offset": "0", "no_reading": "none", "direction_unit": "gon"}
    for case in as_they_come():
        with scratch() as folder, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            case.write(folder)
            paths = [folder / name for name in case.options["given"]]
            try:
                found = guesses.look(paths if len(paths) > 1 else paths[0], answers=answers)
            except KinaccError:
                continue
            section = _within(found.section, folder)
        cases.append(Case(case.files, {**case.options, "section": section}))
    with_example = ROOT / "examples" / "data" / "ur10_tmac" / "series_B.csv"
    cases.append(_described("series_B.csv", _short(with_example.read_bytes())))
    return tuple(cases)


def _within(section: Any, folder: Path) -> Any:
    """A section whose paths start in the folder of the case."""
    if isinstance(section, dict):
        return {key: _within(value, folder) for key, value in section.items()}
    if isinstance(section, (list, tuple)):
        return [_within(value, folder) for value in section]
    return section.replace(f"{folder}/", "") if isinstance(section, str) else section


@cache
def robots() -> tuple[Case, ...]:
    """Robot files: the shipped ones, that of the example, tables in every form."""
    from measurements.simulated_arms import KR10_YAML

    texts = [path.read_bytes() for path in sorted(SHIPPED.glob("*.yaml"))]
    texts += [(ROOT / "examples" / "ur5.robot.yaml").read_bytes(), KR10_YAML.encode()]
    texts += [each.encode() for each in (_SCARA, _OF_URDF)]
    arm = urdfs()[0].files["arm.urdf"]
    return tuple(Case({"arm.yaml": text, "arm.urdf": arm}) for text in texts)


_SCARA = """
name: scara
source: a page
date: 2021-03-04
convention: modified
dh:
- {joint: revolute, theta_offset_deg: 0, d_mm: 300, a_mm: 0, alpha_deg: 0, limits_deg: [-130, 130]}
- {theta_offset_rad: 0.1, d_m: 0, a_m: 0.4, alpha_rad: 0, sign: -1, limits_rad: [-2.5, 2.5]}
- {joint: prismatic, theta_offset_deg: 0, d_mm: 0, a_mm: 250, alpha_deg: 180, limits_m: [0, 0.2]}
- {name: h, theta_offset_deg: 0, d_mm: 0, a_mm: 0, alpha_deg: 0, beta_deg: 1, limits_rad: [-1, 1]}
joint_map: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0.5, 0, 1]]
base: {position_mm: [0, 0, 100], rpy_deg: [0, 0, 90]}
flange: {position_m: [0, 0, 0.1], quaternion_wxyz: [1, 0, 0, 0]}
tool: {position_mm: [0, 0, 100], rotation_vector_deg: [0, 90, 0]}
"""
_OF_URDF = """
name: own
urdf: arm.urdf
base_link: l0
tip_link: l7
joint_map: {couplings: []}
tool: {position_mm: [0, 0, 100], rotation_vector_rad: [0, 0.5, 0]}
"""


def _urdf(joints: list[tuple[str, str, str, str]], more: str = "") -> bytes:
    links = "".join(f'<link name="l{i}"/>' for i in range(len(joints) + 1))
    parts = [
        f'<joint name="j{i}" type="{kind}"><origin xyz="{xyz}" rpy="{rpy}"/>'
        f'<parent link="l{i}"/><child link="l{i + 1}"/><axis xyz="{axis}"/>'
        f'<limit lower="-2.5" upper="2.0" effort="1" velocity="1"/></joint>'
        for i, (kind, xyz, rpy, axis) in enumerate(joints)
    ]
    return (
        f'<?xml version="1.0"?>\n<robot name="arm">{links}{"".join(parts)}{more}</robot>'.encode()
    )


@cache
def urdfs() -> tuple[Case, ...]:
    """URDF files of turning and sliding arms, with branches, shapes and couplings."""
    turning = [
        ("revolute", "0 0 0.1273", "0 0 0", "0 0 1"),
        ("revolute", "0 0.220941 0", "0 1.570796325 0", "0 1 0"),
        ("revolute", "0 -0.1719 0.612", "0 0 0", "0 1 0"),
        ("revolute", "0 0 0.5723", "0 1.570796325 0", "0 1 0"),
        ("revolute", "0 0.1149 0", "0 0 0", "0 0 1"),
        ("continuous", "0 0 0.1157", "0 0 0", "0 1 0"),
        ("fixed", "0 0.0922 0", "0 0 1.570796325", "1 0 0"),
    ]
    sliding = [("prismatic", "0 0.2 0", "0 0 0", "1 0 0"), *turning]
    branch = (
        '<link name="finger"/><joint name="grip" type="prismatic"><parent link="l3"/>'
        '<child link="finger"/><axis xyz="1 0 0"/><limit lower="0" upper="0.1"/>'
        '<mimic joint="j1" multiplier="2"/></joint>'
    )
    shape = '<!-- by hand --><?pi x?><link name="box"><visual><box size="1 1 1"/></visual></link>'
    made = (_urdf(turning), _urdf(sliding), _urdf(turning, branch), _urdf(turning, shape))
    return tuple(Case({"arm.urdf": each}) for each in made)


@cache
def configurations() -> tuple[Case, ...]:
    """Configuration files: the paper's, the examples', and one that gives keys of every section."""
    files = {
        "series_B.csv": _short((ROOT / "examples/data/ur10_tmac/series_B.csv").read_bytes(), 5)
    }
    texts = [(ROOT / "config.yaml").read_bytes()]
    for name in ("ur10.yaml", "ur10_published.yaml", "fanuc.yaml"):
        text = (ROOT / "examples" / name).read_text()
        text = text.replace("data/ur10_tmac/", "").replace("published_series_D", "series_B")
        texts.append(text.encode())
    texts.append(b"datasets: {a: {robot: mh180}}\nstudy: {repetitions: 20}\nmap: {grid_mm: 100}\n")
    texts.append(
        b"datasets:\n  own:\n    robot: arm.yaml\n    seed: 3\n    calibration:\n"
        b"      vec: {order: auto, joint_range: [[-9, 9], [-9, 9], [-9, 9], [-9, 9], [-9, 9]]}\n"
        b"      dh: {parameters: {a2: free, d3: {value: 1, std: 0.1}}, loss: huber}\n"
        b"      frames: {tool_x: fixed}\n      compliance: {joints: [2, 3]}\n    measurements:\n"
        b"      source: file\n"
        b"      file: {path: series_B.csv, exclude: [{lines: [3], reason: slip}]}\n"
    )
    arm = (SHIPPED / "ur10.yaml").read_bytes()
    return tuple(Case({"own.yaml": text, "arm.yaml": arm, **files}) for text in texts)


@cache
def small_results() -> dict[str, bytes]:
    """Files of the results of a small synthetic arm, made by the workflow's own stages."""
    from command_line import small_study

    with scratch() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        small_study(folder)
        return {
            name: data for name, data in _content(folder / "results").items() if ".log" not in name
        }


def without_what_is_beside(case: Case) -> Case:
    """A case as it is kept: of the files of results, those that were changed."""
    if "mh180/frames.parquet" not in case.files or len(case.files) < 5:
        return case
    files = {k: v for k, v in case.files.items() if small_results().get(k) != v}
    return Case(files, {**case.options, "given": [], "beside": "results"})


def with_what_is_beside(case: Case) -> Case:
    """A kept case as it is read."""
    whole = small_results() if case.options.get("beside") else {}
    return Case({**whole, **case.files}, case.options)


@cache
def campaign() -> tuple[Case, ...]:
    """Campaigns on disk: begun, with readings, with a point left out and a reading struck."""
    import numpy as np

    from kinacc.assess.random_numbers import key_of
    from kinacc.assess.world import drawn_world
    from kinacc.campaign import begin
    from kinacc.campaign import folder as folders
    from kinacc.campaign.instrument import instruments
    from kinacc.campaign.plan import Limits, assessor_of
    from kinacc.campaign.reading import Reading
    from kinacc.campaign.state import restore
    from kinacc.deployment.planning.candidates import spread
    from kinacc.deployment.record import nominal
    from kinacc.kinematics import robot

    arm = nominal(robot.load("mh180"))
    points = begin.points_of(arm, spread(arm.robot, 12), [f"p{i}" for i in range(12)])
    about = {"robot": "mh180", "calibration": "none", "model": "nominal", "point": "tool",
             "candidates": "drawn"}  # fmt: skip
    cases = []
    for name, count in (("search_and_confirm", 0), ("search_and_confirm", 9), ("single_shot", 6)):
        plan = begin.plan_of(
            arm, points, assessor_of(name, {"measurements": 12}),
            instruments(("tracker=0.05",), "base"),
            Limits(np.deg2rad(0.02), 10.0), 3, np.zeros(6), about,
        )  # fmt: skip
        order = plan.visiting(frozenset())
        errors = np.random.default_rng(11).normal(size=(len(points), 3))[order] * 0.2
        world = drawn_world(errors, 0.05, key_of(5), 400)
        with scratch() as folder:
            folders.start(folder, plan)
            for number in range(count):
                state = folders.open_(folder).state()
                if state.asked is None:
                    break
                row = int(np.flatnonzero(state.rows == state.asked)[0])
                position = plan.points.modelled_mm[state.asked] + world.reading_mm(row, 0)
                reading = Reading(state.asked, position, plan.instruments[0].name)
                entry = folders.readings_entry([reading], file="ab" if number % 2 else None)
                folders.open_(folder).write(entry)
                if number == 4:
                    folders.open_(folder).write(folders.leave_out_entry(int(state.asked), "wall"))
                    folders.open_(folder).write(folders.strike_entry(2, "bumped"))
            with_state = folders.open_(folder)
            restore(with_state.plan, with_state.journal.entries)
            files = {name: data for name, data in _content(folder).items() if name != "lock"}
            cases.append(Case(files, {"given": list(files)}))
    return tuple(cases)


@cache
def joint_files() -> tuple[Case, ...]:
    """Files of joints and poses as commands take them: CSV, Parquet, JSON, programs."""
    import json

    import numpy as np
    import pyarrow as pa
    import pyarrow.parquet as pq

    from kinacc.geometry import quaternion_from_rotation
    from kinacc.kinematics import robot

    arm = robot.load("mh180")
    rng = np.random.default_rng(7)
    share = rng.uniform(0.4, 0.6, (6, 6))
    q_rad = arm.q_min_rad + share * (arm.q_max_rad - arm.q_min_rad)
    pose = robot.forward(arm, q_rad)
    quaternion = quaternion_from_rotation(pose.rotation)
    table = dict(zip(JOINTS, np.rad2deg(q_rad).T.round(6).tolist(), strict=True))
    table |= dict(zip(("x_mm", "y_mm", "z_mm"), pose.position_mm.T.tolist(), strict=True))
    table |= dict(zip(("qw", "qx", "qy", "qz"), quaternion.T.tolist(), strict=True))
    table |= {"pose": [f"p{i}" for i in range(6)], "payload_kg": [0.0, 1, 2, 3, 4, 5]}
    names = (list(table), [*JOINTS], [*table][:9],
             [*JOINTS, "x_mm", "y_mm", "z_mm", "rvx_deg", "rvy_deg", "rvz_deg"],
             ["x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad", "q1_rad", *JOINTS[1:]],
             [*JOINTS, *(f"s{i}" for i in range(1, 7)), "status"])  # fmt: skip
    cases = []
    for chosen in names:
        held = {name: table.get(name, [0.1 * i for i in range(6)]) for name in chosen}
        held |= {
            name: [1, -1, 0, 1, 1, 1] for name in chosen if name in {f"s{i}" for i in range(1, 7)}
        }
        rows = [",".join(map(str, row)) for row in zip(*held.values(), strict=True)]
        cases.append(Case({"rows.csv": "\n".join([",".join(held), *rows]).encode()}))
        text = "\n".join(
            [";".join(held), *(row.replace(",", ";").replace(".", ",") for row in rows)]
        )
        cases.append(Case({"rows.csv": text.encode()}))
        written = io.BytesIO()
        pq.write_table(pa.table(held), written)
        cases.append(Case({"rows.parquet": written.getvalue()}))
        listed = [dict(zip(held, row, strict=True)) for row in zip(*held.values(), strict=True)]
        cases.append(Case({"rows.json": json.dumps({"rows": listed}).encode()}))
    for case in as_they_come():
        name = case.options["given"][0]
        cases.append(Case({name: case.files[name]}))
    return tuple(cases)

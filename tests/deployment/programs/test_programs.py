"""Robot programs of the examples: only numbers change, and they bring the real arm to its poses."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from deployment.small_arms import TOOL, calibrated
from oracles.kinematics import dh_forward
from pose_checks import movement, of_matrices
from read_columns import Q_DEG
from scipy.spatial.transform import Rotation
from shared_data import EXAMPLES

from kinacc.deployment.programs import abb, compensate_program, kuka, read_program, yaskawa
from kinacc.deployment.programs.orientation import (
    FIXED,
    INTRINSIC,
    KUKA,
    QUATERNION,
    VECTOR,
    Convention,
)
from kinacc.deployment.programs.record import CHANGED, NUMBER, SEVERAL, STILL, Source, _written
from kinacc.errors import InputError
from kinacc.geometry import Pose, exp_so3
from kinacc.kinematics import robot

PROGRAMS = EXAMPLES / "programs"
KR6 = str(PROGRAMS / "kr6.yaml")
ARMS = {
    "weld.src": KR6,
    "weld.mod": "irb120",
    "weld.ls": "fanuc_r2000ic_165f",
    "weld.script": "ur10",
    "WELD.JBI": "mh180",
    "joints.csv": "irb120",
}
PULSES = np.array([1500.0, 1500.0, 1500.0, 1200.0, 1200.0, 800.0])
ANGLES = np.rad2deg(Rotation.from_matrix(TOOL.rotation).as_euler("xyz"))
LEFT = {"weld.src": 1, "weld.mod": 1, "weld.ls": 1, "weld.script": 1}


def corrected(name, folder=PROGRAMS, **options):
    pulses = PULSES if name.endswith("JBI") else None
    if name == "joints.csv":
        options = {"tools": {"": np.array([30.0, -20.0, 150.0, *ANGLES])}, **options}
    arm = calibrated(ARMS[name])
    return compensate_program(arm, folder / name, pulses_per_deg=pulses, **options)


def without_numbers(content: bytes) -> str:
    return re.sub(NUMBER, "#", content.decode("latin-1"))


@pytest.mark.parametrize("name", ARMS)
def test_every_example_is_corrected_and_only_its_numbers_change(name):
    found = corrected(name)
    assert not found.refused
    assert (found.table["status"] == "corrected").all()
    assert len(found.not_corrected) == LEFT.get(name, 0)
    assert found.table[["change_mm", "change_mrad"]].stack().between(0.05, 20.0).all()
    for path, content in found.files.items():
        old = path.read_bytes()
        assert content != old
        assert without_numbers(content) == without_numbers(old)


def test_frames_that_are_missing_are_asked_for(tmp_path):
    shutil.copy(PROGRAMS / "weld.ls", tmp_path / "weld.ls")
    arm = calibrated(ARMS["weld.ls"], "dh")
    with pytest.raises(InputError, match="--tool"):
        compensate_program(arm, tmp_path / "weld.ls")
    given = {"1": np.array([30.0, -20.0, 150.0, -29.0, 1.0, 41.0])}
    base = np.array([1200.0, -200.0, 300.0, 0.0, 0.0, 10.0])
    asked = []

    def ask(*words):
        asked.append(words)
        return base

    found = [
        compensate_program(arm, tmp_path / "weld.ls", given, {"": base}),
        compensate_program(arm, tmp_path / "weld.ls", given, ask=ask),
    ]
    assert found[0].files == found[1].files
    assert asked == [("base", "1")]


def test_joints_are_corrected_where_the_tool_they_name_is(tmp_path):
    """The same joints of one arm with the same tool, as a table, a listing and a program."""
    numbers = np.array([30.0, -20.0, 150.0, -29.0, 1.0, 41.0])
    arm, q_deg = calibrated("irb120"), (20.0, 10.0, 15.0, 30.0, 40.0, 5.0)
    axes = ", ".join(f"A{axis} {value}" for axis, value in enumerate(q_deg, 1))
    joints = ", ".join(f"J{axis} = {value} deg" for axis, value in enumerate(q_deg, 1))
    texts = {
        "own.csv": f"{','.join(f'q{axis}_deg' for axis in range(1, 7))}\n{str(q_deg)[1:-1]}\n",
        "own.ls": f"/POS\nP[1]{{\n GP1:\n UF : 1, UT : 1,\n {joints}\n}};",
        "own.src": f"BAS(#TOOL,1)\nPTP {{{axes}}}",
    }
    written = []
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
        given = {"" if name == "own.csv" else "1": numbers}
        if name == "own.src":
            given["1"] = np.r_[numbers[:3], numbers[5:2:-1]]  # A, B, C turn about z, y, x
        found = compensate_program(arm, tmp_path / name, given)
        (content,) = found.files.values()
        written.append([float(number) for number in re.findall(rb"-?\d+\.\d+", content)])
        if name != "own.csv":
            with pytest.raises(InputError, match="--tool"):
                compensate_program(arm, tmp_path / name)
    table, listing, program = written
    assert listing == pytest.approx(table, abs=1e-3)
    assert program == pytest.approx(table, abs=1e-4)


def test_files_without_positions_are_refused(tmp_path):
    for name, text, message in (
        ("own.txt", "", "no robot language"),
        ("own.src", "LIN P1\nLIN P2", "own.src:2: LIN P2"),
        ("own.csv", "q1_deg,speed\n1,2\nx,3", "own.csv:3: has no number"),
        ("own.csv", "speed\n3", "names no columns of positions"),
        ("own.mod", "\0", "no text of one byte"),
    ):
        with pytest.raises(InputError, match=message):
            _read(tmp_path, name, text)


def test_a_program_is_corrected_once_and_files_are_kept(tmp_path):
    found = corrected("weld.src")
    out = tmp_path / "weld_cal.src"
    found.write(out)
    assert sorted(each.name for each in tmp_path.iterdir()) == [
        "weld_cal.dat", "weld_cal.src", "weld_cal.src.kinacc.json"
    ]  # fmt: skip
    with pytest.raises(InputError, match="--force"):
        found.write(out)
    found.write(out, force=True)
    facts = json.loads((tmp_path / "weld_cal.src.kinacc.json").read_text())
    assert facts["from"] == ["weld.src", "weld.dat"]
    shutil.copy(PROGRAMS / "$config.dat", tmp_path)
    for ending in ("src", "dat"):
        (tmp_path / f"weld_cal.{ending}").rename(tmp_path / f"again.{ending}")
    with pytest.raises(InputError, match="compensated before"):
        compensate_program(calibrated(KR6, "dh"), tmp_path / "again.src")


def _kuka(tmp_path, *lines):
    path = tmp_path / "own.src"
    path.write_text("\n".join(["DEF own()", "$TOOL=$NULLFRAME", "$BASE=$NULLFRAME", *lines, "END"]))
    return path


HOME = "{A1 20, A2 -80, A3 100, A4 10, A5 40, A6 5}"


def _pose(turn, a1=20.0, a4=10.0, more=""):
    """The frame at these joints."""
    q_rad = np.deg2rad([[a1, -80.0, 100.0, a4, 40.0, 5.0]])
    pose = Pose(*(part[0] for part in robot.forward(robot.load(KR6), q_rad)))
    values = zip("XYZABC", Convention(KUKA).numbers(pose, np.zeros(6)), strict=True)
    text = ",".join(f"{key} {value:.6f}" for key, value in values)
    return f"{{{text},S 2,T {turn}{more}}}"


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (f"LIN {_pose(10)}", "posture"),  # a turn that axis 4 does not have
        ("LIN {X 9000,Y 0,Z 500,A 0,B 90,C 0,S 2,T 2}", "cannot reach"),
        ("$IPO_MODE=#TCP\nLIN {X 500,Y 0,Z 500,A 0,B 90,C 0,S 2,T 2}", "stands still"),
        (f"LIN {_pose(2, more=',E1 0')}\nLIN {_pose(2, more=',E1 900')}", "external axis"),
        ("PTP {A1 20, A2 -80, A3 100, A4 0.0001, A5 40, A6 400}", "limits"),
    ],
)
def test_positions_that_cannot_be_corrected_are_named(tmp_path, line, reason):
    path = _kuka(tmp_path, f"PTP {HOME}", line)
    found = compensate_program(calibrated(KR6, "dh"), path)
    assert found.refused
    assert all(reason in each.what for each in found.refused)
    with pytest.raises(InputError, match=r"own\.src:"):
        found.write(tmp_path / "out.src")
    assert not (tmp_path / "out.src").exists()


def test_a_turn_that_the_correction_would_change_is_refused(tmp_path):
    """Axis 4 within the correction of zero: its turn bit would change for some of these."""
    lines = [f"LIN {_pose(2 + (a1 < 0), a1, 1e-3)}" for a1 in range(-40, 50, 10)]
    lines.append(f"LIN {_pose(2, a4=-0.01)}")  # rounding may have moved it across
    found = compensate_program(calibrated(KR6, "dh"), _kuka(tmp_path, *lines))
    assert found.refused
    assert all("would change to A4" in each.what for each in found.refused)


def test_changes_beyond_a_limit_are_refused():
    found = corrected("weld.mod", at_most_mm=0.1)
    assert any("--at-most-mm" in each.what for each in found.refused)


@pytest.mark.parametrize("orientation", [KUKA, FIXED, INTRINSIC, QUATERNION, VECTOR])
def test_frames_come_back_from_their_numbers(orientation):
    convention, rng = Convention(orientation), np.random.default_rng(1)
    turns = [exp_so3(rng.normal(size=3)) for _ in range(20)]
    turns += [Convention(KUKA).pose([0, 0, 0, 20, b, 30]).rotation for b in (90, -90)]
    turns += [Convention(INTRINSIC).pose([0, 0, 0, 20, b, 30]).rotation for b in (90, -90)]
    with pytest.raises(InputError, match=r"length 1\.414|6, mm and deg"):
        convention.typed([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0])
    for turn in turns:
        near = rng.uniform(-180.0, 180.0, 7 if orientation == QUATERNION else 6)
        numbers = convention.numbers(Pose(turn, np.ones(3)), near)
        np.testing.assert_allclose(convention.pose(numbers).rotation, turn, atol=2e-8)


@pytest.mark.parametrize(
    ("old", "value", "new"),
    [
        ("1.500", 1.49999, "1.500"), ("1.5", 2.25, "2.2500"), ("-.515", -0.25, "-.2500"),
        ("+2", 3.0, "+3.0000"), ("1.5E-05", 0.001, "0.0010"), ("0,5", 0.75, "0,7500"),
        ("0.01", -0.00001, "0.0000"), ("7", 7.0, "7"),
    ],
)  # fmt: skip
def test_numbers_keep_their_form(old, value, new):
    assert _written(old, value, 4) == new


def _read(tmp_path, name, text, **files):
    for file, content in {name: text, **files}.items():
        (tmp_path / file).write_text(content)
    return read_program(tmp_path / name, (), np.ones(6))[1]


def test_frames_that_a_program_changes_are_refused(tmp_path):
    target = "[[9,0,9],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
    program = _read(tmp_path, "own.mod", f"""
      PERS wobjdata w:=[FALSE,TRUE,"",[[1,0,8],[0,0,1,0]],[[0,0,0],[1,0,0,0]]];
      PERS wobjdata part:=[TRUE,TRUE,"",[[1,0,8],[0,0,1,0]],[[0,0,0],[1,0,0,0]]];
      PERS tooldata torch:=[FALSE,[[0,0,0],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
      CONST robtarget twice:={target};
      w.uframe.trans:=p;
      MoveL {target},v50,fine,tool0\\WObj:=w;
      MoveL {target},v50,fine,tool0\\WObj:=part;
      MoveL {target},v50,fine,torch;
      MoveL {target.replace("9E9]", "900]")},v50,fine,tool0;
      MoveL twice,v50,fine,tool0;
      MoveL twice,v50,fine,tool0\\WObj:=wobj1;""")  # fmt: skip
    refused = [CHANGED, STILL, STILL, "", SEVERAL]
    assert [each.refused for each in program.positions] == refused
    assert [each.moves_outside for each in program.positions] == [False] * 3 + [True, False]
    frame = "{X 1,Y 2,Z 3,A 0,B 0,C 0}"
    program = _read(
        tmp_path,
        "own.src",
        f"""BASE_DATA[2]={frame}
BAS(#TOOL,0)\nBAS(#BASE,2)\nLIN {frame}
BASE_DATA[2].z=BASE_DATA[2].z+155\nBAS(#BASE,0)\nLIN {frame}""",
    )
    assert [bool(each.refused) for each in program.positions] == [True, False]


def test_columns_and_turns_are_read_where_and_as_they_are_written(tmp_path):
    text = "note,note,x,y,z,a,b,c\nu,v,1,2,3,4,5,6"
    (position,) = _read(tmp_path, "own.csv", text).positions
    assert position.numbers.tolist() == [1, 2, 3, 4, 5, 6]
    text = "x_m,y_m,z_m,rvx_rad,rvy_rad,rvz_rad\n0.001,0.002,0.003,0.1,0.2,0.3"
    program = _read(tmp_path, "own.csv", text)
    pose = program.convention.pose(program.positions[0].numbers)
    np.testing.assert_allclose(pose.position_mm, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(pose.rotation, exp_so3(np.array([0.1, 0.2, 0.3])))
    (position,) = _read(tmp_path, "own.csv", "q1_rad,q2_deg\n0.5,3").positions
    np.testing.assert_allclose(position.scale, [np.pi / 180.0, 1.0])
    frame = "{X 1,Y 2,Z 3,A 0,B 0,C 0,S 'B010',T 'H1B'}"
    (position,) = _read(tmp_path, "own.src", f"LIN {frame}").positions
    set_bits = [part for part in position.posture if part.endswith(("up", "negative"))]
    assert set_bits == ["elbow up", *(f"A{axis} negative" for axis in (1, 2, 4, 5))]


def test_positions_are_in_the_order_of_the_moves(tmp_path):
    """Where none states a posture each starts from the one before."""
    place = "{X 500,Y 0,Z 600,A 0,B 90,C 0}"
    data = {"own.dat": f"DECL POS XP2={place}\nDECL POS XP1={place}\n"}
    program = _read(tmp_path, "own.src", f"PTP {HOME}\nLIN XP1\nCIRC XP2, {place}", **data)
    assert [each.name for each in program.positions] == ["line 1", "XP1", "XP2", "line 3"]


def test_poses_that_no_move_uses_are_left_alone(tmp_path):
    text = (PROGRAMS / "weld.mod").read_text()
    stale = "CONST robtarget stale:=[[500,0,600],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];"
    text = text.replace("CONST robtarget", f"{stale}\n  CONST robtarget", 1)
    (tmp_path / "weld.mod").write_text(text)
    found = corrected("weld.mod", folder=tmp_path)
    assert not found.refused
    assert "stale" in found.not_corrected[-1]
    assert stale.encode() in found.files[tmp_path / "weld.mod"]


def test_shifts_of_a_job_are_no_positions(tmp_path):
    program = _read(tmp_path, "own.jbi", """///TOOL 0\n///POSTYPE BASE\n///RECTAN
P0000=0.5,-151,-1,0,0,0\nP00100=275.0,0,875,180,45,0\nP00101=5,0,0,0,0,0\n//INST
MOVJ P100 VJ=10.00\nMOVJ P101 VJ=10.00\nSFTON P000\nSFTON P101""")  # fmt: skip
    assert [each.name for each in program.positions] == ["P00100"]


def test_positions_that_were_not_taught_in_full_are_listed(tmp_path):
    frame = "X = 1 mm, Y = ******** mm, Z = 3 mm, W = 0 deg, P = 0 deg, R = 0 deg"
    joints = ", ".join(f"J{axis} = {axis} deg" for axis in range(1, 7))
    program = _read(
        tmp_path, "own.ls", f"/POS\nP[1]{{\n GP1: {frame}\n}};\nP[2]{{\n GP1: {joints}\n}};"
    )
    assert [each.name for each in program.positions] == ["P[2]"]
    assert program.not_corrected == ["own.ls:2: P[1]"]


def test_waypoints_of_polyscope_start_from_their_joints(tmp_path):
    program = _read(tmp_path, "own.script", """  global A_p=p[-.12,-.43,.14,0,3.11,.04]
  global A_q=[0.98, -1.29, 2.28, -2.52, -1.55, -0.57]
  movej(get_inverse_kin(A_p, qnear=A_q), a=1.39, v=1.04)
  movel(A_p, 1.2, 0.1)""")  # fmt: skip
    (position,) = program.positions
    assert (position.name, position.near_rad[1]) == ("A_p", -1.29)


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        (
            "weld.src",
            "$TOOL = {X 0, Y 0, Z 100, A 0, B 0, C 0}\nDECL E6POS XP[2]\n"
            "XP[1] = {X 500, Y 0, Z 600, A 0, B 90, C 0}\nPTP HOME\nLIN XP1 C_DIS\nLIN XP[I]\n"
            "CIRC {X 500, Y 0, Z 600, A 0, B 90, C 0},{X 500, Y 0, Z 600, A 0, B 90, C 0}, CA 90\n",
            [4, 5],
        ),
        (
            "weld.src",
            "$TOOL=$NULLFRAME\nPTP {A1 0, A2 -90, A3 90, A4 0, A5 0, A6 0}\nF_ABOVE=F_PICK:{X 0, "
            "Y 0, Z -100, A 0, B 0, C 0}\n$BASE=BASE_DATA[1]:F_PICK\n",
            [3],
        ),
        (
            "weld.src",
            "$TOOL=$NULLFRAME\nLIN {X 500,Y 0,Z 600,A 0,B 90,C 0,S 2,T TURN}\n"
            "DECL POS XP={X 500,Y 0,Z 600,A 0,B 90,C 0,S STATUS,T 2}\nLIN XP\n",
            [2, 4],
        ),
        (
            "weld.mod",
            "CONST robtarget p1:=[[500,0,600],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n"
            "PROC main()\nMoveL p1,v100,z10,tool0;\nIF p2_ok THEN\n p1:=p2;\nELSE\n MoveL "
            "p2,v9,z10,tool0;\nENDIF\nmove_ok:=FALSE;\nENDPROC\n",
            [5, 7],
        ),
        (
            "weld.mod",
            "CONST robtarget p1:=[[500,0,600],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n"
            "MoveL p1,v100,z10,tool0;\nMoveL p9,v100,z10,tool0;\n",
            [3],
        ),
    ],
)
def test_moves_to_positions_that_are_not_there_are_listed(name, text, expected):
    language = kuka if name.endswith(".src") else abb
    found = language.read([Source(Path(name), text)], None)
    assert sorted(int(line.split(":")[1]) for line in found.not_corrected) == expected
    assert all(each.tool is not None for each in found.positions if each.scale is None)


def test_postures_near_singularities_are_flagged(tmp_path):
    arm, rng = robot.load("irb120"), np.random.default_rng(1)
    q = rng.uniform(0.9 * arm.q_min_rad, 0.9 * arm.q_max_rad, (60, 6))
    pd.DataFrame(np.rad2deg(q).round(3), columns=Q_DEG).to_csv(tmp_path / "joints.csv", index=False)
    flagged = corrected("joints.csv", tmp_path).table["is_near_singular"].to_numpy(bool)
    table, step = arm.dh.start.reshape(6, 5), 1e-6
    reach_mm = np.abs(table[:, 1:3]).sum()
    start = of_matrices(dh_forward(table, q))
    moved = [of_matrices(dh_forward(table, q + step * axis)) for axis in np.eye(6)]
    slopes = np.stack([movement(start, each) for each in moved], axis=2) / step
    slopes[:, :3] /= reach_mm
    smallest = np.linalg.svd(slopes, compute_uv=False)[:, -1]
    clear = np.abs(np.log(smallest / 0.02)) > 0.1
    assert clear.sum() > 50
    np.testing.assert_array_equal(flagged[clear], smallest[clear] < 0.02)
    assert 5 < flagged.sum() < 40


def test_turns_of_a_yaskawa_posture_are_those_of_r_t_and_s():
    usual = yaskawa.posture((True, True, False), np.zeros(6))
    for axis, places in ((3, {0, 3}), (5, {4}), (0, {5})):  # R beyond 90 degrees also flips
        other = yaskawa.posture((True, True, False), 200.0 * (np.arange(6) == axis))
        assert {place for place in range(6) if usual[place] != other[place]} == places

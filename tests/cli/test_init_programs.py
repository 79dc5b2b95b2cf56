"""Robots' own programs and records beside a tracker's file: their joints, never their targets."""

import numpy as np
import pytest
from tracked_arm import assert_read, described, refused, table, tracked, written

from kinacc.config.schema import defaults

IT = tracked()
COUNT = len(IT.q)
NAMES = [f"P{row + 1}" for row in range(COUNT)]
POINTS = table(["Point", "X [mm]", "Y [mm]", "Z [mm]"], NAMES, IT.point)


def listed(values, mark=","):
    return mark.join(f"{value:.4f}" for value in values)


def abb(kind="jointtarget"):
    spare = ",".join(["9E+09"] * 6)
    rows = [
        f"  CONST jointtarget {name}:=[[{listed(q)}],[{spare}]];"
        if kind == "jointtarget"
        else f"  CONST robtarget {name}:=[[{listed(x)}],[1,0,0,0],[0,0,0,0],[{spare}]];"
        for name, q, x in zip(NAMES, IT.q, IT.controller, strict=True)
    ]
    return "MODULE Poses\n" + "\n".join(rows) + "\nENDMODULE\n"


def kuka():
    rows = []
    for name, q in zip(NAMES, IT.q, strict=True):
        axes = ",".join(f"A{n} {value:.4f}" for n, value in enumerate(q, 1))
        rows.append(f"DECL E6AXIS X{name}={{{axes},E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}}")
        rows.append(f"DECL FDAT F{name}={{TOOL_NO 1,BASE_NO 0,IPO_FRAME #BASE}}")
    return "DEFDAT POSES\n" + "\n".join(rows) + "\nENDDAT\n"


def fanuc(rows=None, joints=IT.q):
    lines = []
    for number, q in enumerate(joints, 1):
        axes = [f"J{n}=  {value:.4f} deg" for n, value in enumerate(q, 1)]
        lines.append(f"P[{number}]{{\n   GP1:\n\tUF : 0, UT : 1,\t")
        lines.append(f"\t{', '.join(axes[:3])},\n\t{', '.join(axes[3:])}\n}};")
    return "/PROG POSES\n/MN\n   1:J P[1] 10% FINE ;\n/POS\n" + "\n".join(lines) + "\n/END\n"


def yaskawa():
    rows = [f"C{n:05d}=" + ",".join(f"{v:.0f}" for v in 1000.0 * q) for n, q in enumerate(IT.q, 1)]
    head = (
        "/JOB\n//NAME POSES\n//POS\n///NPOS 16,0,0,0,0,0\n///TOOL 0\n///POSTYPE PULSE\n///PULSE\n"
    )
    return head + "\n".join(rows) + "\n//INST\nNOP\nEND\n"


@pytest.mark.parametrize(
    ("text", "suffix"), [(abb(), "mod"), (kuka(), "dat"), (fanuc(), "ls"), (kuka(), "txt")]
)
def test_joints_of_a_program_go_beside_the_points_of_a_tracker(text, suffix, tmp_path):
    files = written(tmp_path, **{f"poses_{suffix}": text, "tracker_csv": POINTS})
    section, told = described(files)
    assert_read(section, IT)
    assert "16 of 16 points have joints" in " ".join(told["told"])


def test_the_pulses_of_a_job_need_their_number_per_degree(tmp_path):
    points = POINTS.replace("\nP", "\nC")
    files = written(tmp_path, poses_jbi=yaskawa(), tracker_csv=points)
    assert "--pulses-per-deg" in refused(files)
    section, _ = described(files, "--pulses-per-deg", ",".join(["1000"] * 6))
    arm = type(IT)(IT.name, np.round(IT.q * 1000.0) / 1000.0, IT.point, IT.turn, IT.controller)
    assert_read(section, arm)


def test_targets_of_a_program_are_no_measurement(tmp_path):
    files = written(tmp_path, poses_mod=abb("robtarget"), tracker_csv=POINTS)
    assert "jointtarget" in refused(files[:1])


def test_a_fanuc_program_tells_how_its_third_joint_counts(tmp_path):
    arm = tracked("fanuc_r2000ic_165f")
    points = table(["Point", "X [mm]", "Y [mm]", "Z [mm]"], NAMES, arm.point)
    files = written(tmp_path, poses_ls=fanuc(joints=arm.q), tracker_csv=points)
    section, told = described(files, robot="fanuc_r2000ic_165f")
    assert_read(section, arm)
    assert "J3 plus J2" in " ".join(told["told"])
    assert told["suspicions"] in ([], ["few_poses"])


def test_joints_within_one_cell_are_read(tmp_path):
    cells = [
        "{E6AXIS: " + ", ".join(f"A{n} {v:.4f}" for n, v in enumerate(q, 1)) + ", E1 0.0}"
        for q in IT.q
    ]
    names = ["Point", "Joints", "X [mm]", "Y [mm]", "Z [mm]"]
    section, _ = described(written(tmp_path, m_csv=table(names, NAMES, cells, IT.point, mark=";")))
    assert_read(section, IT)


def test_an_abb_target_in_one_cell_is_read_by_a_data_set(tmp_path):
    cells = [f"[[{listed(q)}],[9E9,9E9,9E9,9E9,9E9,9E9]]" for q in IT.q]
    names = ["Joints", "x_mm", "y_mm", "z_mm"]
    files = written(tmp_path, m_csv=table(names, cells, IT.point, mark=";"))
    own = {f"q{n}": f"Joints rax_{n}" for n in range(1, 7)}
    section = defaults()["measurements"]["file"] | {"path": str(files[0]), "delimiter": ";"}
    section |= {"columns": own, "orientation": section["orientation"] | {"kind": "none"}}
    assert_read(section, IT)


def braces(word):
    """Lines of a log without names: P1 {E6AXIS: A1 ..} MEASURED {POS: X .., Y .., Z ..}."""
    for name, q, x in zip(NAMES, IT.q, IT.point, strict=True):
        axes = ", ".join(f"A{n} {value:.4f}" for n, value in enumerate(q, 1))
        place = ", ".join(f"{axis} {value:.4f}" for axis, value in zip("XYZ", x, strict=True))
        yield f"{name} {{E6AXIS: {axes}, E1 0.0}} {word}{{POS: {place}}}\n"


def test_a_log_whose_cells_name_their_parts_needs_no_line_of_names(tmp_path):
    section, _ = described(written(tmp_path, log_txt="".join(braces("MEASURED "))))
    assert_read(section, IT)


def test_a_frame_in_braces_that_nobody_calls_measured_is_asked_about(tmp_path):
    said = refused(written(tmp_path, log_txt="".join(braces(""))))
    assert "--take" in said

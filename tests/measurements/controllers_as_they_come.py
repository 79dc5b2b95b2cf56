"""What the controllers of UR, FANUC, ABB, KUKA and Yaskawa write, with the tracker's part.

Each function writes one or two files into a folder and returns what is true of them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from measurements.measured_file import (
    Measured,
    beside,
    cells,
    column,
    euler,
    joined,
    kr10_description,
    quaternions,
    save,
    truth,
)
from measurements.simulated_arms import ARMS, Campaign, campaign, flange, nominal_rows
from measurements.tables_as_they_come import FANUC, NUMBERS, one_point
from scipy.spatial.transform import Rotation

PULSES_PER_DEGREE = np.array([1344.7, 1341.4, 1341.4, 1019.6, 980.3, 454.1])
UNUSED = "9E+09"


def point_list(path: Path, labels: list[str], points: np.ndarray, names: str) -> Path:
    """The tracker's own file: a name and three coordinates."""
    rows = joined(beside(column(labels), cells(points, 3)), ",")
    return save(path, [names, *rows])


def rtde_names() -> list[str]:
    """Columns of a recording: time, commanded and actual joints, the controller's tool pose."""
    names = ["timestamp"]
    names += [f"target_q_{i}" for i in range(6)] + [f"actual_q_{i}" for i in range(6)]
    return names + [f"actual_TCP_pose_{i}" for i in range(6)]


def tool_poses(joints_rad: np.ndarray) -> np.ndarray:
    """The controller's forward kinematics: position in m and rotation vector, (n, 6)."""
    turned, moved = flange(nominal_rows(ARMS["ur10"]), joints_rad)
    tip = moved + turned @ np.array([0.0, 0.0, 120.0])
    return np.hstack([tip / 1000, Rotation.from_matrix(turned).as_rotvec()])


def rtde_joints() -> tuple[Campaign, np.ndarray, np.ndarray]:
    """The campaign with its joints in rad as commanded and as read back, a little apart."""
    done = campaign("ur10", 6)
    actual = np.radians(done.joints_deg).round(9)
    apart = np.random.default_rng(21).normal(scale=3e-5, size=actual.shape)
    return done, (actual + apart).round(9), actual


def rtde_with_measured_point(folder: Path) -> Measured:
    """A recording with one line per pose, the tracker's point pasted to its right."""
    done, target, actual = rtde_joints()
    points = done.points_mm[0].round(4)
    names = [*rtde_names(), "tracker_x_mm", "tracker_y_mm", "tracker_z_mm"]
    rows = beside(
        cells(100 + 8.0 * np.arange(40)[:, None], 3),
        cells(np.hstack([target, actual, tool_poses(actual)]), 9),
        cells(points, 4),
    )
    path = save(folder / "rtde_tracker.csv", joined([names, *rows], ","))
    return truth(path, "ur10", np.degrees(actual), points)


def rtde_recording_alone(folder: Path) -> Measured:
    """A recording only: the tool pose is computed by the controller and measures nothing."""
    _, target, actual = rtde_joints()
    rows = beside(
        cells(100 + 8.0 * np.arange(40)[:, None], 3),
        cells(np.hstack([target, actual, tool_poses(actual)]), 9),
    )
    path = save(folder / "robot_data.csv", joined([rtde_names(), *rows], " "))
    asked = frozenset({"measurement"})
    return truth(path, "ur10", np.degrees(actual), {}, questions=asked, readable=False)


def script_lists(folder: Path) -> Measured:
    """Lists as a program prints them: joints in rad, the controller's pose; then the point."""
    done, _, actual = rtde_joints()
    points = done.points_mm[0].round(4)
    lines = ["point;get_actual_joint_positions;get_actual_tcp_pose;x_mm;y_mm;z_mm"]
    for i, pose in enumerate(tool_poses(actual)):
        joints = ", ".join(f"{value:.9f}" for value in actual[i])
        own = ", ".join(f"{value:.6f}" for value in pose)
        lines.append(";".join([f"P{i + 1}", f"[{joints}]", f"p[{own}]", *cells(points[[i]], 4)[0]]))
    return truth(save(folder / "textmsg.log", lines), "ur10", np.degrees(actual), points)


def pendant_poses_as_measured(folder: Path) -> Measured:
    """Positions copied from the pendant: the controller's own kinematics under innocent names."""
    done = campaign("ur10", 6)
    tip = (tool_poses(np.radians(done.joints_deg))[:, :3] * 1000).round(2)
    names = ["Pose", *(f"Joint {i} (deg)" for i in range(1, 7)), "X (mm)", "Y (mm)", "Z (mm)"]
    rows = beside(column(NUMBERS), cells(done.joints_deg, 6), cells(tip, 2))
    path = save(folder / "poses.csv", joined([names, *rows], ","))
    said = r"own (forward )?kinematics|nominal arm|computed|not (a )?measure"
    asked = frozenset({"measurement"})
    return truth(path, "ur10", done.joints_deg, tip, questions=asked, readable=False, says=said)


def rtde_recording_and_tracker(folder: Path) -> Measured:
    """A recording at 8 Hz through motion and rest, a tracker whose clock is 37.4 s ahead."""
    done, target, actual = rtde_joints()
    points = done.points_mm[0].round(4)
    moments, commanded, reached, stamps = [], [], [], []
    now = 512.0
    for pose in range(40):
        rest = 20 + pose % 7
        share = np.concatenate([np.linspace(0, 1, 12, endpoint=False), np.ones(rest)])[:, None]
        before = max(pose - 1, 0)
        commanded.append(target[before] + share * (target[pose] - target[before]))
        reached.append(actual[before] + share * (actual[pose] - actual[before]))
        moments.append(now + 0.125 * np.arange(len(share)))
        stamps.append(now + 0.125 * 12 + 1.0 + 37.4)
        now = moments[-1][-1] + 0.125
    read = np.concatenate(reached)
    rows = beside(
        cells(np.concatenate(moments)[:, None], 3),
        cells(np.hstack([np.concatenate(commanded), read, tool_poses(read)]), 9),
    )
    seen = beside(cells(np.array(stamps)[:, None], 3), cells(points, 4))
    files = (
        save(folder / "robot_data.csv", joined([rtde_names(), *rows], " ")),
        save(
            folder / "tracker.csv",
            joined([["time_s", "x_mm", "y_mm", "z_mm"], *seen], ","),
        ),
    )
    asked = frozenset({"clock"})
    return truth(files, "ur10", np.degrees(actual), points, questions=asked)


def fanuc_program(folder: Path) -> Measured:
    """A program of joint positions, a track as second group; joint 3 against the horizontal."""
    joints, points = one_point("fanuc")
    lines = ["/PROG  CALIB01", "/ATTR", "OWNER\t\t= MNEDITOR;", 'COMMENT\t\t= "tracker";']
    lines += ["DEFAULT_GROUP\t= 1,*,*,*,*;", "/APPL", "/MN"]
    lines += [f"  {i:2d}:J P[{i}] 20% FINE    ;" for i in NUMBERS]
    lines.append("/POS")
    for number, row in enumerate(joints, 1):
        first, last = (
            ",\t".join(f"J{i + 1}= {row[i]:9.3f} deg" for i in axes)
            for axes in (range(3), range(3, 6))
        )
        lines += [
            f"P[{number}]{{",
            "   GP1:",
            "\tUF : 0, UT : 1,\t",
            f"\t{first},",
            f"\t{last}",
            "   GP2:",
            "\tUF : 0, UT : 1,\t",
            "\tJ1=     0.000  mm",
            "};",
        ]
    labels = [f"P{i}" for i in NUMBERS]
    files = (
        save(folder / "CALIB01.LS", [*lines, "/END"], newline="\r\n"),
        point_list(folder / "tracker.csv", labels, points, "Point,X (mm),Y (mm),Z (mm)"),
    )
    return truth(files, FANUC, joints, points)


def fanuc_cartesian_program(folder: Path) -> Measured:
    """The same program with X, Y, Z, W, P, R: no joints, and the posture in words only."""
    done = campaign("fanuc")
    lines = ["/PROG  CALIB02", "/MN", "/POS"]
    angles, _ = euler(done.nominal_rotations, "xyz", 3)
    for number, (place, turn) in enumerate(zip(done.nominal_mm, angles, strict=True), 1):
        xyz = ",\t".join(f"{a} = {value:9.3f}  mm" for a, value in zip("XYZ", place, strict=True))
        wpr = ",\t".join(f"{a} = {value:9.3f} deg" for a, value in zip("WPR", turn, strict=True))
        head = "\tUF : 0, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',"
        lines += [f"P[{number}]{{", "   GP1:", head, f"\t{xyz},", f"\t{wpr}", "};"]
    path = save(folder / "CALIB02.LS", [*lines, "/END"])
    asked = frozenset({"joints", "measurement"})
    return truth(path, FANUC, done.joints_deg, {}, questions=asked, readable=False)


def fanuc_log_wpr(folder: Path) -> Measured:
    """J1 to J6 as the controller reports them, the probe's frame as X Y Z W P R."""
    done = campaign("fanuc")
    points = done.points_mm[0].round(3)
    angles, rotations = euler(done.rotations, "xyz", 4)
    rows = beside(column(NUMBERS), cells(done.joints_deg, 3), cells(points, 3), cells(angles, 4))
    names = ["No", *(f"J{i}" for i in range(1, 7)), *"XYZWPR"]
    path = save(folder / "poslog.txt", joined([names, *rows], "\t"))
    return truth(path, FANUC, done.joints_deg, points, rotations=rotations)


def abb_targets(joints: np.ndarray) -> list[str]:
    """Joint targets as a module writes them."""
    outside = ",".join(["9E9"] * 6)
    return [
        f"  CONST jointtarget jP{i}:=[[{','.join(f'{v:.3f}' for v in row)}],[{outside}]];"
        for i, row in enumerate(joints, 1)
    ]


def abb_module(folder: Path) -> Measured:
    """A module of joint targets jP1, jP2 .., the tracker's points named as the targets are."""
    joints, points = one_point("irb120")
    lines = ["MODULE CalibPoses", "  ! written by the cell's programmer"]
    lines += [*abb_targets(joints), "  PROC main()"]
    lines += [f"    MoveAbsJ jP{i},v100,fine,tool0;" for i in NUMBERS]
    labels = [f"jP{i}" for i in NUMBERS]
    files = (
        save(folder / "CalibPoses.mod", [*lines, "  ENDPROC", "ENDMODULE"], newline="\r\n"),
        point_list(folder / "tracker.csv", labels, points, "Name,X [mm],Y [mm],Z [mm]"),
    )
    return truth(files, "irb120", joints, points)


def abb_module_with_robtargets(folder: Path) -> Measured:
    """Joint targets and, beside each, the controller's own pose as a robtarget."""
    done = campaign("irb120")
    points = done.points_mm[0].round(3)
    turns, _ = quaternions(done.nominal_rotations, 6)
    lines = ["MODULE Logged"]
    for number, target in enumerate(abb_targets(done.joints_deg)):
        place = ",".join(f"{value:.2f}" for value in done.nominal_mm[number])
        turn = ",".join(f"{value:.6f}" for value in turns[number])
        lines.append(target)
        lines.append(
            f"  CONST robtarget pP{number + 1}:=[[{place}],[{turn}],[0,0,0,0],"
            "[9E9,9E9,9E9,9E9,9E9,9E9]];"
        )
    labels = [f"P{i}" for i in NUMBERS]
    files = (
        save(folder / "Logged.mod", [*lines, "ENDMODULE"]),
        point_list(folder / "points.csv", labels, points, "Point,X (mm),Y (mm),Z (mm)"),
    )
    return truth(files, "irb120", done.joints_deg, points)


def abb_log_rax(folder: Path) -> Measured:
    """rax_1 to rax_6, unused outer axes at 9E+09, a measured frame with the quaternion q1 .. q4."""
    done = campaign("irb120")
    points = done.points_mm[0].round(3)
    written, rotations = quaternions(done.rotations, 8)
    names = ["index", *(f"rax_{i}" for i in range(1, 7)), *(f"eax_{a}" for a in "abcdef")]
    names += ["meas_x", "meas_y", "meas_z", *(f"meas_q{i}" for i in range(1, 5))]
    rows = beside(
        column(NUMBERS),
        cells(done.joints_deg, 3),
        [[UNUSED] * 6] * 40,
        cells(points, 3),
        cells(written, 8),
    )
    path = save(folder / "abb_log.csv", joined([names, *rows], ","))
    asked = frozenset({"quaternion order"})
    return truth(path, "irb120", done.joints_deg, points, rotations=rotations, questions=asked)


def abb_log_of_brackets(folder: Path) -> Measured:
    """One jointtarget and one measured frame in brackets per line, as RAPID writes them as text."""
    done = campaign("irb120")
    points = done.points_mm[0].round(3)
    written, rotations = quaternions(done.rotations, 8)
    lines = ["Name;jointtarget;measured robtarget"]
    outside = ",".join([UNUSED] * 6)
    for i in range(40):
        axes = ",".join(cells(done.joints_deg[[i]], 3)[0])
        place, turn = ",".join(cells(points[[i]], 3)[0]), ",".join(cells(written[[i]], 8)[0])
        lines.append(f"P{i + 1};[[{axes}],[{outside}]];[[{place}],[{turn}],[0,-1,0,0],[{outside}]]")
    path = save(folder / "rapid_log.txt", lines)
    return truth(path, "irb120", done.joints_deg, points, rotations=rotations)


def kuka_data_list(folder: Path) -> Measured:
    """A .dat file of E6AXIS constants XP1, XP2 .. and the tracker's points P1, P2 .."""
    joints, points = one_point("kr10")
    lines = ["&ACCESS RVP", "&REL 4", "DEFDAT CALIB", "EXT BAS (BAS_COMMAND :IN,REAL :IN )"]
    for number, row in enumerate(joints, 1):
        axes = ",".join(f"A{i + 1} {value:.3f}" for i, value in enumerate(row))
        outer = ",".join(f"E{i} 0.0" for i in range(1, 7))
        lines.append(f"DECL E6AXIS XP{number}={{{axes},{outer}}}")
        lines.append(f'DECL FDAT FP{number}={{TOOL_NO 1,BASE_NO 0,IPO_FRAME #BASE,POINT2[] " "}}')
    labels = [f"P{i}" for i in NUMBERS]
    files = (
        save(folder / "calib.dat", [*lines, "ENDDAT"], newline="\r\n"),
        point_list(folder / "leica.csv", labels, points, "Point,X [mm],Y [mm],Z [mm]"),
    )
    return truth(files, kr10_description(folder), joints, points)


def kuka_log_abc(folder: Path) -> Measured:
    """A1 to A6 and a measured frame X Y Z A B C: A about z, B about y, C about x."""
    done = campaign("kr10")
    points = done.points_mm[0].round(3)
    angles, rotations = euler(done.rotations, "ZYX", 4)
    names = ["Nr", *(f"A{i}" for i in range(1, 7)), *"XYZABC"]
    rows = beside(column(NUMBERS), cells(done.joints_deg, 3), cells(points, 3), cells(angles, 4))
    path = save(folder / "messung_kuka.csv", joined([names, *rows], ";"))
    robot = kr10_description(folder)
    return truth(path, robot, done.joints_deg, points, rotations=rotations)


def kuka_braces(folder: Path) -> Measured:
    """A log written by the program: axes and the measured point in braces, E1 to E6 unused."""
    joints, points = one_point("kr10")
    lines = []
    for number in range(40):
        axes = ", ".join(f"A{i + 1} {value:.3f}" for i, value in enumerate(joints[number]))
        place = ", ".join(f"{a} {v:.3f}" for a, v in zip("XYZ", points[number], strict=True))
        outer = ", ".join(f"E{i} 0.0" for i in range(1, 7))
        lines.append(f"P{number + 1} {{E6AXIS: {axes}, {outer}}} MEASURED {{POS: {place}}}")
    path = save(folder / "log.txt", lines)
    return truth(path, kr10_description(folder), joints, points)


def yaskawa_counts() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pulses, the joints in deg these stand for, and the measured point."""
    done = campaign("mh180", 6)
    pulses = (done.joints_deg * PULSES_PER_DEGREE).round()
    return pulses, pulses / PULSES_PER_DEGREE, done.points_mm[0].round(3)


def yaskawa_pulses(folder: Path) -> Measured:
    """Axes in pulses: what a pulse is worth stands in the controller, not in the file."""
    pulses, joints, points = yaskawa_counts()
    names = ["No", *(f"{axis} [pulse]" for axis in "SLURBT"), "X [mm]", "Y [mm]", "Z [mm]"]
    rows = beside(column(NUMBERS), cells(pulses, 0), cells(points, 3))
    path = save(folder / "pulses.csv", joined([names, *rows], ","))
    asked = frozenset({"pulses"})
    return truth(path, "mh180", joints, points, questions=asked, must_ask=asked)


def yaskawa_job(folder: Path) -> Measured:
    """A job of pulse positions C00000 .. and the tracker's points in the same order and names."""
    pulses, joints, points = yaskawa_counts()
    labels = [f"C{i:05d}" for i in range(40)]
    lines = ["/JOB", "//NAME CALIB", "//POS", "///NPOS 40,0,0,0,0,0", "///TOOL 1"]
    lines += ["///POSTYPE PULSE", "///PULSE"]
    for label, row in zip(labels, pulses, strict=True):
        lines.append(f"{label}=" + ",".join(f"{value:.0f}" for value in row))
    lines += ["//INST", "///DATE 2024/05/01 10:11", "///ATTR SC,RW", "///GROUP1 RB1", "NOP"]
    lines += [f"MOVJ {label} VJ=10.00" for label in labels]
    files = (
        save(folder / "CALIB.JBI", [*lines, "END"], newline="\r\n"),
        point_list(folder / "tracker.csv", labels, points, "Point,X (mm),Y (mm),Z (mm)"),
    )
    asked = frozenset({"pulses"})
    return truth(files, "mh180", joints, points, questions=asked, must_ask=asked)

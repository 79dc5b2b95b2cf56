"""What the software of trackers and measuring arms writes, beside or together with joints.

Each function writes one or two files into a folder and returns what is true of them.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from measurements.measured_file import (
    Measured,
    beside,
    cells,
    column,
    comma,
    joined,
    kr10_description,
    save,
    truth,
)
from measurements.simulated_arms import campaign, repeated
from measurements.tables_as_they_come import FANUC, NUMBERS, one_point

AXES = "XYZ"


def joint_list(path: Path, labels: list[str], joints: np.ndarray, key: str = "Point") -> Path:
    """A list of joints under the names of the measured points."""
    names = [key, *(f"J{i} (deg)" for i in range(1, 7))]
    return save(path, joined([names, *beside(column(labels), cells(joints, 3))], ","))


def text_order(labels: list[str]) -> list[int]:
    """Rows in the order in which software sorts names as text: P1, P10, P11, P2."""
    return sorted(range(len(labels)), key=labels.__getitem__)


def spatial_analyzer_text(folder: Path) -> Measured:
    """No line of names; collection, group and point sorted as text; frame and unit in comments."""
    joints, points = one_point("fanuc_uncoupled", 4)
    labels = [f"P{i}" for i in NUMBERS]
    lines = [
        "// SpatialAnalyzer",
        "// Working Frame: Cell 3::Tracker base",
        "// Units: Millimeters, Degrees",
        "",
    ]
    xyz = cells(points, 4)
    for row in text_order(labels):
        lines.append(", ".join(["Cell 3", "Calibration", labels[row], *xyz[row]]))
    files = (
        joint_list(folder / "joints.csv", labels, joints),
        save(folder / "points.txt", lines, newline="\r\n"),
    )
    return truth(files, FANUC, joints, points)


def spatial_analyzer_uncertainties(folder: Path) -> Measured:
    """X,Y,Z,Ux,Uy,Uz: nobody says whether U is one or two standard deviations."""
    joints, points = one_point("fanuc_uncoupled", 4)
    labels = [f"P{i}" for i in NUMBERS]
    spread = np.random.default_rng(3).uniform(0.012, 0.06, points.shape).round(4)
    rows = beside(column(labels), cells(points, 4), cells(spread, 4))
    lines = ["// Frame: A::World", "// Units: mm"]
    lines += joined([["Point", *AXES, "Ux", "Uy", "Uz"], *rows], ",")
    files = (
        joint_list(folder / "robot.csv", labels, joints),
        save(folder / "sa_uncertainty.csv", lines),
    )
    asked = frozenset({"sigma"})
    return truth(files, FANUC, joints, points, std_mm={"": spread}, questions=asked, must_ask=asked)


def expanded_uncertainty_said(folder: Path) -> Measured:
    """The same in one file with U (k=2) in the names: half of it is the standard deviation."""
    joints, points = one_point("ur10", 4)
    spread = np.random.default_rng(4).uniform(0.02, 0.09, points.shape).round(4)
    names = [f"Joint {i} (deg)" for i in range(1, 7)] + [f"{a} (mm)" for a in AXES]
    names += [f"U{a.lower()} (k=2) (mm)" for a in AXES]
    rows = beside(cells(joints, 3), cells(points, 4), cells(spread, 4))
    path = save(folder / "with_U.csv", joined([names, *rows], ","))
    return truth(path, "ur10", joints, points, std_mm={"": spread / 2})


def spatial_analyzer_blanks(folder: Path) -> Measured:
    """Blanks between the fields, numbers in full precision, three groups for three reflectors."""
    done = campaign("fanuc_uncoupled")
    lines = ["// Coordinate system: Cell 3::FRAME-1", "// Units in millimeters"]
    points = done.points_mm.round(6)
    for target in range(3):
        for pose in range(40):
            xyz = " ".join(f"{value:.9e}" for value in points[target, pose])
            lines.append(f"Main SMR_{'ABC'[target]} P{pose + 1} {xyz}")
    labels = [f"P{i}" for i in NUMBERS]
    files = (
        joint_list(folder / "program.csv", labels, done.joints_deg, key="Pose"),
        save(folder / "three_groups.txt", lines),
    )
    targets = {name: points[i] for i, name in enumerate("ABC")}
    return truth(files, FANUC, done.joints_deg, targets)


def polyworks_report(folder: Path) -> Measured:
    """One row per feature and axis: name, control, nominal, measured, tolerance, deviation."""
    joints, points = one_point("fanuc_uncoupled")
    nominal = (points + np.random.default_rng(6).normal(scale=0.7, size=points.shape)).round(3)
    labels = [f"point {i}" for i in NUMBERS]
    lines = ["Project: R2000 cell", "Units: Millimeters", ""]
    lines.append("Name,Control,Nom,Meas,Tol,Dev,Test")
    for pose, label in enumerate(labels):
        for axis in range(3):
            wanted, seen = nominal[pose, axis], points[pose, axis]
            lines.append(
                f"{label},{AXES[axis]},{wanted:.3f},{seen:.3f},±1.000,{seen - wanted:.3f},Pass"
            )
    files = (
        joint_list(folder / "joints.csv", labels, joints, key="Name"),
        save(folder / "polyworks.csv", lines, encoding="utf-8-sig"),
    )
    return truth(files, FANUC, joints, points)


def cam2_report(folder: Path) -> Measured:
    """FARO: one row per feature and axis, semicolons, decimal commas, Actual before Nominal."""
    joints, points = one_point("kr10")
    robot = kr10_description(folder)
    nominal = (points + np.random.default_rng(7).normal(scale=0.5, size=points.shape)).round(3)
    lines = ["CAM2 Measure 10", "Feature;Item;Actual;Nominal;Deviation;Low Tol;High Tol"]
    for pose in range(40):
        for axis in range(3):
            seen, wanted = points[pose, axis], nominal[pose, axis]
            values = [comma(number, 3) for number in (seen, wanted, seen - wanted, -1, 1)]
            lines.append(";".join([f"PUNKT{pose + 1:03d}", AXES[axis], *values]))
    labels = [f"PUNKT{i:03d}" for i in NUMBERS]
    names = ["Feature", *(f"A{i} [deg]" for i in range(1, 7))]
    rows = beside(column(labels), cells(joints, 3, comma))
    files = (
        save(folder / "achsen.csv", joined([names, *rows], ";")),
        save(folder / "cam2.csv", lines, encoding="cp1252", newline="\r\n"),
    )
    return truth(files, robot, joints, points)


def spherical(points_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Horizontal angle clockwise, zenith angle (rad) and distance (mm) of points."""
    x, y, z = points_mm.T
    flat = np.hypot(x, y)
    return np.arctan2(-y, x) % (2 * np.pi), np.arctan2(flat, z), np.hypot(flat, z)


def from_spherical(around: np.ndarray, zenith: np.ndarray, far: np.ndarray) -> np.ndarray:
    """Points (n, 3) of angles in rad and distances."""
    flat = far * np.sin(zenith)
    return np.stack([flat * np.cos(around), -flat * np.sin(around), far * np.cos(zenith)], axis=1)


def spherical_in_gon(folder: Path) -> Measured:
    """Hz and V in gon and the slope distance in m, as their names say."""
    joints, points = one_point("ur10")
    around, zenith, far = spherical(points)
    gon = np.stack([around, zenith], axis=1) * 200 / np.pi
    gon, far = gon.round(6), (far / 1000).round(6)
    names = ["Punkt", *(f"Achse {i} [°]" for i in range(1, 7)), "Hz [gon]", "V [gon]", "D [m]"]
    rows = beside(
        column(NUMBERS),
        cells(joints, 3, comma),
        cells(gon, 6, comma),
        cells(far[:, None], 6, comma),
    )
    path = save(folder / "polar.csv", joined([names, *rows], ";"))
    seen = from_spherical(*(gon.T * np.pi / 200), far * 1000)
    return truth(path, "ur10", joints, seen, any_frame=True)


def spherical_unit_unsaid(folder: Path) -> Measured:
    """Hz, V and distance without units: below 360, so degrees or gon."""
    joints, points = one_point("fanuc_uncoupled")
    around, zenith, far = spherical(points)
    angles = np.degrees(np.stack([around, zenith], axis=1)).round(6)
    far = far.round(4)
    names = ["PtID", *(f"J{i}" for i in range(1, 7)), "Hz", "V", "Dist"]
    rows = beside(column(NUMBERS), cells(joints, 3), cells(angles, 6), cells(far[:, None], 4))
    path = save(folder / "polar.txt", joined([names, *rows], "\t"))
    seen = from_spherical(*np.radians(angles.T), far)
    asked = frozenset({"angle unit", "horizontal angle"})
    return truth(path, FANUC, joints, seen, any_frame=True, questions=asked)


def both_directions(folder: Path) -> Measured:
    """P1-1, P1-2: every configuration reached from below and from above, in two files."""
    done = repeated("fanuc_uncoupled", 16, 2)
    points = done.points_mm[0].round(3)
    labels = [f"P{i // 2 + 1}-{i % 2 + 1}" for i in range(32)]
    ways = ["+" if i % 2 == 0 else "-" for i in range(32)]
    lines = ["Group,Point,X [mm],Y [mm],Z [mm],Approach"]
    lines += joined(
        beside(column(["Repeat"] * 32), column(labels), cells(points, 3), column(ways)), ","
    )
    each = [f"P{i + 1}" for i in range(16)]
    files = (
        joint_list(folder / "poses.csv", each, done.joints_deg[::2]),
        save(folder / "approach.csv", lines),
    )
    return truth(files, FANUC, done.joints_deg, points)


def joined_by_number(folder: Path) -> Measured:
    """Joints and points under a number; the tracker missed some poses and measured two checks."""
    joints, points = one_point("ur10")
    seen = [i for i in range(40) if i not in (3, 18, 26)]
    lines = ["Nr;X (mm);Y (mm);Z (mm)"]
    lines += [f"{i + 1};" + ";".join(cells(points[[i]], 3)[0]) for i in reversed(seen)]
    lines += ["901;812.233;-411.870;55.031", "902;-12.870;1411.021;49.118"]
    names = ["Nr", *(f"Joint{i} (deg)" for i in range(1, 7))]
    rows = beside(column(NUMBERS), cells(joints, 3))
    files = (
        save(folder / "robot.csv", joined([names, *rows], ";")),
        save(folder / "tracker.csv", lines),
    )
    lost = set(range(40)) - set(seen)
    return truth(
        files,
        "ur10",
        joints,
        points,
        missing=lost,
        says=r"\b90[12]\b|unmatched|not matched|no partner",
    )


def tracker_file_named_first(folder: Path) -> Measured:
    """The same two files, typed in the other order."""
    done = joined_by_number(folder)
    return replace(done, files=done.files[::-1])


def joined_by_time(folder: Path) -> Measured:
    """The robot's program logs when it stands still; the tracker's readings carry its own clock."""
    joints, points = one_point("irb120")
    start = datetime(2024, 4, 9, 10, 2, 13)
    arrived = [start + timedelta(seconds=float(s)) for s in _pauses(1)]
    late = timedelta(seconds=1.2)
    names = ["timestamp", "state", *(f"J{i} (deg)" for i in range(1, 7))]
    written = cells(joints, 3)
    robot = [",".join(names)]
    tracker = ["Timestamp;X [mm];Y [mm];Z [mm]"]
    for pose, moment in enumerate(arrived):
        for state, after in (("reached", 0), ("leaving", 4)):
            stamp = (moment + timedelta(seconds=after)).isoformat(timespec="milliseconds")
            robot.append(",".join([stamp, state, *written[pose]]))
        stamp = (moment + late).isoformat(sep=" ", timespec="milliseconds")
        tracker.append(";".join([stamp, *cells(points[[pose]], 3)[0]]))
    files = (save(folder / "program_log.csv", robot), save(folder / "tracker.csv", tracker))
    return truth(files, "irb120", joints, points, questions=frozenset({"clock"}))


def times_destroyed_by_a_spreadsheet(folder: Path) -> Measured:
    """Both files are keyed by times that a spreadsheet rounded to `2,02103E+13`."""
    joints, points = one_point("ur10")
    order = np.random.default_rng(9).permutation(40)
    names = ["Timestamp", *(f"Achse {i} [°]" for i in range(1, 7))]
    broken = column(["2,02103E+13"] * 40)
    robot = joined([names, *beside(broken, cells(joints, 3, comma))], ";")
    tracker = joined(
        [
            ["Timestamp", "X [mm]", "Y [mm]", "Z [mm]"],
            *beside(broken, cells(points[order], 3, comma)),
        ],
        ";",
    )
    files = (save(folder / "robot.csv", robot), save(folder / "tracker.csv", tracker))
    asked = frozenset({"key"})
    return truth(files, "ur10", joints, points, questions=asked, must_ask=asked, readable=False)


def times_shown_as_minutes(folder: Path) -> Measured:
    """Both files went through a spreadsheet that shows `07:41.5`: two hours and a half, no hour."""
    joints, points = one_point("irb120")
    seconds = np.cumsum(np.random.default_rng(10).uniform(180, 270, 40))
    shown = [f"{int(s // 60) % 60:02d}:{s % 60:04.1f}" for s in seconds]
    late = [f"{int(s // 60) % 60:02d}:{s % 60:04.1f}" for s in seconds + 1.3]
    order = text_order(late)
    names = ["Time", *(f"J{i} (deg)" for i in range(1, 7))]
    rows = beside(column(shown), cells(joints, 3))
    seen = beside(column(late[i] for i in order), cells(points[order], 3))
    files = (
        save(folder / "robot.csv", joined([names, *rows], ",")),
        save(folder / "tracker.csv", joined([["Time", "X (mm)", "Y (mm)", "Z (mm)"], *seen], ",")),
    )
    asked = frozenset({"key"})
    return truth(files, "irb120", joints, points, questions=asked, readable=False)


def tracker_points_alone(folder: Path) -> Measured:
    """Points without any joints: nothing to calibrate with until the other file is named."""
    joints, points = one_point("fanuc")
    rows = beside(column(f"P{i}" for i in NUMBERS), cells(points, 3))
    path = save(folder / "points.csv", joined([["Point", *AXES], *rows], ","))
    return truth(path, FANUC, joints, points, questions=frozenset({"joints"}), readable=False)


def _pauses(seed: int) -> np.ndarray:
    """Times of arrival in s, unevenly spaced."""
    return np.cumsum(np.random.default_rng(seed).uniform(9, 23, 40)).round(3)

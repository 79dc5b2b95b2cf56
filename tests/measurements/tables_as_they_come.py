"""Tables that hold joints and measurement together, as spreadsheets and loggers leave them.

Each function writes one file into a folder and returns what is true of it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from measurements.measured_file import (
    Measured,
    beside,
    cells,
    column,
    comma,
    euler,
    grouped,
    grouped_french,
    grouped_german,
    grouped_swiss,
    joined,
    quaternions,
    save,
    true_minus,
    truth,
)
from measurements.simulated_arms import campaign, repeated

FANUC = "fanuc_r2000ic_165f"
NUMBERS = range(1, 41)


def one_point(name: str, decimals: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Joints in deg and the first reflector, as rounded in the file."""
    done = campaign(name)
    return done.joints_deg, done.points_mm[0].round(decimals)


def german_decimal_commas(folder: Path) -> Measured:
    """UTF-8 with byte order mark, semicolons, German names, mean and deviation at the end."""
    joints, points = one_point("ur10")
    names = ["Pose", *(f"Achse {i} [°]" for i in range(1, 7)), "X [mm]", "Y [mm]", "Z [mm]"]
    rows = beside(column(NUMBERS), cells(joints, 3, comma), cells(points, 3, comma))
    every = np.hstack([joints, points])
    ends = [
        ["Mittelwert", *cells([every.mean(0)], 3, comma)[0]],
        ["Standardabw.", *cells([every.std(0)], 3, comma)[0]],
    ]
    lines = joined([names, *rows, *ends], ";")
    return truth(save(folder / "Messung.csv", lines, encoding="utf-8-sig"), "ur10", joints, points)


def german_latin1(folder: Path) -> Measured:
    """Latin-1, a title with umlauts, tabs, decimal commas; nominal, actual and deviation."""
    joints, points = one_point("fanuc_uncoupled")
    off = np.random.default_rng(8).normal(scale=0.5, size=points.shape).round(3)
    names = [
        "Nr.",
        *(f"Gelenk {i} (Grad)" for i in range(1, 7)),
        *(f"{word} {axis} (mm)" for word in ("Soll", "Ist", "Abw.") for axis in "XYZ"),
        "Prüfer",
    ]
    measured = np.hstack([points - off, points, off])
    rows = beside(
        column(NUMBERS), cells(joints, 3, comma), cells(measured, 3, comma), column(["Jürgen"] * 40)
    )
    lines = ["Prüfprotokoll Roboter, Halle 3", "", *joined([names, *rows], "\t")]
    path = save(folder / "pruefung.txt", lines, encoding="latin-1", newline="\r\n")
    return truth(path, FANUC, joints, points)


def unicode_text_from_excel(folder: Path) -> Measured:
    """UTF-16 with tabs, what a spreadsheet saves as Unicode text."""
    joints, points = one_point("ur10")
    names = ["Point", *(f"Joint {i} (deg)" for i in range(1, 7)), "X (mm)", "Y (mm)", "Z (mm)"]
    rows = beside(column(f"P{i}" for i in NUMBERS), cells(joints, 3), cells(points, 3))
    lines = joined([names, *rows], "\t")
    path = save(folder / "export.txt", lines, encoding="utf-16", newline="\r\n")
    return truth(path, "ur10", joints, points)


def separator_line(folder: Path) -> Measured:
    """A first line `sep=;`, quoted names, decimal commas."""
    joints, points = one_point("irb120")
    names = [f'"J{i} [deg]"' for i in range(1, 7)] + [f'"{axis} [mm]"' for axis in "XYZ"]
    rows = beside(cells(joints, 3, comma), cells(points, 3, comma))
    lines = ["sep=;", *joined([names, *rows], ";")]
    return truth(save(folder / "a.csv", lines, newline="\r\n"), "irb120", joints, points)


def no_readings_as_written(folder: Path) -> Measured:
    """Blank cells, `---`, 9999 and 0/0/0 where the beam was broken; Mean and Std. Dev. below."""
    joints, points = one_point("ur10")
    rows = beside(column(NUMBERS), cells(joints, 3), cells(points, 3))
    lost = {4: ["", "", ""], 11: ["---"] * 3, 17: ["9999"] * 3, 23: ["0.000"] * 3, 31: ["", "", ""]}
    for row, written in lost.items():
        rows[row][7:] = written
    names = ["Pose", *(f"q{i}_deg" for i in range(1, 7)), "x_mm", "y_mm", "z_mm"]
    kept = np.delete(points, list(lost), axis=0)
    blank = [""] * 6
    ends = [
        [""] * 10,
        ["Mean", *blank, *cells([kept.mean(0)], 3)[0]],
        ["Std. Dev.", *blank, *cells([kept.std(0)], 3)[0]],
        ["Max", *blank, *cells([kept.max(0)], 3)[0]],
    ]
    path = save(folder / "broken_beam.csv", joined([names, *rows, *ends], ","))
    return truth(path, "ur10", joints, points, missing=lost)


def one_reflector_lost(folder: Path) -> Measured:
    """Three reflectors side by side; single ones were out of sight at some poses."""
    done = campaign("fanuc_uncoupled")
    points = done.points_mm.round(3)
    lost = {0: (6, 7), 1: (20,), 2: (7, 33)}
    parts = [column(NUMBERS), cells(done.joints_deg, 3)]
    for target, rows in lost.items():
        written = cells(points[target], 3)
        for row in rows:
            written[row] = ["-"] * 3
            points[target, row] = np.nan
        parts.append(written)
    names = ["Config", *(f"J{i} (deg)" for i in range(1, 7))]
    names += [f"SMR{i} {axis} (mm)" for i in (1, 2, 3) for axis in "XYZ"]
    path = save(folder / "three_smr.csv", joined([names, *beside(*parts)], ","))
    targets = {f"SMR{i + 1}": points[i] for i in range(3)}
    return truth(path, FANUC, done.joints_deg, targets)


def thousands_english(folder: Path) -> Measured:
    """Commas between thousands, hence numbers in quotes."""
    joints, points = one_point("fanuc_uncoupled")
    names = [f"J{i} (deg)" for i in range(1, 7)] + ["X (mm)", "Y (mm)", "Z (mm)"]
    quoted = [[f'"{cell}"' for cell in row] for row in cells(points, 3, grouped)]
    lines = joined([names, *beside(cells(joints, 3), quoted)], ",")
    return truth(save(folder / "report.csv", lines), FANUC, joints, points)


def thousands_german(folder: Path) -> Measured:
    """Points between thousands and decimal commas."""
    joints, points = one_point("mh180")
    names = [f"Achse {i} in Grad" for i in range(1, 7)] + [f"{axis} in mm" for axis in "XYZ"]
    rows = beside(cells(joints, 3, comma), cells(points, 3, grouped_german))
    path = save(folder / "bericht.csv", joined([names, *rows], ";"), encoding="cp1252")
    return truth(path, "mh180", joints, points)


def thousands_swiss(folder: Path) -> Measured:
    """Apostrophes between thousands, a decimal point; controllers call their own point Ist, too."""
    joints, points = one_point("fanuc_uncoupled")
    names = [f"A{i} [Grad]" for i in range(1, 7)] + [f"{axis}-Ist [mm]" for axis in "XYZ"]
    rows = beside(cells(joints, 3), cells(points, 3, grouped_swiss))
    path = save(folder / "ch.csv", joined([names, *rows], ";"))
    return truth(path, FANUC, joints, points, questions=frozenset({"measurement"}))


def quoted_decimal_commas(folder: Path) -> Measured:
    """Commas between cells and within numbers: every cell in quotes."""
    joints, points = one_point("ur10")
    names = ["Pose", *(f"J{i} [deg]" for i in range(1, 7)), "X [mm]", "Y [mm]", "Z [mm]"]
    rows = beside(column(NUMBERS), cells(joints, 3, comma), cells(points, 3, comma))
    quoted = [[f'"{cell}"' for cell in row] for row in [names, *rows]]
    return truth(save(folder / "database.csv", joined(quoted, ",")), "ur10", joints, points)


def inches(folder: Path) -> Measured:
    """Positions in inches, as their names say."""
    done = campaign("fanuc_uncoupled")
    written = (done.points_mm[0] / 25.4).round(5)
    names = [f"J{i} (deg)" for i in range(1, 7)] + ["X (in)", "Y (in)", "Z (in)"]
    lines = joined([names, *beside(cells(done.joints_deg, 3), cells(written, 5))], ",")
    path = save(folder / "imperial.csv", lines)
    return truth(path, FANUC, done.joints_deg, written * 25.4)


def typographic_minus(folder: Path) -> Measured:
    """U+2212 instead of the hyphen, as copied from a report."""
    joints, points = one_point("irb120")
    names = [f"Joint {i} [deg]" for i in range(1, 7)] + [f"{axis} [mm]" for axis in "XYZ"]
    rows = beside(cells(joints, 3, true_minus), cells(points, 3, true_minus))
    path = save(folder / "copied.csv", joined([names, *rows], ","))
    return truth(path, "irb120", joints, points)


def aligned_with_blanks(folder: Path) -> Measured:
    """Columns aligned with several blanks, a commented head."""
    joints, points = one_point("ur10")
    names = ["#", *(f"J{i}[deg]" for i in range(1, 7)), *(f"{axis}[mm]" for axis in "XYZ")]
    rows = beside(column(NUMBERS), cells(joints, 3), cells(points, 3))
    lines = ["% calibration run 7, tracker at station 2", "% temperature 21.4 C", ""]
    lines += ["".join(cell.rjust(14) for cell in row) for row in [names, *rows]]
    return truth(save(folder / "run7.dat", lines), "ur10", joints, points)


def units_row(folder: Path) -> Measured:
    """A row of units under the names: joints in rad, positions in m."""
    done = campaign("irb120")
    joints = np.radians(done.joints_deg).round(8)
    metres = (done.points_mm[0] / 1000).round(6)
    names = ["Pose", *(f"J{i}" for i in range(1, 7)), "X", "Y", "Z"]
    rows = beside(column(NUMBERS), cells(joints, 8), cells(metres, 6))
    lines = joined([names, ["-", *["rad"] * 6, *["m"] * 3], *rows], ",")
    return truth(save(folder / "si.csv", lines), "irb120", np.degrees(joints), metres * 1000)


def metres_and_radians_unsaid(folder: Path) -> Measured:
    """Short names without any unit; the numbers are m and rad."""
    done = campaign("irb120")
    joints = np.radians(done.joints_deg).round(8)
    metres = (done.points_mm[0] / 1000).round(6)
    names = [f"j{i}" for i in range(1, 7)] + ["x", "y", "z"]
    lines = joined([names, *beside(cells(joints, 8), cells(metres, 6))], ",")
    asked = frozenset({"joint unit", "length unit"})
    path = save(folder / "log.csv", lines)
    return truth(path, "irb120", np.degrees(joints), metres * 1000, questions=asked)


def french(folder: Path) -> Measured:
    """French names in code page 1252, hard blanks between thousands, decimal commas; deviations."""
    joints, points = one_point("fanuc_uncoupled")
    names = ["N° point", *(f"Axe {i} (°)" for i in range(1, 7))]
    names += [f"{axis} mesuré (mm)" for axis in "XYZ"] + [f"Écart {axis} (mm)" for axis in "XYZ"]
    off = np.random.default_rng(5).normal(scale=0.6, size=points.shape)
    rows = beside(
        column(NUMBERS),
        cells(joints, 3, comma),
        cells(points, 3, grouped_french),
        cells(off, 3, comma),
    )
    ends = ["Moyenne", *[""] * 9, *cells([off.mean(0)], 3, comma)[0]]
    lines = ["Relevé laser du 12/03/2024", *joined([names, *rows, ends], ";")]
    return truth(save(folder / "releve.csv", lines, encoding="cp1252"), FANUC, joints, points)


def spanish(folder: Path) -> Measured:
    """Spanish names in Latin-1, measured beside nominal."""
    joints, points = one_point("fanuc_uncoupled")
    nominal = campaign("fanuc_uncoupled").nominal_mm.round(3)
    names = [f"Eje {i} (grados)" for i in range(1, 7)]
    names += [f"Posición nominal {a} (mm)" for a in "XYZ"]
    names += [f"Posición medida {a} (mm)" for a in "XYZ"]
    rows = beside(cells(joints, 3), cells(nominal, 3), cells(points, 3))
    path = save(folder / "medicion.csv", joined([names, *rows], ","), encoding="latin-1")
    return truth(path, FANUC, joints, points)


def japanese(folder: Path) -> Measured:
    """Japanese names in code page 932."""
    joints, points = one_point("mh180")
    names = [
        "番号",
        *(f"{axis}軸(度)" for axis in "SLURBT"),
        *(f"測定{axis}(mm)" for axis in "XYZ"),
    ]
    rows = beside(column(NUMBERS), cells(joints, 3), cells(points, 3))
    lines = joined([names, *rows], ",")
    path = save(folder / "sokutei.csv", lines, encoding="cp932", newline="\r\n")
    return truth(path, "mh180", joints, points)


def yaskawa_axes(folder: Path) -> Measured:
    """Axes S L U R B T without further words, rounded to 0.01 deg."""
    done = campaign("mh180", 2)
    points = done.points_mm[0].round(3)
    lines = joined(
        [
            ["No", *"SLURBT", *"XYZ"],
            *beside(column(NUMBERS), cells(done.joints_deg, 2), cells(points, 3)),
        ],
        "\t",
    )
    path = save(folder / "gp180.txt", lines)
    return truth(path, "mh180", done.joints_deg, points, says=r"\bround")


def unnamed_euler_angles(folder: Path) -> Measured:
    """Probe frames with angles whose convention the names do not say."""
    done = campaign("ur10")
    points = done.points_mm[0].round(4)
    angles, rotations = euler(done.rotations, "ZYX", 5)
    names = [f"q{i}_deg" for i in range(1, 7)] + ["x_mm", "y_mm", "z_mm"]
    names += ["rot1_deg", "rot2_deg", "rot3_deg"]
    rows = beside(cells(done.joints_deg, 3), cells(points, 4), cells(angles, 5))
    path = save(folder / "tmac.csv", joined([names, *rows], ","))
    return truth(
        path,
        "ur10",
        done.joints_deg,
        points,
        rotations=rotations,
        questions=frozenset({"euler convention"}),
    )


def quaternion_of_unsaid_order(folder: Path) -> Measured:
    """Four columns quat_0 to quat_3, the scalar first."""
    done = campaign("ur10")
    points = done.points_mm[0].round(4)
    written, rotations = quaternions(done.rotations, 9)
    names = [f"joint_{i} (deg)" for i in range(1, 7)] + [f"pos_{a} (mm)" for a in "xyz"]
    names += [f"quat_{i}" for i in range(4)]
    rows = beside(cells(done.joints_deg, 3), cells(points, 4), cells(written, 9))
    path = save(folder / "probe.csv", joined([names, *rows], ","))
    return truth(
        path,
        "ur10",
        done.joints_deg,
        points,
        rotations=rotations,
        questions=frozenset({"quaternion order"}),
    )


def one_row_per_reflector(folder: Path) -> Measured:
    """Long form: three rows per pose, the reflectors' radii and offsets beside the point."""
    done = campaign("fanuc_uncoupled")
    points = done.points_mm.round(3)
    lines = ["Pose,Target,SMR radius (mm),Offset (mm),J1,J2,J3,J4,J5,J6,X (mm),Y (mm),Z (mm)"]
    joints = cells(done.joints_deg, 3)
    for pose in range(40):
        for target, radius in ((0, "19.050"), (1, "19.050"), (2, "6.350")):
            xyz = cells(points[target, [pose]], 3)[0]
            lines.append(
                ",".join([str(pose + 1), f"T{target + 1}", radius, radius, *joints[pose], *xyz])
            )
    targets = {f"T{i + 1}": points[i] for i in range(3)}
    path = save(folder / "long.csv", lines)
    return truth(path, FANUC, done.joints_deg, targets)


def several_readings_of_a_point(folder: Path) -> Measured:
    """Points P1_1, P1_2, P1_3: three readings of every configuration, in natural order."""
    done = repeated("ur10", 14, 3)
    points = done.points_mm[0].round(4)
    labels = [f"P{i // 3 + 1}_{i % 3 + 1}" for i in range(42)]
    names = ["Point", *(f"q{i} [deg]" for i in range(1, 7)), "X [mm]", "Y [mm]", "Z [mm]"]
    rows = beside(column(labels), cells(done.joints_deg, 3), cells(points, 4))
    return truth(
        save(folder / "repeats.csv", joined([names, *rows], ";")), "ur10", done.joints_deg, points
    )


def reflector_changed_halfway(folder: Path) -> Measured:
    """One nest, first with a reflector of 1.5 inches and then with one of half an inch."""
    done = campaign("fanuc_uncoupled")
    first, second, third = done.points_mm
    normal = np.cross(second - first, third - first)
    lower = first - 12.7 * normal / np.linalg.norm(normal, axis=1, keepdims=True)
    large = np.arange(40) < 22
    points = np.where(large[:, None], first, lower).round(3)
    names = ["Pose", *(f"J{i} (deg)" for i in range(1, 7)), "Nest", "SMR radius (mm)"]
    names += ["X (mm)", "Y (mm)", "Z (mm)"]
    radii = np.where(large, "19.050", "6.350")
    rows = beside(column(NUMBERS), cells(done.joints_deg, 3), column(["N1"] * 40), column(radii))
    path = save(folder / "two_smr.csv", joined([names, *beside(rows, cells(points, 3))], ","))
    targets = {
        "large": np.where(large[:, None], points, np.nan),
        "small": np.where(large[:, None], np.nan, points),
    }
    asked = frozenset({"reflector radius"})
    return truth(path, FANUC, done.joints_deg, targets, questions=asked)


def names_again_midway(folder: Path) -> Measured:
    """The logger was started again: its names stand in the middle too; commas end the lines."""
    joints, points = one_point("irb120")
    names = [*(f"joint_{i}_deg" for i in range(1, 7)), "meas_x_mm", "meas_y_mm", "meas_z_mm", ""]
    rows = beside(cells(joints, 3), cells(points, 3), [[""]] * 40)
    lines = joined([names, *rows[:17], [], names, *rows[17:]], ",")
    return truth(save(folder / "logger.csv", lines), "irb120", joints, points)

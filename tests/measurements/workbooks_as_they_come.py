"""Workbooks that hold joints and measurement, on one sheet or on several.

Each function writes one file into a folder and returns what is true of it.
"""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import openpyxl
from measurements.measured_file import Measured, truth
from measurements.simulated_arms import campaign, repeated
from measurements.tables_as_they_come import FANUC, one_point


def italian_workbook(folder: Path) -> Measured:
    """A workbook with Italian names, one title row, numbers as numbers."""
    joints, points = one_point("irb120")
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "Misure"
    sheet.append(["Calibrazione robot, 14 marzo"])
    sheet.append(["Punto", *(f"Asse {i} [gradi]" for i in range(1, 7)), *"XYZ", "unità: mm"])
    for number, row in enumerate(np.hstack([joints, points]).tolist(), 1):
        sheet.append([number, *row])
    path = folder / "misure.xlsx"
    book.save(path)
    return truth(path, "irb120", joints, points)


def workbook_with_cover_sheet(folder: Path) -> Measured:
    """A cover sheet, title rows, units under the names, dates, three reflectors, a summary."""
    done = campaign("ur10")
    points = done.points_mm.round(4)
    book = openpyxl.Workbook()
    cover = book.active
    cover.title = "Deckblatt"
    for row in (["Kunde", "Muster GmbH"], ["Roboter", "UR10"], ["Datum", datetime(2024, 5, 3)]):
        cover.append(row)
    sheet = book.create_sheet("Messdaten")
    sheet.append(["Kalibrierung UR10, Zelle 4"])
    sheet.append([])
    sheet.append(
        ["Pose", "Datum", *(f"Achse {i}" for i in range(1, 7))]
        + [f"Reflektor {i} {axis}" for i in "ABC" for axis in "XYZ"]
    )
    sheet.append(["", "", *["°"] * 6, *["mm"] * 9])
    start = datetime(2024, 5, 3, 9, 15)
    table = np.hstack([done.joints_deg, *points]).tolist()
    for number, row in enumerate(table):
        sheet.append([number + 1, start + timedelta(seconds=41 * number), *row])
    sheet.append(["Mittelwert", None, *np.mean(table, axis=0).tolist()])
    summary = book.create_sheet("Auswertung")
    summary.append(["Achse", "Mittel", "Max"])
    summary.append([1, 0.31, 0.77])
    path = folder / "UR10 Zelle 4.xlsx"
    book.save(path)
    targets = {name: points[i] for i, name in enumerate("ABC")}
    return truth(path, "ur10", done.joints_deg, targets)


def workbook_with_a_sheet_each(folder: Path) -> Measured:
    """Joints on one sheet and the tracker's points on another, under the names of the points."""
    joints, points = one_point("ur10")
    book = openpyxl.Workbook()
    robot = book.active
    robot.title = "Robot"
    robot.append(["Point", *(f"J{i} (deg)" for i in range(1, 7))])
    tracker = book.create_sheet("Tracker")
    tracker.append(["Point", "X (mm)", "Y (mm)", "Z (mm)"])
    for i in range(40):
        robot.append([f"P{i + 1}", *joints[i].tolist()])
        tracker.append([f"P{40 - i}", *points[39 - i].tolist()])
    path = folder / "campaign.xlsx"
    book.save(path)
    return truth(path, "ur10", joints, points)


def workbook_of_two_runs(folder: Path) -> Measured:
    """A cold and a warm run of the same poses, each complete on its sheet: which one, or both?"""
    done = repeated("irb120", 32, 2)
    points = done.points_mm[0].round(3)
    book = openpyxl.Workbook()
    for run, title in enumerate(("Run 1 cold", "Run 2 warm")):
        sheet = book.active if run == 0 else book.create_sheet()
        sheet.title = title
        sheet.append([*(f"J{i} (deg)" for i in range(1, 7)), "X (mm)", "Y (mm)", "Z (mm)"])
        for row in np.hstack([done.joints_deg, points])[run::2].tolist():
            sheet.append(row)
    path = folder / "runs.xlsx"
    book.save(path)
    return truth(path, "irb120", done.joints_deg, points, questions=frozenset({"sheet"}))


def names_in_two_rows(folder: Path) -> Measured:
    """A workbook whose upper names span several columns: axes, nominal X Y Z, actual X Y Z."""
    joints, points = one_point("fanuc_uncoupled")
    nominal = campaign("fanuc_uncoupled").nominal_mm.round(3)
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.append(["Nr.", "Achsen [°]", *[None] * 5, "Soll [mm]", None, None, "Ist [mm]"])
    sheet.append([None, *(f"J{i}" for i in range(1, 7)), *"XYZ", *"XYZ"])
    for merged in ("A1:A2", "B1:G1", "H1:J1", "K1:M1"):
        sheet.merge_cells(merged)
    for number, row in enumerate(np.hstack([joints, nominal, points]).tolist(), 1):
        sheet.append([number, *row])
    path = folder / "Protokoll.xlsx"
    book.save(path)
    # A controller's log has Soll and Ist as well: that a tracker measured is not said.
    return truth(path, FANUC, joints, points, questions=frozenset({"measurement"}))

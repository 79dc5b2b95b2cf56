"""A cell whose readings are known, and files of it as instruments and spreadsheets write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cli.tracked_arm import tracked
from read_columns import joints_of, points_of

from kinacc.kinematics import robot
from kinacc.measurements.intake import guess
from kinacc.measurements.intake.choices import Undecided
from kinacc.measurements.reader import read

IT = tracked(poses=14)
ROWS, POINT_MM, Q_DEG = len(IT.q), np.round(IT.point, 3), np.round(IT.q, 3)
JOINTS = [f"J{number} [deg]" for number in range(1, 7)]
XYZ = ["X [mm]", "Y [mm]", "Z [mm]"]
NO_UNITS = [*(f"J{number}" for number in range(1, 7)), *"XYZ"]


def cells(decimal="."):
    """Rows of text: joints, then the point."""
    rows = np.hstack([Q_DEG, POINT_MM])
    return [[f"{value:.3f}".replace(".", decimal) for value in row] for row in rows]


def lines(rows, names=(*JOINTS, *XYZ), mark=","):
    """Lines of names and rows."""
    return "\n".join(mark.join(map(str, row)) for row in ([names] if names else []) + rows) + "\n"


def file(folder, text, name="readings.txt", encoding="utf-8") -> Path:
    """The text as a file."""
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


def workbook(folder, sheets, name="readings.xlsx") -> Path:
    """Rows by name of sheet as a workbook."""
    import openpyxl

    book = openpyxl.Workbook()
    book.remove(book.active)
    for title, rows in sheets.items():
        sheet = book.create_sheet(title)
        for row in rows:
            sheet.append(row)
    path = folder / name
    book.save(path)
    return path


def looked(path, **answers):
    """What init finds out about a file; answers are those of its options."""
    return guess.look(path, answers=answers)


def reading(path, **answers):
    """What a run reads of the file, by the keys init writes."""
    return read(looked(path, **answers).section, robot.load(IT.name), strict=False)


def assert_is_truth(found, rows=slice(None), atol=2e-3):
    """Joints and points are those of the cell at ``rows``, in their order."""
    np.testing.assert_allclose(np.rad2deg(joints_of(found.columns)), Q_DEG[rows], atol=atol)
    np.testing.assert_allclose(points_of(found.columns), POINT_MM[rows], atol=atol)


def undecided(path, **answers) -> str:
    """The questions that a file leaves open."""
    with pytest.raises(Undecided) as caught:
        looked(path, **answers)
    return str(caught.value)

"""Noise and repeatability of a file of repeated readings: what ``kinacc repeatability`` states."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd

from kinacc.checks import digits
from kinacc.checks import repeatability as checks
from kinacc.checks.repeatability import Noise
from kinacc.errors import Problem, first_few, gathered, input_error, refuse
from kinacc.measurements.intake.columns import POINTS
from kinacc.measurements.layout import listed
from kinacc.measurements.rows import read_rows
from kinacc.measurements.table import RawTable
from kinacc.measurements.times import seconds

FORMAT = "kinacc repeatability 1"
_LEAST_MM = 1e-6  # no instrument scatters less
_NAMES = {"direction": "side", "side": "side", "approach": "visit", "visit": "visit"}
_NAMES |= {"instrument": "instrument"}
_EMPTY = ("", "nan", "None")  # + and - are names of sides
_SINGLE = ("target", "session", "instrument")
_HOURS = {"time": 1.0 / 3600.0, "time_s": 1.0 / 3600.0, "time_min": 1.0 / 60.0, "time_h": 1.0}


@dataclass(frozen=True)
class RepeatedFile:
    """Readings of a file.

    Attributes
    ----------
    table
        The file.
    rows
        ``pose``, ``side``, ``visit``, ``hours`` and ``x_mm``, ``y_mm``, ``z_mm`` of each reading.
    resolution_mm
        Steps (3,) of the values.
    notes
        How the file was read, and its columns that are not used.
    """

    table: RawTable
    rows: pd.DataFrame
    resolution_mm: np.ndarray
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Repeatability:
    """Noise and repeatability of repeated readings; NaN where the readings do not determine it.

    Attributes
    ----------
    format
        Name of this record, for ``kinacc campaign start --repeatability``.
    file, poses, visits, readings
        The file, and number of its poses, visits and readings.
    noise, std_mm, std_low_mm, std_high_mm
        Noise of one reading of a campaign (None where no pose was revisited), its standard
        deviations (3,) and their 95 % limits.
    instrument_std_mm, one_side_std_mm, all_sides_std_mm
        Standard deviations (3,) of the instrument, and of the arm from one and from all sides.
    mean_distance_mm, rp_mm
        By the formulas of ISO 9283: mean distance from the mean position, and RP, pooled over the
        poses. RP is that of the standard from 30 visits of a pose on.
    poses_equal_probability, poses_differ
        Probability that poses differ as much by chance, and which scatters most, or None.
    resolution_mm
        Step (3,) of the values.
    hours_at_a_pose
        Median time from the first to the last reading of a pose.
    sides_known
        Whether the file states sides of approach.
    far_off
        Rows far from the other readings of their pose, as text.
    rows
        A row for each pose and side.
    """

    format: str
    file: str
    poses: int
    visits: int
    readings: int
    noise: Noise | None
    std_mm: np.ndarray
    std_low_mm: np.ndarray
    std_high_mm: np.ndarray
    instrument_std_mm: np.ndarray
    one_side_std_mm: np.ndarray
    all_sides_std_mm: np.ndarray
    mean_distance_mm: float
    rp_mm: float
    poses_equal_probability: float
    poses_differ: str | None
    resolution_mm: np.ndarray
    hours_at_a_pose: float
    sides_known: bool
    far_off: str
    rows: pd.DataFrame


def read_repeats(path: str, rows_are: str | None) -> RepeatedFile:
    """Read a file of repeated readings.

    Parameters
    ----------
    path
        File with positions and ``pose``; ``side``, ``visit`` and times where it has these.
    rows_are
        Whether rows of a pose without a visit are ``visits`` or ``stays``.

    Returns
    -------
    RepeatedFile
        Its readings.

    Raises
    ------
    InputError
        With all problems of the file.
    """
    problems: list[Problem] = []
    read = read_rows(path, np.zeros(0), POINTS, spoilt=problems)
    assert read.table is not None  # as of every file
    assert read.columns is not None
    table = read.table
    names = {ours: column for column, ours in _NAMES.items() if column in table.columns}
    names |= {name: place.column for name, place in read.columns.single.items()}
    rows = pd.DataFrame({"side": "", "visit": "", "hours": math.nan}, index=range(len(table)))
    if "pose" not in names:
        problems.append(Problem(f"{path}: column pose", "is missing", fix=listed(table)))
    for label in (label for label in ("pose", "side", "visit") if label in names):
        rows[label] = [text.removesuffix(".0") for text in table.texts(names[label])]
        gaps = np.flatnonzero(rows[label].isin(_EMPTY))
        if gaps.size:
            where = table.where(names[label], gaps)
            problems.append(Problem(where, "an empty cell", fix="fill it in"))
    for name in (name for name in _SINGLE if name in names):
        if len(kinds := {*table.texts(names[name])}) > 1:
            message, fix = f"holds several: {first_few(sorted(kinds))}", "one file for each"
            problems.append(Problem(table.where(names[name]), message, "one", fix))
    time = next((name for name in _HOURS if name in table.columns), None)
    if time is not None:
        with gathered(problems):
            rows["hours"] = seconds(table, time) * _HOURS[time]
            if (gaps := np.flatnonzero(rows["hours"].isna())).size:
                problems.append(Problem(table.where(time, gaps), "no time"))
    if "pose" in rows and "visit" not in names:
        again = np.flatnonzero(rows["pose"] == rows["pose"].shift())
        if rows_are is None and again.size:
            where = f"{path}: {table.rows_in_words(again)}"
            fix = "--rows visits, --rows stays or a column visit"
            allowed = "whether the arm left the pose"
            problems.append(Problem(where, "the pose of the row before", allowed, fix))
        if rows_are != "stays":
            rows["visit"] = rows.index
    if not problems and rows["pose"].is_unique:
        problems.append(Problem(path, "no pose has more than one reading"))
    refuse(problems, f"{path} cannot be used")
    unused = [name for name in read.unused if name not in {time, *names.values()}]
    notes = (*read.notes, f"not used: {', '.join(unused)}") if unused else read.notes
    axes = read.columns.targets[0].position
    steps = [digits.step(table.columns[a.column], a.factor, table.decimal) for a in axes]
    rows[checks.AXES] = read.position_mm
    return RepeatedFile(table, rows, np.array(steps), notes)


def estimate(file: RepeatedFile) -> Repeatability:
    """Estimate noise and repeatability.

    Parameters
    ----------
    file
        Readings of :func:`read_repeats`.

    Returns
    -------
    Repeatability
        Noise of a reading, its parts, and repeatability by ISO 9283's formulas, mm.

    Raises
    ------
    InputError
        Where readings of a pose are equal to the last digit.
    """
    table, rows = file.table, file.rows
    parts = checks.parts(rows)
    noise = checks.noise_of(parts, file.resolution_mm)
    std, low, high = [np.full(3, np.nan)] * 3
    if noise is not None:
        std = noise.std_mm
        low, high = checks.limits(std, noise.freedom)
        if not (std > _LEAST_MM).all():
            raise input_error(table.path, "readings of a pose are equal to the last digit")
    by_pose, ratio = checks.differ_by_pose(rows, file.resolution_mm)
    result = checks.by_side(rows)
    mean_mm, rp_mm = checks.pooled_rp(result)
    differ = None
    if by_pose < checks.UNEQUAL:
        differ = f"Poses scatter differently (p = {by_pose:.2g}): pose {ratio.idxmax()} "
        differ += f"{ratio.max():.2f} times as much as all."
    spans = rows.groupby("pose")["hours"].agg(["size", np.ptp])
    result["side"] = result["side"].replace("", None)
    far = checks.far_off(rows)
    return Repeatability(
        format=FORMAT,
        file=table.path,
        poses=rows["pose"].nunique(),
        visits=int(result["visits"].sum()),
        readings=len(rows),
        noise=noise,
        std_mm=std,
        std_low_mm=low,
        std_high_mm=high,
        instrument_std_mm=np.sqrt(np.diag(parts.instrument)),
        one_side_std_mm=np.sqrt(np.diag(parts.visits)),
        all_sides_std_mm=np.sqrt(np.diag(parts.visits + parts.sides)),
        mean_distance_mm=mean_mm,
        rp_mm=rp_mm,
        poses_equal_probability=by_pose,
        poses_differ=differ,
        resolution_mm=file.resolution_mm,
        hours_at_a_pose=float(spans["ptp"][spans["size"] > 1].median()),
        sides_known=bool((rows["side"] != "").any()),
        far_off=table.rows_in_words(far) if far.size else "",
        rows=result,
    )

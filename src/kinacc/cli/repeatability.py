"""``kinacc repeatability``: noise of readings, and repeatability of arm and instrument."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import click
import numpy as np
import pandas as pd

from kinacc.assess.noise import ENOUGH, FEWEST
from kinacc.calibration.noise import per_axis_mm
from kinacc.campaign.known_noise import FORMAT
from kinacc.checks import repeatability as checks
from kinacc.checks.digits import smallest_step, step_between
from kinacc.checks.repeatability import Noise, Repeated
from kinacc.cli.choice import option
from kinacc.cli.output import answers
from kinacc.errors import InputError, Problem, first_few, refuse
from kinacc.measurements.layout import POSITION, Place, find, listed
from kinacc.measurements.reader import stacked
from kinacc.measurements.rows import open_table
from kinacc.measurements.table import RawTable, numbers
from kinacc.report.rendering import size

_A_DAY_H = 1.0  # readings of a pose within less time do not show the changes of a day
_USUAL_VISITS = 30  # of each pose, by ISO 9283
_LEAST_MM = 1e-6  # no instrument scatters less
_NAMES = {"pose": ("pose",), "side": ("side", "direction"), "visit": ("visit", "approach")}
_EMPTY = ("", "nan", "None")  # + and - are names of sides
_SINGLE = ("target", "session", "instrument")
_HOURS = {"time_s": 1.0 / 3600.0, "time_min": 1.0 / 60.0, "time_h": 1.0}


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
    mean_distance_mm, rp_mm, between_sides_mm
        ISO 9283: mean distance from the mean position, RP, and vAP, pooled over the poses.
    poses_equal_probability, poses_differ
        Probability that poses differ as much by chance, and which scatters most, or None.
    resolution_mm
        Step (3,) of the values.
    hours_at_a_pose
        Median time from the first to the last reading of a pose.
    remarks
        Conditions on these figures.
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
    between_sides_mm: float
    poses_equal_probability: float
    poses_differ: str | None
    resolution_mm: np.ndarray
    hours_at_a_pose: float
    remarks: tuple[str, ...]
    rows: pd.DataFrame


@click.command("repeatability")
@click.argument("file", type=click.Path())
@option("--rows", "rows_are", type=click.Choice(["visits", "stays"]),
        help="Whether the arm left the pose before every row, or stayed.")  # fmt: skip
@answers(table=True)
def repeatability(file, rows_are, out) -> None:
    """Estimate the noise of a campaign's readings from poses that were read repeatedly.

    FILE has x_mm, y_mm, z_mm (or _m) and `pose`; and optionally `visit` (rows of one visit: the arm
    stayed), `side` (of approach) and `time` (or time_s, time_min, time_h), of one target and
    instrument. 20 poses, visited three times from different sides over the day, are enough.

    \b
    Example:
      kinacc repeatability repeats.csv
      kinacc repeatability repeats.csv --rows visits -o noise.json
      kinacc campaign start check --calibration results/ur10_d --repeatability noise.json
    """
    result = estimate(*read_repeats(file, rows_are))
    out.show(result, result.rows, [*_lines(result), *result.remarks])


def read_repeats(
    path: str, rows_are: str | None
) -> tuple[RawTable, np.ndarray, pd.DataFrame, np.ndarray]:
    """The file, positions (n, 3) in mm, pose, side, visit and hours of every row, and steps (3,).

    ``rows_are``: whether rows of a pose without a visit are ``visits`` or ``stays``. InputError
    with all problems.
    """
    problems: list[Problem] = []
    table, layout, notes = open_table(path)
    for note in notes:
        click.echo(f"{path}: {note}", err=True)
    layout_columns = find(table, layout, np.zeros(0), problems, POSITION)
    refuse(problems, f"{path} cannot be used")
    axes = layout_columns.targets[0].position
    position = stacked(table, axes, problems, gaps=False)
    singles = {place.column: name for name, place in layout_columns.single.items()}
    table = replace(table, columns=table.columns.rename(columns=singles))
    rows = pd.DataFrame({"side": "", "visit": "", "hours": math.nan}, index=range(len(table)))
    if "pose" not in table.columns:
        problems.append(Problem(f"{path}: column pose", "is missing", fix=listed(table)))
    columns = {name: [n for n in names if n in table.columns] for name, names in _NAMES.items()}
    for name, column in ((name, names[0]) for name, names in columns.items() if names):
        rows[name] = [str(cell).strip().removesuffix(".0") for cell in table.columns[column]]
        gaps = np.flatnonzero(rows[name].isin(_EMPTY))
        if gaps.size:
            problems.append(Problem(table.where(column, gaps), "an empty cell", fix="fill it in"))
    for name in table.columns.columns.intersection(_SINGLE):
        if len(kinds := {*table.texts(name)}) > 1:
            message, fix = f"holds several: {first_few(sorted(kinds))}", "one file for each"
            problems.append(Problem(table.where(name), message, "one", fix))
    if timed := [name for name in (*_HOURS, "time") if name in table.columns]:
        rows["hours"] = _hours(table, timed[0], problems)
    if "pose" in rows and not columns["visit"]:
        again = np.flatnonzero(rows["pose"] == rows["pose"].shift())
        if rows_are is None and again.size:
            where = f"{path}: {table.rows_in_words(again)}"
            message, fix = (
                "the pose of the row before",
                "--rows visits, --rows stays or a column visit",
            )
            problems.append(Problem(where, message, "whether the arm left the pose", fix))
        if rows_are != "stays":
            rows["visit"] = rows.index
    if not problems and rows["pose"].is_unique:
        problems.append(Problem(path, "no pose has more than one reading"))
    refuse(problems, f"{path} cannot be used")
    used = {axis.column for axis in axes}.union(*_NAMES.values(), _SINGLE, _HOURS, ["time"])
    if unused := [name for name in table.columns if name not in used]:
        click.echo(f"not used: {', '.join(unused)}", err=True)
    return table, position, rows, _steps_mm(table, axes)


def _hours(table: RawTable, name: str, problems: list[Problem]) -> np.ndarray:
    """Hours (n,) of the readings by a column of times."""
    if name in _HOURS:
        return numbers(table, name, problems) * _HOURS[name]
    texts = pd.Series(table.texts(name)).str.replace(r"^(\d):", r"0\1:", regex=True)
    texts = texts.where(~texts.str.match(r"\d\d:"), "2000-01-01T" + texts)
    times = pd.to_datetime(texts, format="ISO8601", utc=True, errors="coerce")
    if (bad := np.flatnonzero(times.isna())).size:
        message, allowed = f"no time: {texts[bad[0]]!r}", "2026-05-04T13:20:05 or 13:20:05"
        problems.append(Problem(table.where(name, bad), message, allowed))
    return ((times - times.min()) / pd.Timedelta(hours=1)).to_numpy()


def _steps_mm(table: RawTable, axes: Sequence[Place]) -> np.ndarray:
    """Steps (3,) of the values of the axes; of equal values, that of the other axes or digits."""
    cells = [(table.columns[axis.column], axis.factor) for axis in axes]
    steps = np.array([step_between(values, unit, table.decimal) for values, unit in cells])
    digits = max(smallest_step([values], unit, table.decimal) for values, unit in cells)
    return np.where(steps > 0.0, steps, steps.max() or digits)


def estimate(
    table: RawTable, position_mm: np.ndarray, rows: pd.DataFrame, resolution_mm: np.ndarray
) -> Repeatability:
    """Noise and repeatability of readings, see :func:`read_repeats`.

    InputError where readings of a pose are equal to the last digit.
    """
    keys = ["pose", "side", "visit"]
    groups = [rows.groupby(keys[:n], sort=False).ngroup().to_numpy() for n in (1, 2, 3)]
    read = Repeated(position_mm, *groups)
    poses = rows["pose"].unique()
    parts = checks.parts(read)
    noise = checks.noise_of(parts, resolution_mm)
    std, low, high = [np.full(3, np.nan)] * 3
    if noise is not None:
        std = noise.std_mm
        low, high = checks.limits(std, noise.freedom)
        if not (std > _LEAST_MM).all():
            raise InputError(Problem(table.path, "readings of a pose are equal to the last digit"))
    by_pose, ratio = checks.differ_by_pose(read, resolution_mm)
    result = checks.by_side(read)
    mean_mm, rp_mm = checks.pooled_rp(result)
    differ = None
    if by_pose < checks.UNEQUAL:
        worst = int(np.nanargmax(ratio))
        differ = f"Poses scatter differently (p = {by_pose:.2g}): pose {poses[worst]} "
        differ += f"{ratio[worst]:.2f} times as much as all."
    spans = rows.groupby("pose")["hours"].agg(["size", np.ptp])
    hours = float(spans["ptp"][spans["size"] > 1].median())
    result["pose"] = poses[result["pose"]]
    result["side"] = rows.drop_duplicates(keys[:2])["side"].replace("", None).to_numpy()
    remarks = [*_remarks(noise, rows, hours), *([differ] if differ else [])]
    if (far := checks.far_off(read)).size:
        remarks.append(f"Far from the other readings of its pose: {table.rows_in_words(far)}.")
    return Repeatability(
        FORMAT, table.path, len(poses), int(read.visit.max()) + 1, len(rows),
        noise, std, low, high, np.sqrt(np.diag(parts.instrument)), np.sqrt(np.diag(parts.visits)),
        np.sqrt(np.diag(parts.visits + parts.sides)), mean_mm, rp_mm,
        checks.between_sides_mm(read), by_pose, differ, resolution_mm, hours, tuple(remarks),
        result,
    )  # fmt: skip


def _remarks(noise: Noise | None, rows: pd.DataFrame, hours: float) -> Iterator[str]:
    """Conditions on the noise."""
    if noise is None:
        return
    if not noise.is_even:
        yield f"Axes differ (p = {noise.by_axis:.2g}): the noise is a covariance."
    if noise.freedom < ENOUGH:
        more = math.ceil((ENOUGH - noise.freedom) / (3.0 if noise.is_even else 1.0))
        yield (
            f"{noise.freedom:.0f} degrees of freedom ({FEWEST} required, {ENOUGH} recommended):"
            f" measure about {more} more visits."
        )
    if noise.rounded.any():
        yield "The noise is that of rounding."
    if (rows["side"] == "").all():
        yield "Sides of approach unknown: from all sides the noise may be larger."
    if not hours >= _A_DAY_H:
        when = "Times unknown" if math.isnan(hours) else f"A pose takes {60 * hours:.0f} min"
        yield f"{when}: over a day the noise may be larger."


def _lines(result: Repeatability) -> Iterator[str]:
    """The noise of a reading, its parts, and ISO 9283's repeatability."""
    if result.noise is None:
        yield "Noise of a reading: unknown. No pose was left and revisited."
    else:
        axes = [f"{size(std)} mm (95 %: {size(low)} to {size(high)} mm)" for std, low, high in
                zip(result.std_mm, result.std_low_mm, result.std_high_mm, strict=True)]  # fmt: skip
        noise = f"{axes[0]} per axis" if result.noise.is_even else ", ".join(axes)
        yield f"Noise of a reading: {noise}, {result.noise.freedom:.0f} degrees of freedom."
    instrument = per_axis_mm(result.instrument_std_mm)
    arm = "arm and instrument" if math.isnan(instrument) else "arm"
    parts = {
        "instrument": instrument,
        f"{arm} from one side": per_axis_mm(result.one_side_std_mm),
        f"{arm} from all sides": per_axis_mm(result.all_sides_std_mm),
    }
    known = [f"{name} {size(std)} mm" for name, std in parts.items() if math.isfinite(std)]
    yield f"Standard deviations per axis: {', '.join(known)}."
    if math.isfinite(result.rp_mm):
        fewest = result.rows["visits"][result.rows["rp_mm"].notna()].min()
        few = f" ({_USUAL_VISITS} visits required, fewest {fewest})"
        few = few if fewest < _USUAL_VISITS else ""
        yield f"ISO 9283 RP over all poses: {size(result.rp_mm)} mm{few}."

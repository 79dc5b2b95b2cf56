"""``kinacc repeatability``: noise of readings, and repeatability of arm and instrument."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from kinacc.cli.choice import option
from kinacc.cli.output import answers

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from kinacc.checks.repeatability import Noise
    from kinacc.cli.repeated_rows import Rows

_A_DAY_H = 1.0  # readings of a pose within less time do not show the changes of a day
_USUAL_VISITS = 30  # of each pose, by ISO 9283
_LEAST_MM = 1e-6  # no instrument scatters less


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
    from kinacc.cli import repeated_rows

    rows = repeated_rows.of_file(file, rows_are)
    if rows.unused:
        click.echo(f"not used: {', '.join(rows.unused)}", err=True)
    result = estimate(rows)
    out.show(result, result.rows, [*_lines(result), *result.remarks])


def estimate(rows: Rows) -> Repeatability:
    """Noise and repeatability of readings. InputError where these are equal to the last digit."""
    import numpy as np
    import pandas as pd

    from kinacc.campaign.known_noise import FORMAT
    from kinacc.checks import repeatability as checks
    from kinacc.errors import InputError, Problem

    parts = checks.parts(rows.read)
    noise = checks.noise_of(parts, rows.resolution_mm)
    std, low, high = [np.full(3, np.nan)] * 3
    if noise is not None:
        std = noise.std_mm
        low, high = checks.limits(std, noise.freedom)
        if not (std > _LEAST_MM).all():
            what = "readings of a pose are equal to the last digit"
            raise InputError(Problem(rows.path, what, fix="give readings, not copies"))
    by_pose, ratio = checks.differ_by_pose(rows.read, rows.resolution_mm)
    mean_mm, rp_mm = checks.pooled_rp(rows.read)
    differ, hours = None, math.nan
    if rows.hours is not None:
        spans = pd.Series(rows.hours).groupby(rows.read.pose).agg(["size", np.ptp])
        hours = float(spans["ptp"][spans["size"] > 1].median())
    if by_pose < checks.UNEQUAL:
        worst = int(np.nanargmax(ratio))
        differ = f"Poses scatter differently (p = {by_pose:.2g}): pose {rows.poses[worst]} "
        differ += f"{ratio[worst]:.2f} times as much as all."
    groups = checks.groups(rows.read)
    table = pd.DataFrame(groups).drop(columns="std_mm")
    table[["std_x_mm", "std_y_mm", "std_z_mm"]] = [group.std_mm for group in groups]
    table["pose"] = np.array(rows.poses, dtype=object)[table["pose"]]
    table["side"] = None if rows.sides is None else np.array(rows.sides, object)[table["side"]]
    return Repeatability(
        FORMAT, rows.path, len(rows.poses), int(rows.read.visit.max()) + 1, len(rows.read.pose),
        noise, std, low, high, np.sqrt(np.diag(parts.instrument)), np.sqrt(np.diag(parts.visits)),
        np.sqrt(np.diag(parts.visits + parts.sides)), mean_mm, rp_mm,
        checks.between_sides_mm(rows.read), by_pose, differ, rows.resolution_mm, hours,
        (*_remarks(rows, noise, hours), *filter(None, [differ])), table,
    )  # fmt: skip


def _remarks(rows: Rows, noise: Noise | None, hours: float) -> Iterator[str]:
    """Conditions on the noise."""
    from kinacc.assess.noise import ENOUGH, FEWEST
    from kinacc.checks.repeatability import far_off
    from kinacc.errors import first_few

    if noise is not None:
        if not noise.is_even:
            yield f"Axes differ (p = {noise.by_axis:.2g}): the noise is a covariance."
        if noise.freedom < ENOUGH:
            more = math.ceil((ENOUGH - noise.freedom) / (3.0 if noise.is_even else 1.0))
            yield (
                f"{noise.freedom:.0f} degrees of freedom ({FEWEST} required, {ENOUGH} recommended):"
                f" measure about {more} more visits."
            )
        if noise.rounded.any():
            yield f"The noise is that of rounding ({max(rows.resolution_mm):.3g} mm steps)."
        if rows.sides is None:
            yield "Sides of approach unknown: from all sides the noise may be larger."
        if not hours >= _A_DAY_H:
            when = "Times unknown" if math.isnan(hours) else f"A pose takes {60 * hours:.0f} min"
            yield f"{when}: over a day the noise may be larger."
    far = far_off(rows.read)
    if far.size:
        names = first_few([rows.row_names[row] for row in far])
        yield f"Far from the other readings of its pose: {names}. Check these rows."


def _lines(result: Repeatability) -> Iterator[str]:
    """The noise of a reading, its parts, and ISO 9283's repeatability."""
    from kinacc.calibration.noise import per_axis_mm
    from kinacc.report.terminal import size

    if result.noise is None:
        yield "Noise of a reading: unknown. No pose was left and revisited."
    else:
        axes = [f"{size(std)} mm (95 %: {size(low)} to {size(high)} mm)" for std, low, high in
                zip(result.std_mm, result.std_low_mm, result.std_high_mm, strict=True)]  # fmt: skip
        each = f"{axes[0]} per axis" if result.noise.is_even else ", ".join(axes)
        yield f"Noise of a reading: {each}, {result.noise.freedom:.0f} degrees of freedom."
    instrument, *arm = map(
        per_axis_mm, (result.instrument_std_mm, result.one_side_std_mm, result.all_sides_std_mm)
    )
    whose = "arm and instrument" if math.isnan(instrument) else "arm"
    parts = {"instrument": instrument} | dict(
        zip((f"{whose} from one side", f"{whose} from all sides"), arm, strict=True)
    )
    known = [f"{name} {size(std)} mm" for name, std in parts.items() if math.isfinite(std)]
    yield f"Standard deviations per axis: {', '.join(known)}."
    if math.isfinite(result.rp_mm):
        fewest = result.rows["visits"][result.rows["rp_mm"].notna()].min()
        few = f" ({_USUAL_VISITS} visits required, fewest {fewest})"
        few = few if fewest < _USUAL_VISITS else ""
        yield f"ISO 9283 RP over all poses: {size(result.rp_mm)} mm{few}."

"""Single readings that are off: which of the known faults would explain each of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from kinacc.checks import changes, robust_fit, tails
from kinacc.checks.changes import Change
from kinacc.checks.findings import Finding, finding
from kinacc.checks.readings import Readings
from kinacc.checks.robust_fit import Fitted
from kinacc.config.measured import Orientation
from kinacc.kinematics.robot import Robot


def explained(fitted: Fitted, robot: Robot, stated: Orientation) -> Iterator[Finding]:
    """Findings of all bad readings, one per kind of explanation; the rest are outliers."""
    bad = open_rows = np.flatnonzero(fitted.bad)
    observed, lines = fitted.readings.select(bad), fitted.readings.lines
    for change in _explanations(fitted, observed, robot, stated) if bad.size else ():
        remaining = robust_fit.residuals(fitted.trial.arm, change.of(observed))
        near = np.linalg.norm(remaining.position_mm, axis=1) <= fitted.limit_mm
        near &= ~(np.linalg.norm(remaining.turn_rad, axis=1) > fitted.limit_rad)
        rows = np.intersect1d(open_rows, bad[near])
        if rows.size:
            item = replace(change.finding, fix="correct these rows, or exclude them", values={})
            largest_mm = float(fitted.left_mm[rows].max())
            yield item.of_lines(lines(rows), " in these rows", largest_error_mm=largest_mm)
            open_rows = np.setdiff1d(open_rows, rows)
    if open_rows.size:
        left_mm, angle = fitted.left_mm[open_rows], fitted.left_rad[open_rows].max()
        yield finding(
            "outliers",
            lines(open_rows),
            count=open_rows.size,
            turned=f" and {1e3 * angle:.3g} mrad" if angle > fitted.limit_rad else "",
            row=observed.row_names.one(fitted.readings.line[open_rows[np.argmax(left_mm)]]),
            largest_mm=float(left_mm.max()),
            limit_mm=fitted.limit_mm,
        )


def _explanations(
    fitted: Fitted, observed: Readings, robot: Robot, stated: Orientation
) -> Iterator[Change]:
    """Every known fault of the readings ``observed``."""
    yield from changes.joint_units(robot)
    yield from changes.length_units()
    yield Change(
        finding("commanded_joints/better"),
        lambda read: replace(read, q_rad=robot.dh_joints(read.commanded)),
    )
    yield from changes.orientations(stated) if observed.has_rotation.any() else ()
    yield from changes.wrong_axes()
    yield from (_swapped(fitted.readings, n) for n in np.unique(fitted.readings.target))
    yield Change(finding("rows_exchanged"), lambda read: _of_other_rows(fitted, read))
    yield from changes.joint_signs(robot)


def _swapped(observed: Readings, target: int) -> Change:
    """Readings that are of a target in truth; those that say so are made to fit nothing."""

    def of(read: Readings) -> Readings:
        others = (read.target != target)[:, None]
        position_mm = np.where(others, read.position_mm, np.inf)
        return replace(read, position_mm=position_mm, target=np.full_like(read.target, target))

    return Change(finding("target_swapped", target=observed.target_names[target]), of)


def _of_other_rows(fitted: Fitted, read: Readings) -> Readings:
    """Joints with the reading, of another row, that is nearest to where they put the target."""
    predicted = robust_fit.residuals(fitted.trial.arm, read).predicted
    nearest = cKDTree(read.position_mm).query(predicted.position_mm)[1]
    return replace(read, position_mm=read.position_mm[nearest], rotation=read.rotation[nearest])


def largest(fitted: Fitted) -> Iterator[Finding]:
    """Readings that are no outliers, and stand apart from the others all the same."""
    good = np.flatnonzero(~fitted.bad)
    by_pose = pd.Series(fitted.left_mm[good]).groupby(fitted.readings.pose[good])
    worst = np.sort(by_pose.max())[::-1]
    if count := tails.detached(worst):
        yield finding(
            "largest_rows",
            fitted.readings.lines(good[by_pose.transform("max") >= worst[count - 1]]),
            count=count,
            errors=", ".join(f"{value:.3g}" for value in worst[:count]),
            next=f"{worst[count]:.3g}",
        )

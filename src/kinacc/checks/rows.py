"""Single readings that are off: which of the known faults would explain each of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy import ndarray

from kinacc.checks import meanings, orientations, robust_fit
from kinacc.checks.findings import Finding, finding
from kinacc.checks.meanings import Meaning
from kinacc.checks.readings import Readings
from kinacc.checks.robust_fit import Fitted
from kinacc.measurements.layout import Layout


def explained(fitted: Fitted, meaning: Meaning, layout: Layout) -> list[Finding]:
    """Findings of all bad readings, one per kind of explanation; the rest are outliers."""
    bad = np.flatnonzero(fitted.bad)
    if not bad.size:
        return []
    open_rows, findings, lines = bad, [], fitted.readings.lines
    for change, observed in _explanations(fitted, meaning, layout, bad):
        remaining = robust_fit.residuals(fitted.trial.arm, observed)
        near = np.linalg.norm(remaining.position_mm, axis=1) <= fitted.limit_mm
        near &= ~(np.linalg.norm(remaining.turn_rad, axis=1) > fitted.limit_rad)
        rows = np.intersect1d(open_rows, bad[near])
        if rows.size:
            change = replace(change, fix="correct these rows, or exclude them", values={})
            largest_mm = float(fitted.left_mm[rows].max())
            findings.append(
                change.of_lines(lines(rows), " in these rows", largest_error_mm=largest_mm)
            )
            open_rows = np.setdiff1d(open_rows, rows)
    stale = open_rows[fitted.readings.earlier[open_rows] > 0]
    if stale.size:
        findings.append(finding("repeated_reading/off", lines(stale), count=stale.size))
        open_rows = np.setdiff1d(open_rows, stale)
    return [*findings, *_outliers(fitted, open_rows)]


def _explanations(
    fitted: Fitted, meaning: Meaning, layout: Layout, rows: ndarray
) -> Iterator[tuple[Finding, Readings]]:
    """Every known fault undone in the readings ``rows``."""
    observed = fitted.readings.select(rows)

    def moved(position_mm: ndarray, rotation: ndarray = observed.rotation) -> Readings:
        return replace(observed, position_mm=position_mm, rotation=rotation)

    for unit, stated, _, factor in orientations.ANGLE_UNITS:
        q = observed.q * np.where(meaning.unit == 1.0, factor, 1.0)
        change = finding("joint_units", unit=unit, stated=stated, short="")
        yield change, replace(observed, q_rad=meaning.joints(q))
    for change, factor in meanings.LENGTHS:
        yield change, moved(factor * observed.position_mm)
    yield (
        finding("commanded_joints/better"),
        replace(observed, q_rad=meaning.joints(observed.commanded)),
    )
    there = observed.has_rotation
    turns = observed.turns[there]
    for way in orientations.simple(layout.orientation, turns) if there.any() else ():
        rotation = observed.rotation.copy()
        rotation[there] = way.read(turns)
        yield way.change, moved(observed.position_mm, rotation)
    for mirror, name in zip(1.0 - 2.0 * np.eye(3), "xyz", strict=True):
        change, position_mm = finding("left_handed/axis", axis=name), observed.position_mm * mirror
        yield change, moved(position_mm)
        yield change, moved(position_mm, observed.rotation * np.outer(mirror, mirror))
    for target in np.unique(fitted.readings.target):
        # Readings of the target itself are made to fit nothing.
        others = (observed.target != target)[:, None]
        swapped = moved(np.where(others, observed.position_mm, np.inf))
        change = finding("target_swapped", target=observed.target_names[target])
        yield change, replace(swapped, target=np.full_like(observed.target, target))
    for second in meanings.single(meaning, fitted.trial.nominal.prismatic):
        change = second.changes[-1]
        beside = change.values.get("other") in (2, change.values["joint"] - 1)
        if change.kind == "joint_sign" or (change.kind == "joint_coupling" and beside):
            yield change, replace(observed, q_rad=second.joints(observed.q))


def _outliers(fitted: Fitted, rows: ndarray) -> Iterator[Finding]:
    """What no fault explains."""
    observed = fitted.readings
    if rows.size:
        worst, angle = rows[np.argmax(fitted.left_mm[rows])], fitted.left_rad[rows].max()
        yield finding(
            "outliers",
            observed.lines(rows),
            count=rows.size,
            turned=f" and {1e3 * angle:.3g} mrad" if angle > fitted.limit_rad else "",
            row=observed.row_names.one(observed.line[worst]),
            largest_mm=float(fitted.left_mm[worst]),
            limit_mm=fitted.limit_mm,
        )

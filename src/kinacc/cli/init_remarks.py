"""Remarks on a file that nothing contradicts: points that were calculated, rounded joints."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from kinacc.checks import digits
from kinacc.checks.report import Report
from kinacc.kinematics.robot import Robot
from kinacc.measurements.intake.guess import Guess
from kinacc.measurements.reader import MeasuredFile

_CALCULATED_MM = 0.002  # closer to an arm than any instrument measures
_FINE_MM = 0.01  # coarser steps would hide what instruments measure
_ROUNDED_MM = 0.02  # rms; less is nothing beside what instruments measure with


def remarks_on(guess: Guess, report: Report, reading: MeasuredFile, arm: Robot) -> Iterator[str]:
    """What limits the use of the readings."""
    cells, decimal = guess.table.columns, guess.table.decimal
    targets = guess.columns.targets.values()
    points = [cells[target[axis].column] for target in targets for axis in "xyz"]
    unit = 1.0 if guess.section["length_unit"] == "mm" else 1000.0
    step = digits.smallest_step(points, unit, decimal)
    fit = report.facts.get("quick_fit")
    residual = fit["left_per_axis_mm"] if isinstance(fit, Mapping) else np.inf
    # Rounding alone leaves 0.3 of a step.
    if residual <= max(_CALCULATED_MM, 0.4 * min(step, _FINE_MM)):
        yield (
            f"the points follow the joints to {residual:.1g} mm, closer than instruments measure:"
            " were they calculated by the controller or a simulation?"
        )
    if guess.section.get("pulses_per_deg") or arm.dh.prismatic.any():
        return
    unit = 1.0 if guess.section["joint_unit"] == "deg" else 180.0 / np.pi
    joints = [cells[name.column] for name in guess.columns.joints]
    step = digits.smallest_step(joints, unit, decimal)
    if step > 0.0:
        q = np.stack([reading.columns[f"q{i + 1}"] for i in range(guess.joints)], axis=1)
        reach_mm, rms_mm = digits.cost(arm.dh, arm.dh_joints(q), step)
        if rms_mm >= _ROUNDED_MM:
            yield (
                f"joints are written in steps of {step:.2g} deg: "
                f"{reach_mm * np.deg2rad(step):.2g} mm at {reach_mm / 1000.0:.2g} m from an axis, "
                f"{rms_mm:.2g} mm rms in all; export more digits"
            )

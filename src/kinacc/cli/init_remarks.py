"""What has to be said of a file beside what it holds, though nothing contradicts it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kinacc.checks.report import Report
    from kinacc.kinematics.robot import Robot
    from kinacc.measurements.intake.guess import Guess
    from kinacc.measurements.reader import MeasuredFile

_CALCULATED_MM = 0.002  # closer to an arm than any instrument measures
_FINE_MM = 0.01  # coarser steps would hide what instruments measure
_ROUNDED_MM = 0.02  # rms; less is nothing beside what instruments measure with


def remarks_on(guess: Guess, report: Report | None) -> list[str]:
    """What has to be said of the points though nothing contradicts them."""
    from kinacc.checks.digits import smallest_step

    fit = report.facts.get("quick_fit") if report else None
    left = fit["left_per_axis_mm"] if isinstance(fit, Mapping) else None
    points = [target[axis].column for target in guess.columns.targets.values() for axis in "xyz"]
    unit = 1.0 if guess.section["length_unit"] == "mm" else 1000.0
    step = smallest_step([guess.table.columns[name] for name in points], unit, guess.table.decimal)
    # Rounding alone leaves 0.3 of a step.
    if left is None or left > max(_CALCULATED_MM, 0.4 * min(step, _FINE_MM)):
        return []
    return [
        f"the points follow the joints to {left:.1g} mm, closer than an instrument measures: they "
        "may be the controller's own kinematics or a simulation, computed from the joints and not "
        "measured; then they say nothing of the arm"
    ]


def rounded(guess: Guess, reading: MeasuredFile, arm: Robot) -> list[str]:
    """What rounding the joints costs, in words, where it costs anything that matters."""
    import numpy as np

    from kinacc.checks import digits

    if guess.section.get("pulses_per_deg") or arm.dh.prismatic.any():
        return []
    unit = 1.0 if guess.section["joint_unit"] == "deg" else 180.0 / np.pi
    cells = [guess.table.columns[name.column] for name in guess.columns.joints]
    step = digits.smallest_step(cells, unit, guess.table.decimal)
    if step <= 0.0:
        return []
    q = np.stack([reading.columns[f"q{i + 1}"] for i in range(guess.joints)], axis=1)
    cost = digits.cost(arm.dh, q @ np.asarray(arm.joint_map).T, step)
    if cost.rms_mm < _ROUNDED_MM:
        return []
    return [
        f"joints are written in steps of {step:.2g} deg: {cost.step_mm:.2g} mm at "
        f"{cost.reach_mm / 1000.0:.2g} m from an axis. Rounding all joints puts a flange off by "
        f"{cost.rms_mm:.2g} mm rms, {cost.most_mm:.2g} mm at most: export more digits"
    ]

"""What is in a file: poses, targets, repeats, coverage of the joints, noise."""

from __future__ import annotations

import numpy as np

from kinacc.calibration.noise import Noise
from kinacc.checks.cells import Cells
from kinacc.checks.fitting import Fitted
from kinacc.checks.noise import Distance, Repeats
from kinacc.checks.suspicion import NOTE, Suspicion
from kinacc.kinematics.robot import Robot
from kinacc.measurements.reader import MeasuredFile
from kinacc.tables.allowed import LEFT_OUT

_WEAK = 0.1  # of a joint's range


def facts_of(
    every: Cells,
    robot: Robot,
    noise: Noise,
    distances: list[Distance],
    fitted: Fitted | None,
) -> dict[str, object]:
    """What is there, by name; units stand in the names."""
    facts: dict[str, object] = {
        "robot": robot.name,
        "rows": int(np.unique(every.line).size),
        "poses": int(np.unique(every.pose).size),
        "readings": len(every),
        "orientations": int(every.turned.sum()),
        "targets": {
            name: f"{int(np.sum(every.target == i))} readings"
            for i, name in enumerate(every.target_names)
        },
    }
    if len(every.session_names) > 1:
        facts["sessions"] = {
            name: f"{int(np.sum(every.session == i))} readings"
            for i, name in enumerate(every.session_names)
        }
    facts["joint_coverage"] = _coverage(every, robot)
    if noise.freedom:
        facts["noise"] = {
            "std_mm": [float(value) for value in noise.std_mm],
            "per_axis_mm": noise.per_axis_mm,
            "readings": noise.readings,
            "configurations": noise.configurations,
            "degrees_of_freedom": noise.freedom,
        }
    if distances:
        facts["target_distances"] = [
            {
                "from": every.target_names[each.one],
                "to": every.target_names[each.other],
                "mm": each.middle_mm,
                "std_mm": each.std_mm,
                "noise_per_target_mm": each.std_mm / np.sqrt(2.0),
            }
            for each in distances
        ]
    if fitted is not None:
        facts["quick_fit"] = {
            "left_per_axis_mm": fitted.trial.sigma_mm,
            "most_expected_mm": fitted.limit_mm,
        }
        if np.isfinite(fitted.trial.sigma_rad):
            facts["quick_fit"]["left_per_axis_mrad"] = 1e3 * fitted.trial.sigma_rad
    return facts


def _coverage(every: Cells, robot: Robot) -> list[dict[str, object]]:
    """What every joint went through and may go through."""
    found = []
    for joint in range(robot.dh.joints):
        slides = robot.dh.prismatic[joint]
        factor, unit = (1.0, "mm") if slides else (np.pi / 180.0, "deg")
        low, high = every.q[:, joint].min() / factor, every.q[:, joint].max() / factor
        least, most = robot.q_min_rad[joint] / factor, robot.q_max_rad[joint] / factor
        found.append(
            {
                "joint": joint + 1,
                "low": float(low),
                "high": float(high),
                "least": float(least),
                "most": float(most),
                "unit": unit,
                "share": float((high - low) / (most - least)),
            }
        )
    return found


def coverage_of(coverage: list[dict[str, object]]) -> tuple[Suspicion, ...]:
    """A note on every joint that hardly moves."""
    return tuple(
        Suspicion(
            "thin_coverage",
            f"joint {joint['joint']} moves through {100 * joint['share']:.2g} % of its range "
            "only: what belongs to it is weakly determined",
            (),
            "measure poses in which it moves further",
            {"joint": joint["joint"], "share": joint["share"]},
            NOTE,
        )
        for joint in coverage
        if joint["share"] < _WEAK
    )


def left_out(reading: MeasuredFile) -> tuple[Suspicion, ...]:
    """A note on everything in the file that is not used: rows first, columns last."""
    told = dict.fromkeys((*reading.notes, *reading.left_out()))
    return tuple(Suspicion(LEFT_OUT, words, (), level=NOTE) for words in told)


def remarks_of(
    every: Cells, repeats: Repeats, noise: Noise, distances: list[Distance]
) -> tuple[str, ...]:
    """What else to know about the file, in words."""
    remarks = []
    if len(every.target_names) > 1:
        how = (
            f": their repeats go together (correlation {repeats.common:.2f})"
            if np.isfinite(repeats.common)
            else ""
        )
        remarks.append(
            f"targets of one pose share the arm's error and are no independent samples{how}"
        )
    if repeats.groups and distances:
        between = float(np.median([each.std_mm for each in distances])) / np.sqrt(2.0)
        whole = noise.per_axis_mm
        if between < 0.5 * whole:
            remarks.append(
                f"repeats scatter by {whole:.3g} mm per axis, targets against each other by only "
                f"{between:.3g} mm: the scatter is the arm's or the set-up's, not the instrument's"
            )
    return tuple(remarks)

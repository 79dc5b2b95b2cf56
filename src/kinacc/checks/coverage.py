"""What is in a file: poses, targets, noise, coverage of the joints; and where it is too little."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from kinacc.calibration.noise import Noise
from kinacc.calibration.observations import from_columns
from kinacc.calibration.vec_estimator import VECEstimator
from kinacc.checks.distances import Distance
from kinacc.checks.findings import Finding, finding
from kinacc.checks.readings import Readings
from kinacc.checks.robust_fit import Fitted
from kinacc.config.records import Settings
from kinacc.geometry import compose
from kinacc.kinematics import dh
from kinacc.kinematics.robot import Robot, carried
from kinacc.measurements import folds
from kinacc.tables.columns import Columns

_WEAK = 0.1  # of a joint's range
# Of the largest residual expected: larger jumps of the base were found in four files, two of them
# measured; in one of these a jump of a third less stayed unfound.
_SMALLEST_MOVE = 1.5
_ELSEWHERE_MM = 50.0  # no arm is so far from its description
_PER_POSE = 6  # independent numbers of a rigid body, however many targets it carries


def facts_of(
    every: Readings, robot: Robot, noise: Noise, distances: list[Distance], fitted: Fitted | None
) -> dict[str, Any]:
    """What is there, by name; units stand in the names."""
    facts: dict[str, Any] = {
        "robot": robot.name,
        "rows": int(np.unique(every.line).size),
        "poses": int(np.unique(every.pose).size),
        "readings": len(every),
        "orientations": int(every.has_rotation.sum()),
        "targets": _counts(every.target_names, every.target),
    }
    if len(every.session_names) > 1:
        facts["sessions"] = _counts(every.session_names, every.session)
    facts["joint_coverage"] = [_covered(every.q[:, i], robot, i) for i in range(robot.dh.joints)]
    if noise.freedom:
        facts["noise"] = {
            "std_mm": noise.std_mm.tolist(),
            "per_axis_mm": noise.per_axis_mm,
            "readings": noise.readings,
            "configurations": noise.configurations,
            "degrees_of_freedom": noise.freedom,
        }
    if distances:
        facts["target_distances"] = [
            {
                "from": every.target_names[item.ends[0]],
                "to": every.target_names[item.ends[1]],
                "mm": item.middle_mm,
                "std_mm": item.std_mm,
                "noise_per_target_mm": item.std_mm / np.sqrt(2.0),
            }
            for item in distances
        ]
        if noise.freedom:
            between_mm = float(np.median([item.std_mm for item in distances])) / np.sqrt(2.0)
            facts["noise"]["between_targets_mm"] = between_mm
    if fitted is not None:
        facts["quick_fit"] = {
            "left_per_axis_mm": fitted.trial.sigma_mm,
            "most_expected_mm": fitted.limit_mm,
            "smallest_move_mm": _SMALLEST_MOVE * fitted.limit_mm,
        }
        if np.isfinite(fitted.trial.sigma_rad):
            facts["quick_fit"]["left_per_axis_mrad"] = 1e3 * fitted.trial.sigma_rad
    return facts


def _counts(names: tuple[str | None, ...], number: np.ndarray) -> dict[str | None, str]:
    return {name: f"{np.sum(number == i)} readings" for i, name in enumerate(names)}


def _covered(q: np.ndarray, robot: Robot, joint: int) -> dict[str, object]:
    """What a joint went through, ``q`` (n,), and may go through."""
    ends = np.array([q.min(), q.max(), robot.q_min_rad[joint], robot.q_max_rad[joint]])
    slides = bool(robot.dh.prismatic[joint])
    low, high, least, most = (ends if slides else np.rad2deg(ends)).tolist()
    return {
        "joint": joint + 1,
        "low": low,
        "high": high,
        "least": least,
        "most": most,
        "unit": "mm" if slides else "deg",
        "share": (high - low) / (most - least),
    }


def thin(coverage: list[dict[str, Any]]) -> list[Finding]:
    """A note on every joint that hardly moves."""
    return [
        finding(
            "thin_coverage",
            joint=item["joint"],
            share=item["share"],
            percent=f"{100.0 * item['share']:.2g}",
        )
        for item in coverage
        if item["share"] < _WEAK
    ]


def few_poses(columns: Columns, robot: Robot, calibration: Settings) -> list[Finding]:
    """Whether the VEC model has more coefficients than the poses give independent numbers."""
    observed = from_columns(columns, robot)
    fit = VECEstimator.of(calibration, robot, observed)
    frames = int(fit.common.frames(observed).free.sum())
    seen = pd.DataFrame({"target": observed.target, "turned": observed.has_rotation})
    poses = seen.groupby(folds.configurations(observed.pose, observed.q_rad))
    # A target adds three components to a pose, an orientation three; repeats add none.
    numbers = 3 * poses["target"].nunique() + 3 * poses["turned"].any()
    count = int(numbers.clip(upper=_PER_POSE).sum())
    if count >= frames + (0 if fit.open else fit.size):
        return []
    return [
        finding(
            "few_poses",
            poses=len(numbers),
            numbers=count,
            coefficients=fit.size,
            order=fit.order,
            frames=f" and {frames} of base and targets" if frames else "",
        )
    ]


def fixed_frames(columns: Columns, robot: Robot, calibration: Settings) -> list[Finding]:
    """Whether base and tool are held fixed, and the readings are elsewhere."""
    if calibration["base_and_tool"] != "fixed":
        return []
    observed = from_columns(columns, robot)
    end = compose(compose(robot.base, dh.forward(robot.dh, observed.q_rad)), carried(robot))
    apart = np.linalg.norm(end.position_mm - observed.position_mm, axis=1)
    if (apart_mm := float(np.median(apart))) < _ELSEWHERE_MM:
        return []
    return [finding("fixed_frames", apart_mm=apart_mm)]

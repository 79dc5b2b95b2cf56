"""Doubts about a campaign before it starts: its noise, and candidates far from the data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kinacc.calibration.noise import Noise, of_measurements
from kinacc.campaign.instrument import Instrument, noise
from kinacc.campaign.plan import Points
from kinacc.deployment.applicability import LIKE_FITTED, is_measured_there, position_std_mm
from kinacc.deployment.record import Calibration
from kinacc.errors import Problem
from kinacc.kinematics import robot
from kinacc.kinematics.model import JointState
from kinacc.tables import store

_MUCH_NOISE = 2.0  # times what the calibration left unexplained, noise included
_MUCH_NOISE_MM = 1.0  # where nothing is known of the calibration
_LITTLE_NOISE = 0.8  # of the scatter that was measured
_FEWEST_FREEDOM = 10  # degrees of freedom that show a noise
_FAR_SHARE = 0.1  # of the candidates
WAYS_TO_NOISE = """give it in one of three ways:
      a test (the surest): visit 20 poses three times each, leaving them between,
        run kinacc repeatability FILE -o noise.json, then --repeatability noise.json
      an estimate: --noise-mm MM --noise estimate (MM is a guess)
      a number: --noise-mm MM, or --covariance-mm2, or --instrument NAME=MM"""


def of_noise(instruments: Sequence[Instrument], left_mm: float = math.nan) -> list[Problem]:
    """Return a problem for noise larger than the rms error ``left_mm`` of the calibration."""
    known = math.isfinite(left_mm) and left_mm > 0.0
    most_mm = _MUCH_NOISE * left_mm if known else _MUCH_NOISE_MM
    than = f"than the {left_mm:.3g} mm that the calibration left" if known else "than trackers do"
    return [
        Problem(
            f"noise of {device.name}",
            f"{noise(device)}: the readings would scatter more {than}",
            "millimetres",
            "are micrometres meant? Then it is "
            f"{1e-3 * np.sqrt(np.diag(device.covariance_mm2)).max():g} mm. "
            "--sure takes it as it is",
        )
        for device in instruments
        if math.sqrt(np.trace(device.covariance_mm2)) > most_mm
    ]


def of_little_noise(instruments: Sequence[Instrument], known: Noise | None) -> list[Problem]:
    """Return a problem for noise smaller than that of the readings of the calibration."""
    if known is None or known.freedom < _FEWEST_FREEDOM:
        return []
    return [
        Problem(
            f"noise of {device.name}",
            f"{noise(device)}: readings of the calibration at equal joints scatter by "
            f"{known.per_axis_mm:.3g} mm per axis ({known.freedom} degrees of freedom)",
            fix=f"include how the arm repeats a pose: {known.per_axis_mm:.2g} mm or more; --sure "
            "takes it as it is",
        )
        for device in instruments
        if math.sqrt(np.trace(device.covariance_mm2) / 3.0) < _LITTLE_NOISE * known.per_axis_mm
    ]


def noise_of(results: Path) -> Noise | None:
    """Return the noise of the readings in a results folder; None where it has no readings."""
    paths = [results / f"{name}.parquet" for name in ("measurements", "robot")]
    if not all(path.is_file() for path in paths):
        return None
    measured, described = map(store.read, paths)
    arm = robot.of_text(str(described["description"][0]), "robot.parquet")
    return of_measurements(measured, arm)


def noise_by_repeats(known: Noise | None) -> str:
    """Return the scatter of repeated readings of a calibration; empty where there are too few."""
    if known is None or known.freedom < _FEWEST_FREEDOM or not (known.std_mm > 0.0).all():
        return ""
    std_mm = ",".join(f"{std:.2g}" for std in known.std_mm)
    return (
        f"{known.readings} readings of the calibration at {known.configurations} configurations "
        f"scatter by {std_mm} mm along x,y,z of the instrument: a lower limit of the noise"
    )


def far_from_data(arm: Calibration, points: Points, point: str | None) -> np.ndarray:
    """Return which candidates (m,) lie where the calibration was not measured."""
    if arm.known is None or arm.residual is None or not np.isfinite(arm.residual.position_mm):
        return np.zeros(len(points), dtype=bool)
    return ~is_measured_there(arm, _at(arm, points), point)


def of_candidates(arm: Calibration, points: Points, point: str | None) -> list[Problem]:
    """Return a problem where more than a tenth of the candidates lie far from measured poses."""
    far = int(np.sum(far_from_data(arm, points, point)))
    if far <= _FAR_SHARE * len(points):
        return []
    largest_mm = float(np.max(position_std_mm(arm, _at(arm, points), point)))
    message = (
        f"{far} of {len(points)} lie outside the joint ranges of the calibration, or have a larger "
        f"standard deviation than {LIKE_FITTED:.0%} of its poses (up to {largest_mm:.3g} mm)"
    )
    fix = "--region measured draws them between measured poses; --sure takes them as they are"
    return [Problem("candidates", message, f"at most {_FAR_SHARE:.0%} of them", fix)]


def _at(arm: Calibration, points: Points) -> JointState:
    return JointState(arm.robot.dh_joints(points.joints), points.directions)

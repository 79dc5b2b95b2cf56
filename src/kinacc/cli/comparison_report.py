"""What ``compare`` is given, and its answer as a sheet and in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from kinacc.cli import choice, rows
from kinacc.cli.sheet import Field, Sheet
from kinacc.deployment import shared_readings
from kinacc.deployment.compare import UNKNOWN, Difference, require_alike
from kinacc.deployment.folder import misfit_of
from kinacc.deployment.record import Calibration, nominal
from kinacc.deployment.shared_readings import NONE_SHARED, SharedReadings
from kinacc.errors import InputError, Problem
from kinacc.kinematics import robot as robots
from kinacc.kinematics.region import points
from kinacc.study.operating_points import spread_rows
from kinacc.tables.columns import Columns


def source(place: str, model: str, robot: str | None, config: tuple[str, ...]) -> Calibration:
    """A calibration from a results folder or a robot file."""
    path = Path(place)
    if path.is_dir():
        found = choice.calibration_of(path, model, robot, config)
        return replace(found, name=place, misfit=misfit_of(path, found.choice))
    if path.is_file() or place in robots.shipped():
        return replace(nominal(robots.load(place), place), choice="dh")
    raise InputError(Problem(place, "is not there", "a results folder, a robot file"))


def joints(
    calibrations: Sequence[Calibration], places: Sequence[str], path: str | None, count: int
) -> np.ndarray:
    """Reported joints (n, k) to compare at: of a file, as measured, or all over the limits.

    Raises InputError where the joints of the two do not mean the same.
    """
    require_alike(*calibrations)
    robot = calibrations[0].robot
    if path is not None:
        return rows.read(path, robot).joints
    names = [f"q{i + 1}" for i in range(robot.dh.joints)]
    tables = [table for place in places if (table := _measured(place)) is not None]
    if tables:
        found = [np.stack([t[name] for name in names], axis=1).astype(float) for t in tables]
        share = max(1, count // len(found))
        return np.concatenate([each[np.sort(spread_rows(len(each), share))] for each in found])
    low = np.maximum(calibrations[0].robot.q_min_rad, calibrations[1].robot.q_min_rad)
    high = np.minimum(calibrations[0].robot.q_max_rad, calibrations[1].robot.q_max_rad)
    return low + points("sobol", count, len(low)) * (high - low)


def shared(places: Sequence[str]) -> SharedReadings:
    """The readings that the calibrations of two results folders were both fitted to."""
    tables = [_measured(place) for place in places]
    if tables[0] is None or tables[1] is None:
        return NONE_SHARED
    from kinacc.tables import sums

    origins = [sums.read_by(_file(place).parent, "measurements") for place in places]
    same_file = bool(origins[0]) and origins[0] == origins[1]
    return shared_readings.shared(tables[0], tables[1], same_file)


def _file(place: str) -> Path:
    return Path(place) / "measurements.parquet"


def _measured(place: str) -> Columns | None:
    from kinacc.tables import store

    return store.read(_file(place)) if _file(place).is_file() else None


def answer(found: Difference) -> Sheet:
    """The sheet of ``kinacc compare``: one row per parameter, and what poses did as facts."""
    facts = {
        "first": found.names[0],
        "second": found.names[1],
        "model": found.model,
        "same_robot": found.same_robot,
        "verdict": None if found.verdict == UNKNOWN else found.verdict,
        "poses": int(found.covered.sum()),
        "poses_given": len(found.covered),
        "poses_measured_by_both": int(found.measured.sum()),
        "shared_readings": found.shared.count,
        "first_fitted_to": found.shared.first,
        "second_fitted_to": found.shared.second,
        "statistic": found.statistic,
        "directions": found.directions,
        "probability": found.probability,
        "standard_deviations": [each and each.as_facts() for each in found.misfits],
    }
    for name, shift in (("", found.as_they_stand), ("_apart_from_frames", found.apart_from_frames)):
        facts |= {
            f"moved_rms{name}_mm": shift.rms_mm,
            f"moved_max{name}_mm": float(shift.position_mm.max()),
            f"by_chance{name}_mm": shift.chance_mm,
            f"turned_rms{name}_mrad": 1e3 * shift.rms_rad,
            f"by_chance{name}_mrad": 1e3 * shift.chance_rad,
        }
    fields = []
    if found.parameters is not None:
        meanings = {
            "name": ("", "joint and parameter"),
            "unit": ("", "unit of the row"),
            "first": ("see unit", found.names[0]),
            "second": ("see unit", found.names[1]),
            "difference": ("see unit", "second minus first"),
            "std": ("see unit", "of the difference"),
            "sigmas": ("1", "difference in standard deviations"),
            "undetermined": ("", "calibration whose poses do not determine it"),
        }
        fields = [
            Field(
                {"name": "parameter"}.get(name, name), found.parameters[name].to_numpy(), *meaning
            )
            for name, meaning in meanings.items()
        ]
    return Sheet("{1} against {0}".format(*found.names), facts, fields, shown_rows=100)

"""What ``compare`` is given, and its answer as a sheet and in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from kinacc.artifacts.columns import Columns
from kinacc.calibration.uncertainty import unit_of
from kinacc.cli import choice, rows
from kinacc.cli.sheet import Field, Sheet, number
from kinacc.deployment import shared_readings
from kinacc.deployment.compare import Difference, Shift, require_alike
from kinacc.deployment.record import Calibration, nominal
from kinacc.deployment.shared_readings import NONE_SHARED, SharedReadings
from kinacc.errors import InputError, Problem
from kinacc.kinematics import robot as robots
from kinacc.kinematics.region import points
from kinacc.study.operating_points import spread_rows

_UNLIKELY = 0.001


def source(place: str, model: str, robot: str | None, config: tuple[str, ...]) -> Calibration:
    """A calibration from a results folder or a robot file."""
    path = Path(place)
    if path.is_dir():
        return replace(choice.calibration_of(path, model, robot, config), name=place)
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
    from kinacc.artifacts import store

    origins = {store.read_metadata(_file(place)).get("inputs_hash") for place in places}
    return shared_readings.shared(tables[0], tables[1], len(origins) == 1)


def _file(place: str) -> Path:
    return Path(place) / "measurements.parquet"


def _measured(place: str) -> Columns | None:
    from kinacc.artifacts import store

    return store.read(_file(place)) if _file(place).is_file() else None


def answer(found: Difference, calibrations: Sequence[Calibration], poses: int) -> Sheet:
    """The sheet of ``kinacc compare``: one row per parameter, and what poses did as facts."""
    facts = {
        "first": calibrations[0].name,
        "second": calibrations[1].name,
        "model": calibrations[0].choice,
        "same_robot": found.same_robot,
        "poses": poses,
        "shared_readings": found.shared.count,
        "first_fitted_to": found.shared.first,
        "second_fitted_to": found.shared.second,
        "statistic": found.statistic,
        "directions": found.directions,
        "probability": found.probability,
    }
    for name, shift in (("", found.as_they_stand), ("_apart_from_frames", found.apart_from_frames)):
        facts |= {
            f"moved_rms{name}_mm": shift.rms_mm,
            f"moved_max{name}_mm": float(shift.position_mm.max()),
            f"by_chance{name}_mm": shift.chance_mm,
            f"turned_rms{name}_mrad": 1e3 * shift.rms_rad,
            f"by_chance{name}_mrad": 1e3 * shift.chance_rad,
        }
    each = found.parameters
    fields = []
    if each is not None:
        units = [unit_of(name) for name in each.names]
        names = [
            name.rpartition("_")[0] if unit in ("rad", "mm") else name
            for name, unit in zip(each.names, units, strict=True)
        ]
        scale = np.where(np.array(units) == "rad", 1e3, 1.0)
        unit = np.array([{"rad": "mrad"}.get(unit, unit) for unit in units], dtype=object)
        fields = [
            Field("parameter", np.array(names, dtype=object), "", "joint and parameter"),
            Field("unit", unit, "", "unit of the row"),
            Field("first", each.first * scale, "see unit", calibrations[0].name),
            Field("second", each.second * scale, "see unit", calibrations[1].name),
            Field("difference", each.difference * scale, "see unit", "second minus first"),
            Field("std", each.std * scale, "see unit", "of the difference"),
            Field("sigmas", each.sigmas, "1", "difference in standard deviations"),
            Field("remark", _remarks(each), "", "where the poses do not determine it"),
        ]
    first, second = short_names(calibrations)
    return Sheet(f"{second} against {first}", facts, fields, shown_rows=100)


def short_names(calibrations: Sequence[Calibration]) -> tuple[str, str]:
    """Last parts of the places the calibrations come from, where these differ."""
    first, second = (Path(calibration.name).name for calibration in calibrations)
    return (first, second) if first != second else (calibrations[0].name, calibrations[1].name)


def in_words(found: Difference, calibrations: Sequence[Calibration]) -> str:
    """What moved, in sentences."""
    lines = _of_readings(found.shared, calibrations)
    if not found.same_robot:
        first, second = (calibration.robot.name for calibration in calibrations)
        lines.append(
            f"these are different robots ({first} and {second}): before any calibration they are "
            f"{number(found.robots_apart_mm)} mm rms apart, after the best base and tool; what "
            "follows is no change of one arm"
        )
    elif np.isfinite(found.probability):
        verdict = "the arm has changed" if found.probability < _UNLIKELY else "no change is proven"
        lines.append(
            f"{found.directions} directions both determine: squared distance "
            f"{found.statistic:.1f}, probability of more by chance {found.probability:.2g}: "
            f"{verdict}, if the residuals are independent noise"
        )
    words = "flange poses differ" if found.shared.all_of_both else "flange poses moved"
    lines.append(_moved(words, found.as_they_stand))
    lines.append(_moved("after the best base and tool", found.apart_from_frames))
    return "\n".join(lines)


def _of_readings(shared: SharedReadings, calibrations: Sequence[Calibration]) -> list[str]:
    """What readings in both calibrations mean for a verdict."""
    if not shared.count:
        return []
    if shared.all_of_both:
        return [
            f"both are fitted to the same {shared.count} readings: nothing can have moved between "
            "them; what differs comes from the settings of the fits"
        ]
    first, second = short_names(calibrations)
    return [
        f"{shared.count} readings are in both, of {shared.first} in {first} and {shared.second} in "
        f"{second}: they show no change, and are counted once"
    ]


def _moved(words: str, shift: Shift) -> str:
    by_chance = ""
    if np.isfinite(shift.chance_mm):
        chance = number(shift.chance_mm), number(1e3 * shift.chance_rad)
        by_chance = f" (by chance {chance[0]} mm, {chance[1]} mrad)"
    return (
        f"{words}: {number(shift.rms_mm)} mm rms, at most {number(shift.position_mm.max())} mm, "
        f"{number(1e3 * shift.rms_rad)} mrad rms{by_chance}"
    )


def _remarks(each) -> np.ndarray:
    words = {
        "": "",
        "first": "undetermined in the first",
        "second": "undetermined in the second",
        "both": "undetermined in both",
    }
    return np.array([words[where] for where in each.undetermined_in], dtype=object)

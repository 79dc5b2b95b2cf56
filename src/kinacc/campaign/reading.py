"""Readings: their error and covariance, and the checks before one is taken."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kinacc.campaign.instrument import INSTRUMENT, covariance_of
from kinacc.campaign.plan import Plan
from kinacc.errors import Problem

_FARTHEST_MM = 1e6  # no instrument measures an arm from a kilometre away
_USUAL_READINGS = 10  # that show which size is usual
_UNUSUAL, _FEWEST_SIGMAS = 6.0, 10.0  # times the median size, and standard deviations


@dataclass(frozen=True)
class Reading:
    """One reading as it goes into the journal.

    ``position_mm`` (3,) in the frame of ``instrument``; ``joints`` (k,) as the controller reported
    them (rad, mm), None where not noted; ``std``: 1, 3 or 9 numbers as text where the noise of this
    reading is not the instrument's.
    """

    point: int
    position_mm: np.ndarray
    instrument: str
    joints: np.ndarray | None = None
    std: str | None = None

    @property
    def digits(self) -> tuple:
        """Point, instrument and position to the last digit."""
        return self.point, self.instrument, *self.position_mm.tolist()

    def as_entry(self) -> dict:
        """Return the reading in plain numbers."""
        entry = {
            "point": self.point,
            "position_mm": [float(each) for each in self.position_mm],
            "instrument": self.instrument,
        }
        if self.joints is not None:
            entry["joints"] = [float(each) for each in self.joints]
        return entry | ({"std": self.std} if self.std is not None else {})

    @classmethod
    def of_entry(cls, entry: Mapping, plan: Plan) -> Reading:
        """Return the reading that ``as_entry`` wrote; ValueError where it is none of the plan."""
        joints = entry.get("joints")
        found = cls(
            int(entry["point"]),
            np.array(entry["position_mm"], dtype=float),
            entry["instrument"],
            None if joints is None else np.array(joints, dtype=float),
            entry.get("std"),
        )
        if not 0 <= found.point < len(plan.points) or faults_of(plan, found, ""):
            raise ValueError(f"no reading of this campaign: {entry}")
        plan.instrument(found.instrument)
        return found


def error_mm(plan: Plan, reading: Reading) -> np.ndarray:
    """Return measured minus modelled position (3,), robot's base."""
    measured = reading.position_mm
    if plan.instrument(reading.instrument).frame == INSTRUMENT:
        measured = plan.to_base.rotation @ measured + plan.to_base.position_mm
    return measured - plan.points.position_mm(reading.point, reading.joints)


def covariance_mm2(plan: Plan, reading: Reading) -> np.ndarray:
    """Return the covariance (3, 3) of the reading in the robot's base."""
    unplanned = unplanned_mm2(plan, reading)
    return plan.covariance_mm2[reading.point] if unplanned is None else unplanned


def unplanned_mm2(plan: Plan, reading: Reading) -> np.ndarray | None:
    """Return the covariance (3, 3) in the robot's base; None where it is the planned one."""
    instrument = plan.instrument(reading.instrument)
    if reading.std is not None:
        instrument = instrument.of_reading(covariance_of(reading.std, "reading", []))
    elif instrument is plan.instruments[0]:
        return None
    return instrument.in_base(plan.to_base, plan.points.modelled_mm[[reading.point]])[0]


def point_at(plan: Plan, joints: np.ndarray) -> int | None:
    """Return the candidate whose joints all lie within the tolerance of these (k,), or None."""
    apart = np.abs((joints - plan.points.joints) / _tolerance(plan)).max(axis=1)
    nearest = int(np.argmin(apart))
    return nearest if apart[nearest] <= 1.0 else None


def faults_of(plan: Plan, reading: Reading, where: str) -> list[Problem]:
    """Return why numbers cannot be a reading."""
    problems: list[Problem] = []
    for name, values, count in (
        ("measured position", reading.position_mm, 3),
        ("joints", reading.joints, len(plan.slides)),
    ):
        if values is None:
            continue
        if values.shape != (count,) or not (np.abs(values) <= _FARTHEST_MM).all():
            text = ", ".join(f"{each:g}" for each in values.ravel())
            allowed = f"{count} numbers within {_FARTHEST_MM:g}"
            problems.append(Problem(where, f"{name} ({text})", allowed))
    if reading.std is not None:
        covariance_of(reading.std, f"{where}, standard deviation", problems)
    return problems


def problems_of(
    plan: Plan, reading: Reading, where: str, most_mm: float, accept_implausible: bool = False
) -> list[Problem]:
    """Return everything that is wrong with a reading; errors above ``most_mm`` are implausible."""
    if problems := faults_of(plan, reading, where):
        return problems
    label = plan.points.label[reading.point]
    if reading.joints is not None:
        tolerance = _tolerance(plan)
        off = np.abs(reading.joints - plan.points.joints[reading.point]) / tolerance
        if off.max() > 1.0:
            worst = int(np.argmax(off))
            unit, factor = ("mm", 1.0) if plan.slides[worst] else ("deg", 180.0 / math.pi)
            known = point_at(plan, reading.joints)
            wanted = plan.points.joints[reading.point, worst] * factor
            return [
                Problem(
                    where,
                    f"joint {worst + 1} at {reading.joints[worst] * factor:.4f} {unit} is not that "
                    f"of point {label}",
                    f"{wanted:.4f} {unit} within {tolerance[worst] * factor:g} {unit}",
                    "" if known is None else f"these joints are point {plan.points.label[known]}",
                )
            ]
    size = float(np.linalg.norm(error_mm(plan, reading)))
    if size <= most_mm or accept_implausible:
        return []
    fix = (
        "check pose, target, unit and frame, and read again; --accept-implausible takes a reading "
        "that stands (dropping it for its size makes the bound wrong)"
    )
    what = f"{size:.3f} mm from the model at point {label}"
    return [Problem(where, what, f"at most {most_mm:.3g} mm", fix)]


def most_plausible_mm(plan: Plan, sizes_mm: Sequence[float]) -> float:
    """Return the largest error that is plausible after readings of ``sizes_mm``."""
    usable = [size for size in sizes_mm if np.isfinite(size)]
    if len(usable) < _USUAL_READINGS:
        return plan.limits.implausible_mm
    sigma = math.sqrt(np.trace(plan.covariance_mm2, axis1=1, axis2=2).max())
    unusual = max(_UNUSUAL * float(np.median(usable)), _FEWEST_SIGMAS * sigma)
    return min(plan.limits.implausible_mm, unusual)


def _tolerance(plan: Plan) -> np.ndarray:
    # A sliding joint may be off by as many mm as a turning one moves a point one metre away.
    return plan.limits.joint_rad * np.where(plan.slides, 1e3, 1.0)

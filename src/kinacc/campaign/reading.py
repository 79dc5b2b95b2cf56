"""Readings: what is checked before one is taken, and what it says of the model's error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kinacc.campaign.instrument import INSTRUMENT, covariance_of
from kinacc.campaign.plan import Plan
from kinacc.errors import Problem

_FARTHEST_MM = 1e6  # no instrument measures an arm from a kilometre away


@dataclass(frozen=True)
class Reading:
    """One reading as it goes into the journal.

    ``position_mm`` (3,) in the frame of ``instrument``; ``joints`` (k,) as the controller reported
    them on the spot, None where not noted; ``std`` is a text of 1, 3 or 9 numbers where this
    reading's noise is not the instrument's.
    """

    point: int
    position_mm: np.ndarray
    instrument: str
    joints: np.ndarray | None = None
    std: str | None = None

    def as_entry(self) -> dict:
        """The reading in plain numbers."""
        entry = {
            "point": self.point,
            "position_mm": [float(each) for each in self.position_mm],
            "instrument": self.instrument,
        }
        if self.joints is not None:
            entry["joints"] = [float(each) for each in self.joints]
        if self.std is not None:
            entry["std"] = self.std
        return entry

    @classmethod
    def of_entry(cls, entry: Mapping) -> Reading:
        """The reading that ``as_entry`` wrote."""
        joints = entry.get("joints")
        return cls(
            int(entry["point"]),
            np.array(entry["position_mm"], dtype=float),
            entry["instrument"],
            None if joints is None else np.array(joints, dtype=float),
            entry.get("std"),
        )


def error_mm(plan: Plan, reading: Reading) -> np.ndarray:
    """Measured minus modelled position (3,), robot's base."""
    measured = reading.position_mm
    if plan.instrument(reading.instrument).frame == INSTRUMENT:
        measured = plan.to_base.rotation @ measured + plan.to_base.position_mm
    return measured - plan.points.position_mm(reading.point, reading.joints)


def covariance_mm2(plan: Plan, reading: Reading) -> np.ndarray:
    """Covariance (3, 3) of the reading in the robot's base."""
    unplanned = unplanned_mm2(plan, reading)
    return plan.covariance_mm2[reading.point] if unplanned is None else unplanned


def unplanned_mm2(plan: Plan, reading: Reading) -> np.ndarray | None:
    """Covariance (3, 3) of the reading in the robot's base; None where it is the planned one."""
    instrument = plan.instrument(reading.instrument)
    if reading.std is not None:
        own = covariance_of(reading.std, "reading", [])
        instrument = instrument.of_reading(own)
    elif instrument is plan.instruments[0]:
        return None
    return instrument.in_base(plan.to_base, plan.points.modelled_mm[[reading.point]])[0]


def entry_faults(plan: Plan, reading: Reading) -> list[str]:
    """What keeps an entry of a journal from being a reading of this campaign."""
    known = {each.name for each in plan.instruments}
    joints, std = reading.joints, reading.std
    wrong: list[Problem] = []
    if std is not None:
        covariance_of(std, "standard deviation", wrong)
    faults = {
        f"point {reading.point}": 0 <= reading.point < len(plan.points),
        f"instrument {reading.instrument!r}": reading.instrument in known,
        f"position {reading.position_mm}": _is_place(reading.position_mm, 3),
        f"joints {joints}": joints is None or _is_place(joints, len(plan.slides)),
        f"standard deviation {std!r}": not wrong,
    }
    return [what for what, fits in faults.items() if not fits]


def _is_place(values: np.ndarray, count: int) -> bool:
    """Whether these are ``count`` numbers within all lengths and angles."""
    return values.shape == (count,) and bool((np.abs(values) <= _FARTHEST_MM).all())


def point_at(plan: Plan, joints: np.ndarray) -> int | None:
    """The candidate whose joints all lie within the tolerance of these (k,); None for none."""
    apart = np.abs(_in_tolerances(plan, joints)).max(axis=1)
    nearest = int(np.argmin(apart))
    return nearest if apart[nearest] <= 1.0 else None


def problems_of(
    plan: Plan,
    reading: Reading,
    where: str,
    left_out: frozenset[int] = frozenset(),
    accept_implausible: bool = False,
    unusual_mm: float = np.inf,
) -> list[Problem]:
    """Everything that speaks against taking a reading.

    ``unusual_mm``: size of an error beyond which a reading is asked about, being unlike the others.
    """
    problems = []
    label = plan.points.label[reading.point]
    if reading.point in left_out:
        problems.append(Problem(where, f"point {label} was left out of the campaign"))
    if not _is_place(reading.position_mm, 3):
        said = ", ".join(f"{each:g}" for each in reading.position_mm)
        allowed = f"three numbers within {_FARTHEST_MM:g} mm"
        problems.append(Problem(where, f"measured position ({said})", allowed))
    if reading.joints is not None:
        problems += _wrong_joints(plan, reading, where)
    if reading.std is not None:
        covariance_of(reading.std, f"{where}, standard deviation", problems)
    if problems or accept_implausible:
        return problems
    size = float(np.linalg.norm(error_mm(plan, reading)))
    if size > plan.limits.implausible_mm:
        problems.append(
            Problem(
                where,
                f"{size:.3f} mm from where the model has point {label}",
                f"at most {plan.limits.implausible_mm:g} mm",
                "another pose, target, unit or frame? If the reading was repeated and stands, "
                "give --accept-implausible: to drop it for its size would make the bound wrong",
            )
        )
    elif size > unusual_mm:
        problems.append(
            Problem(
                where,
                f"{size:.3f} mm from where the model has point {label}, unlike the readings so far",
                f"at most {unusual_mm:.3g} mm without being asked about",
                "read the point again; what stands is recorded with --accept-implausible: to drop "
                "it for its size would make the bound wrong",
            )
        )
    return problems


def _wrong_joints(plan: Plan, reading: Reading, where: str) -> list[Problem]:
    if not np.all(np.isfinite(reading.joints)):
        return [Problem(where, "joints that are no numbers", "finite numbers")]
    off = _in_tolerances(plan, reading.joints)[reading.point]
    if np.abs(off).max() <= 1.0:
        return []
    worst = int(np.argmax(np.abs(off)))
    unit, factor = ("mm", 1.0) if plan.slides[worst] else ("deg", 180.0 / np.pi)
    asked = plan.points.joints[reading.point, worst] * factor
    found = reading.joints[worst] * factor
    other = point_at(plan, reading.joints)
    hint = "" if other is None else f"these are the joints of point {plan.points.label[other]}"
    label = plan.points.label[reading.point]
    allowed = f"{asked:.4f} {unit} within {_tolerance(plan)[worst] * factor:g} {unit}"
    what = f"joint {worst + 1} at {found:.4f} {unit} is not that of point {label}"
    return [Problem(where, what, allowed, hint)]


def _in_tolerances(plan: Plan, joints: np.ndarray) -> np.ndarray:
    """Distance (m, k) of every candidate's joints from these, in tolerances."""
    return (joints - plan.points.joints) / _tolerance(plan)


def _tolerance(plan: Plan) -> np.ndarray:
    # A sliding joint may be off by as many mm as a turning one moves a point one metre away.
    return plan.limits.joint_rad * np.where(plan.slides, 1e3, 1.0)

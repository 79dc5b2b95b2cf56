"""Instruments of a campaign: each with the covariance of one reading, in a stated frame."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from kinacc.assess.adaptive import covariance_faults
from kinacc.campaign import laser_tracker
from kinacc.campaign.laser_tracker import LaserTracker
from kinacc.config.names import not_in_a_line
from kinacc.errors import Problem, refuse
from kinacc.geometry import Pose
from kinacc.measurements.table import numbers_of

BASE, INSTRUMENT = "base", "instrument"
FRAMES = (BASE, INSTRUMENT)
_FORMS = "1 standard deviation, 3 (x, y, z), or 9 numbers of a covariance in mm^2, row by row"
_EVEN = np.eye(3)
_ROUNDED = 1.0 / math.sqrt(12.0)  # standard deviation of what is rounded to steps of 1
_LARGEST_STD_MM = 1e3
_SMALLEST_STD_MM = 1e-9  # below the size of an atom; squares of less vanish


@dataclass(frozen=True)
class Instrument:
    """Covariance (3, 3) of one reading, mm^2, in the frame the instrument's readings are in.

    ``frame``: ``base``, the robot's own base, or ``instrument``, that of the calibration. With
    ``laser`` it hangs on the place, and ``covariance_mm2`` is the largest there is, in all
    directions alike. ``resolution_mm``: step in which readings are written, whose rounding the
    covariance holds; 0 where it is not stated.
    """

    name: str
    covariance_mm2: np.ndarray
    frame: str
    laser: LaserTracker | None = None
    resolution_mm: float = 0.0

    def in_base(self, to_base: Pose, at_mm: np.ndarray) -> np.ndarray:
        """Covariances (m, 3, 3) in the robot's base of readings at ``at_mm`` (m, 3) there.

        ``to_base`` takes the instrument's frame there.
        """
        turn = to_base.rotation
        if self.laser is not None:
            local = self.laser.covariance_mm2(from_head_mm(to_base, at_mm))
            turned = turn @ floored(local, self.resolution_mm) @ turn.T
            return 0.5 * (turned + np.swapaxes(turned, 1, 2))
        even = self.covariance_mm2[0, 0] * np.eye(3)
        if self.frame == BASE or np.array_equal(self.covariance_mm2, even):
            covariance = self.covariance_mm2  # turning equal noise would only add rounding
        else:
            turned = turn @ self.covariance_mm2 @ turn.T
            covariance = 0.5 * (turned + turned.T)
        return np.tile(covariance, (len(at_mm), 1, 1))

    def placed(self, to_base: Pose, at_mm: np.ndarray) -> Instrument:
        """The instrument with the largest covariance that it has at places (m, 3) in the base."""
        if self.laser is None:
            return self
        largest = self.laser.largest_mm(from_head_mm(to_base, at_mm))
        return replace(self, covariance_mm2=floored(largest**2 * np.eye(3), self.resolution_mm))

    def of_reading(self, covariance_mm2: np.ndarray) -> Instrument:
        """The same instrument with the covariance (3, 3) that a reading brings itself."""
        covariance = floored(covariance_mm2, self.resolution_mm)
        return replace(self, covariance_mm2=covariance, laser=None)


def floored(covariance_mm2: np.ndarray, resolution_mm: float) -> np.ndarray:
    """Covariances (..., 3, 3) with no variance of an axis below that of rounding to steps."""
    lacking = (_ROUNDED * resolution_mm) ** 2 - np.diagonal(covariance_mm2, axis1=-2, axis2=-1)
    if (lacking <= 0.0).all():
        return covariance_mm2
    return covariance_mm2 + np.maximum(lacking, 0.0)[..., None] * np.eye(3)


def from_head_mm(to_base: Pose, at_mm: np.ndarray) -> np.ndarray:
    """Places (m, 3) of the base in the instrument's frame, whose origin is a tracker's head."""
    return (at_mm - to_base.position_mm) @ to_base.rotation


def instruments(
    texts: Iterable[str], frame: str, resolution_mm: float = 0.0
) -> tuple[Instrument, ...]:
    """Instruments of arguments such as ``tracker=0.03`` or ``camera=0.1,0.1,0.3``.

    ``tracker=laser:..`` is read by :func:`kinacc.campaign.laser_tracker.of_text`. Raises
    InputError naming everything that is wrong with any of them.
    """
    devices: dict[str, Instrument] = {}
    problems: list[Problem] = []
    for text in texts:
        name, equals, numbers = text.partition("=")
        name = name.strip()
        if not equals or not name:
            problems.append(Problem("--instrument", repr(text), f"NAME={_FORMS}"))
            continue
        if name in devices:
            problems.append(Problem(f"instrument {name}", "is given twice"))
        problems += not_in_a_line("--instrument", name)
        where, laser = f"noise of {name}", None
        if numbers.strip().startswith(laser_tracker.PREFIX):
            laser = laser_tracker.of_text(numbers.strip(), where, problems)
            if laser is not None and frame == BASE:
                message = "a laser tracker's noise hangs on where it stands"
                problems.append(Problem(where, message, "--frame instrument"))
            covariance = None if laser is None else laser.largest_mm(np.zeros((1, 3))) ** 2 * _EVEN
        else:
            covariance = covariance_of(numbers, where, problems)
        if covariance is not None:
            total = floored(covariance, resolution_mm)
            devices[name] = Instrument(name, total, frame, laser, resolution_mm)
    refuse(problems, "These instruments cannot be used")
    return tuple(devices.values())


def covariance_of(text: str, where: str, problems: list[Problem]) -> np.ndarray | None:
    """Covariance (3, 3) of a text with 1, 3 or 9 numbers; None with what is wrong noted."""
    values = numbers_of(text)
    if values.size == 9:
        covariance = values.reshape(3, 3)
        faults = covariance_faults(covariance[None])
        fault = faults[0][1] if faults else ""
        allowed = "symmetric, positive definite, in mm^2"
    elif values.size in (1, 3):
        covariance = np.diag(np.broadcast_to(values, 3) ** 2)
        usable = (values >= _SMALLEST_STD_MM) & (values <= _LARGEST_STD_MM)
        fault = "" if usable.all() else f"standard deviation {text.strip()} mm"
        allowed = f"at least {_SMALLEST_STD_MM:g} mm, at most {_LARGEST_STD_MM:g} mm"
    else:
        covariance, fault, allowed = None, repr(text), _FORMS
    if fault:
        problems.append(Problem(where, fault, allowed))
    return None if fault else covariance


def noise(device: Instrument) -> str:
    """The noise of an instrument in few words."""
    steps = f", read in steps of {device.resolution_mm:g} mm" if device.resolution_mm else ""
    std = np.sqrt(np.diag(device.covariance_mm2))
    if device.laser is not None:
        most = f"{std[0]:.3g} mm per axis at the farthest candidate, less nearer"
        return f"{most} ({device.laser.in_words()}){steps}"
    if np.array_equal(device.covariance_mm2, np.diag(np.diag(device.covariance_mm2))):
        same = np.all(std == std[0])
        axes = f"{std[0]:g} mm" if same else f"{std[0]:g}, {std[1]:g}, {std[2]:g} mm"
        return f"{axes} per axis{steps}"
    return f"{std[0]:.3g}, {std[1]:.3g}, {std[2]:.3g} mm, correlated{steps}"

"""Laser trackers: a noise along the beam and one across it, which grow with the distance."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from kinacc.errors import Problem
from kinacc.measurements.table import numbers_of

PREFIX = "laser:"
_FORM = (
    f"{PREFIX}range_mm=..,range_um_per_m=..,angle_mm=..,angle_um_per_m=..,repeat_mm=.., standard "
    "deviations (0 where a key is left out; 1 um/m is 1 urad)"
)
_LARGEST = 1e3
_SMALLEST_MM = 1e-9  # below the size of an atom; squares of less vanish


@dataclass(frozen=True)
class LaserTracker:
    """Standard deviations of a tracker whose head stands at the origin of its frame.

    ``range``: along the beam, ``angle``: in each of the two directions across it; a part in mm, and
    one in um for each m of distance. ``repeat_mm``: how well the arm repeats a pose, per axis.
    """

    range_mm: float
    range_um_per_m: float
    angle_mm: float
    angle_um_per_m: float
    repeat_mm: float

    def covariance_mm2(self, from_head_mm: np.ndarray) -> np.ndarray:
        """Covariances (m, 3, 3) of readings at ``from_head_mm`` (m, 3), in the axes of these."""
        distance_mm = np.linalg.norm(from_head_mm, axis=1)
        along, across = self._std_mm(distance_mm)
        with np.errstate(invalid="ignore"):
            beam = np.nan_to_num(from_head_mm / distance_mm[:, None])
        own = beam[:, :, None] * beam[:, None, :]
        even = (across**2 + self.repeat_mm**2)[:, None, None] * np.eye(3)
        return even + (along**2 - across**2)[:, None, None] * own

    def largest_mm(self, from_head_mm: np.ndarray) -> float:
        """Largest standard deviation in any direction at any of the places (m, 3)."""
        largest = np.max(self._std_mm(np.linalg.norm(from_head_mm, axis=1)))
        return float(np.hypot(largest, self.repeat_mm))

    def in_words(self) -> str:
        """The standard deviations in few words."""
        return (
            f"{self.range_mm:g} mm + {self.range_um_per_m:g} um/m along the beam, "
            f"{self.angle_mm:g} mm + {self.angle_um_per_m:g} um/m across it, "
            f"{self.repeat_mm:g} mm of the arm"
        )

    def _std_mm(self, distance_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Standard deviations (m,) along the beam and across it."""
        along = self.range_mm + 1e-6 * self.range_um_per_m * distance_mm
        across = self.angle_mm + 1e-6 * self.angle_um_per_m * distance_mm
        return along, across


def of_text(text: str, where: str, problems: list[Problem]) -> LaserTracker | None:
    """A tracker of a text that begins with ``laser:``; None with what is wrong noted."""
    known = [each.name for each in fields(LaserTracker)]
    found: dict[str, float] = {}
    wrong: list[Problem] = []
    for part in filter(None, map(str.strip, text.removeprefix(PREFIX).split(","))):
        name, _, value = (each.strip() for each in part.partition("="))
        values = numbers_of(value)
        if name not in known:
            wrong.append(Problem(where, f"{name!r} is not there", ", ".join(known)))
        elif name in found:
            wrong.append(Problem(where, f"{name} is given twice"))
        elif values.size != 1 or not 0.0 <= values[0] <= _LARGEST:
            wrong.append(Problem(where, repr(part), f"{name}=NUMBER, 0 to {_LARGEST:g}"))
        found.setdefault(name, float(values[0]) if values.size == 1 else np.nan)
    for side in ("range", "angle"):
        given = [found.get(f"{side}_{unit}", 0.0) for unit in ("mm", "um_per_m")]
        if not wrong and given[0] + given[1] < _SMALLEST_MM:
            what = f"neither {side}_mm nor {side}_um_per_m is above 0"
            wrong.append(Problem(where, what, _FORM, "no instrument is without noise"))
    if "repeat_mm" not in found:
        what = "repeat_mm is not given, and how the arm repeats a pose is part of the noise"
        fix = "standard deviation per axis, as kinacc repeatability tells it; 0 if it is nothing"
        wrong.append(Problem(where, what, _FORM, fix))
    problems += wrong
    return None if wrong else LaserTracker(**{name: found.get(name, 0.0) for name in known})

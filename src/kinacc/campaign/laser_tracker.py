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
        outer = beam[:, :, None] * beam[:, None, :]
        even = (across**2 + self.repeat_mm**2)[:, None, None] * np.eye(3)
        return even + (along**2 - across**2)[:, None, None] * outer

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
    """Return a tracker of a text that begins with ``laser:``; None with what is wrong noted."""
    known = [number.name for number in fields(LaserTracker)]
    parts = [part.partition("=")[::2] for part in text.removeprefix(PREFIX).split(",")]
    values = {name.strip(): numbers_of(value) for name, value in parts}
    wrong = [name for name in values if name not in known]
    wrong += [
        name for name, number in values.items() if number.size != 1 or not 0 <= number[0] < 1e3
    ]
    wrong += ["repeat_mm"] if "repeat_mm" not in values else []
    if not wrong and len(values) == len(parts):
        tracker = LaserTracker(**{name: float(values.get(name, [0.0])[0]) for name in known})
        if (np.array(tracker._std_mm(np.array([1e3]))) > _SMALLEST_MM).all():
            return tracker
        wrong = ["range and angle must be above 0"]
    problems.append(Problem(where, f"{text!r} ({', '.join(wrong) or 'a key twice'})", _FORM))
    return None

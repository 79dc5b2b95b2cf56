"""Instruments of a campaign: each with the covariance of one reading, in a stated frame."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from kinacc.assess.adaptive import covariance_faults
from kinacc.config.names import not_in_a_line
from kinacc.errors import Problem, refuse
from kinacc.measurements.table import numbers_of

BASE, INSTRUMENT = "base", "instrument"
FRAMES = (BASE, INSTRUMENT)
_FORMS = "1 standard deviation, 3 (x, y, z), or 9 numbers of a covariance in mm^2, row by row"
_LARGEST_STD_MM = 1e3
_SMALLEST_STD_MM = 1e-9  # below the size of an atom; squares of less vanish


@dataclass(frozen=True)
class Instrument:
    """Covariance (3, 3) of one reading, mm^2, in the frame the instrument's readings are in.

    ``frame``: ``base``, the robot's own base, or ``instrument``, that of the calibration.
    """

    name: str
    covariance_mm2: np.ndarray
    frame: str

    def in_base(self, turn: np.ndarray) -> np.ndarray:
        """Covariance in the robot's base; ``turn`` (3, 3) takes the instrument's axes there."""
        even = self.covariance_mm2[0, 0] * np.eye(3)
        if self.frame == BASE or np.array_equal(self.covariance_mm2, even):
            return self.covariance_mm2  # turning equal noise would only add rounding
        turned = turn @ self.covariance_mm2 @ turn.T
        return 0.5 * (turned + turned.T)


def instruments(texts: Iterable[str], frame: str) -> tuple[Instrument, ...]:
    """Instruments of arguments such as ``tracker=0.03`` or ``camera=0.1,0.1,0.3``.

    Raises InputError naming everything that is wrong with any of them.
    """
    found: dict[str, Instrument] = {}
    problems: list[Problem] = []
    for text in texts:
        name, mark, numbers = text.partition("=")
        name = name.strip()
        if not mark or not name:
            problems.append(Problem("--instrument", repr(text), f"NAME={_FORMS}"))
            continue
        if name in found:
            problems.append(Problem(f"instrument {name}", "is given twice"))
        problems += not_in_a_line("--instrument", name)
        covariance = covariance_of(numbers, f"noise of {name}", problems)
        if covariance is not None:
            found[name] = Instrument(name, covariance, frame)
    refuse(problems, "These instruments cannot be used")
    return tuple(found.values())


def covariance_of(text: str, where: str, problems: list[Problem]) -> np.ndarray | None:
    """Covariance (3, 3) of a text with 1, 3 or 9 numbers; None with what is wrong noted."""
    values = numbers_of(text)
    if values.size not in (1, 3, 9):
        fix = ""
        if re.fullmatch(r"\s*-?\d+,\d+\s*", text):
            fix = f"a comma stands between numbers: write {text.strip().replace(',', '.')}"
        problems.append(Problem(where, repr(text), _FORMS, fix))
        return None
    if values.size == 9:
        covariance = values.reshape(3, 3)
        for _, said in covariance_faults(covariance[None]):
            problems.append(Problem(where, said, "symmetric, positive definite, in mm^2"))
            return None
        return covariance
    if not (values > 0.0).all():
        allowed = "above 0, in mm: no instrument is without noise"
        problems.append(Problem(where, f"standard deviation {text.strip()}", allowed))
        return None
    if (values < _SMALLEST_STD_MM).any():
        allowed = f"at least {_SMALLEST_STD_MM:g} mm"
        problems.append(Problem(where, f"standard deviation {text.strip()} mm", allowed))
        return None
    if (values > _LARGEST_STD_MM).any():
        problems.append(Problem(where, f"standard deviation {text.strip()} mm", "below 1 m"))
        return None
    return np.diag(np.broadcast_to(values, 3) ** 2)


def noise(each: Instrument) -> str:
    """The noise of an instrument in few words."""
    std = np.sqrt(np.diag(each.covariance_mm2))
    if np.array_equal(each.covariance_mm2, np.diag(np.diag(each.covariance_mm2))):
        same = np.all(std == std[0])
        said = f"{std[0]:g} mm" if same else f"{std[0]:g}, {std[1]:g}, {std[2]:g} mm"
        return f"{said} per axis"
    return f"{std[0]:.3g}, {std[1]:.3g}, {std[2]:.3g} mm, correlated"

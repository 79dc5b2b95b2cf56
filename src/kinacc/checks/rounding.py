"""In which steps a file states numbers, and what that costs where they are joints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation

import numpy as np

from kinacc.kinematics import dh
from kinacc.kinematics.dh import DHModel

_MOST_POSES = 200
_MOST_DIGITS = 30  # before or behind the mark: beyond all that is measured
_STEP = 1e-4  # of a difference quotient, rad


@dataclass(frozen=True)
class Rounding:
    """Joints written in steps of ``step_deg``.

    ``reach_mm`` is the largest distance of the flange from a joint's axis, ``step_mm`` what one
    step moves it there, ``rms_mm`` and ``most_mm`` what rounding all joints adds to its position.
    """

    step_deg: float
    reach_mm: float
    step_mm: float
    rms_mm: float
    most_mm: float


def smallest_step(cells: Sequence[Sequence[object]], unit: float, decimal: str) -> float:
    """The step of numbers as written: the most digits that any cell has behind its mark.

    ``unit`` is that of the file in the unit wanted. Zero where the file holds no texts, whose
    numbers are not rounded.
    """
    digits = 0
    for column in cells:
        for cell in column:
            text = str(cell).strip()
            if not isinstance(cell, str) or "e" in text.lower():
                return 0.0
            digits = max(digits, len(text.partition(decimal)[2]))
    return unit * 10.0**-digits


def step_between(cells: Sequence[object], unit: float, decimal: str) -> float:
    """The largest step of which all numbers of a column are whole multiples away from each other.

    ``unit`` is that of the file in the unit wanted. Zero where all are equal, or a cell is no
    number.
    """
    try:
        values = [_exact(cell, decimal) for cell in cells]
    except InvalidOperation:
        return 0.0
    digits = max((-int(each.as_tuple().exponent) for each in values), default=0)
    whole = [int(each.scaleb(digits)) for each in values]
    step = math.gcd(*(each - whole[0] for each in whole)) if whole else 0
    return unit * step * 10.0**-digits


def _exact(cell: object, decimal: str) -> Decimal:
    text = str(cell).strip().replace("\u2212", "-").replace(decimal, ".")
    value = Decimal(text)
    if not value.is_finite() or abs(value.adjusted()) > _MOST_DIGITS:
        raise InvalidOperation
    return value


def cost(model: DHModel, q: np.ndarray, step: float) -> Rounding:
    """What steps of ``step`` deg cost at joints (n, k): a rounded number is off by half at most."""
    q = q[:: max(len(q) // _MOST_POSES, 1)]
    half, turning = 0.5 * np.deg2rad(step), np.flatnonzero(~model.prismatic)
    arms = []
    for joint in turning:
        shift = np.zeros(q.shape[1])
        shift[joint] = _STEP
        ends = [dh.forward(model, q + sign * shift).position_mm for sign in (1.0, -1.0)]
        arms.append(np.linalg.norm(ends[0] - ends[1], axis=1) / (2.0 * _STEP))
    arm = np.stack(arms, axis=1)  # (n, joints) distances of the flange from every axis
    reach = float(arm.max())
    # Rounding is uniform over a step: its standard deviation is half of one over the root of 3.
    rms = half / np.sqrt(3.0) * np.sqrt(np.mean(np.sum(arm**2, axis=1)))
    return Rounding(
        step, reach, float(2.0 * half * reach), float(rms), float(half * arm.sum(axis=1).max())
    )

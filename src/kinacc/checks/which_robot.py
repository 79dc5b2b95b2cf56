"""Which of the shipped robots a file was measured on, by fitting each of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from kinacc.errors import InputError
from kinacc.kinematics.robot import load, shipped
from kinacc.measurements.intake.guess import Guess
from kinacc.measurements.reader import MeasuredFile, read

_ROWS = 240
_SURE = 0.005  # of the points' spread: what an arm that is the one leaves, uncalibrated
_NEXT = 0.2  # of what the next best leaves

Progress = Callable[[Iterable, str], Iterable]


def fitting(guess: Guess, progress: Progress) -> str | None:
    """Name of the one shipped robot that fits the file, None where none or several do."""
    left = []
    for name in progress(shipped(), "shipped robots tried"):
        arm = load(name)
        if arm.dh.joints != guess.joints:
            continue
        try:
            reading = read(guess.section, arm, strict=False)
        except InputError:
            return None
        left.append((_left(reading, arm), name))
    left.sort()
    if not left or left[0][0] > _SURE or (len(left) > 1 and left[0][0] > _NEXT * left[1][0]):
        return None
    return left[0][1]


def _left(reading: MeasuredFile, arm) -> float:
    """What base and target alone leave of the positions, as a share of their spread.

    The arm is taken as described: corrected, an arm of similar build would fit as well.
    """
    from kinacc.checks import readings, robust_fit

    every = readings.merged(readings.of_file(reading, arm))[0]
    few = every.select(readings.thinned(np.arange(len(every)), _ROWS))
    point = few.position_mm - np.median(few.position_mm, axis=0)
    spread = float(np.median(np.linalg.norm(point, axis=1)))
    fitted = robust_fit.best(few, robust_fit.start(few, arm.dh), strengths=(0.0,))
    return fitted.sigma_mm / max(spread, 1e-9)

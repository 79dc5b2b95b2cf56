"""Which of the shipped robots a file was measured on, by fitting them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinacc.calibration.observations import Observations
from kinacc.checks.report import Progress
from kinacc.errors import InputError
from kinacc.kinematics.dh import DHModel, forward
from kinacc.kinematics.robot import load, shipped
from kinacc.measurements.intake.guess import Guess
from kinacc.measurements.reader import read

_ROWS = 240
_TRIED, _POSES = 4, 30  # robots that a linear fit puts first, with this many poses or more
_SURE = 0.005  # of the points' spread: what an arm that is the one leaves, uncalibrated
_NEXT = 0.2  # of what the next best leaves
_SAME_ARM = 1e-6  # of the misfit: two names of one geometry


def fitting(guess: Guess, progress: Progress) -> list[str]:
    """Fit the shipped robots to a file.

    The arms are taken as described: corrected, an arm of similar build would fit as well.

    Parameters
    ----------
    guess
        What a measured file holds.
    progress
        Called on what is iterated and a label.

    Returns
    -------
    list of str
        Names of the robots that fit: one, or those of equal geometry; or none.
    """
    from kinacc.checks import readings, robust_fit

    arms = [arm for arm in map(load, shipped()) if arm.dh.joints == guess.joints]
    if not arms:
        return []
    try:
        every = readings.of_file(read(guess.section, arms[0], strict=False), arms[0])
    except InputError:
        return []
    every = readings.merged(every)[0]
    few = every.select(readings.thinned(np.arange(len(every)), _ROWS))
    point = few.position_mm - np.median(few.position_mm, axis=0)
    spread = max(float(np.median(np.linalg.norm(point, axis=1))), 1e-9)
    moved = [(arm, replace(few, q_rad=arm.dh_joints(few.q))) for arm in arms]
    moved.sort(key=lambda pair: linear_misfit(pair[0].dh, pair[1], spread))
    misfits = []
    if len(few) >= _POSES:
        moved = moved[:_TRIED]
    for arm, observed in progress(moved, "shipped robots tried"):
        fitted = robust_fit.best(observed, robust_fit.start(observed, arm.dh), strengths=(0.0,))
        misfits.append((fitted.sigma_mm / spread, arm.name))
    misfits.sort()
    least = misfits[0][0]
    same = [name for misfit, name in misfits if misfit <= (1.0 + _SAME_ARM) * least]
    others = [misfit for misfit, _ in misfits[len(same) :]]
    return [] if least > _SURE or (others and least > _NEXT * others[0]) else same


def linear_misfit(model: DHModel, observed: Observations, spread: float) -> float:
    """Misfit of the most measured target, base and tool entering linearly, in spreads.

    ``point = B p + B R t + b`` is linear in B (3, 3), the products of B and t, and b; how far B is
    from a rotation counts as well.
    """
    pairs = np.column_stack([observed.session, observed.target])
    which, count = np.unique(pairs, axis=0, return_counts=True)
    first = observed.select(np.flatnonzero((pairs == which[np.argmax(count)]).all(axis=1)))
    flange = forward(model, first.q_rad)
    terms = np.hstack([flange.position_mm / spread, flange.rotation.reshape(-1, 9),
                       np.ones((len(first), 1))])  # fmt: skip
    results = np.linalg.lstsq(terms, first.position_mm / spread, rcond=1e-9)[0]
    remaining = np.linalg.norm(terms @ results - first.position_mm / spread, axis=1)
    return float(np.median(remaining) + np.abs(np.linalg.svd(results[:3])[1] - 1.0).max())

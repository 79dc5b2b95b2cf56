"""Values that are allowed and look like slips: they are asked about before they are taken."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from kinacc.campaign import words
from kinacc.campaign.instrument import Instrument, noise
from kinacc.campaign.plan import Plan
from kinacc.errors import Problem

_NEVER = ("no_bound_ahead", "no_bound_on_all")  # reasons of a budget that leads to nothing
_MUCH_NOISE = 2.0  # times what the calibration left unexplained, noise included
_MUCH_NOISE_MM = 1.0  # where nothing is known of the calibration
_USUAL_READINGS = 10  # that say what size is usual
_UNUSUAL = 6.0  # times the median size
_FEWEST_SIGMAS = 10.0  # a reading is not unusual within so much noise


def of_noise(instruments: Sequence[Instrument], left_mm: float = math.nan) -> list[Problem]:
    """Noise larger than the error a calibration left unexplained, ``left_mm`` (rms).

    That error holds the noise of the readings it was found by.
    """
    known = math.isfinite(left_mm) and left_mm > 0.0
    most_mm = _MUCH_NOISE * left_mm if known else _MUCH_NOISE_MM
    problems = []
    for each in instruments:
        size_mm = math.sqrt(float(np.trace(each.covariance_mm2)))
        if size_mm <= most_mm:
            continue
        than = (
            f"than the {left_mm:.3g} mm that the calibration left" if known else "than trackers do"
        )
        what = f"{noise(each)}: the readings would scatter more {than}"
        std = float(np.sqrt(np.diag(each.covariance_mm2)).max())
        fix = f"are micrometres meant? Then it is {1e-3 * std:g} mm. --sure takes it as it is"
        problems.append(Problem(f"noise of {each.name}", what, "millimetres", fix))
    return problems


def of_budget(begun: Plan) -> list[Problem]:
    """A budget with which no bound on all candidates is ever stated."""
    short = begun.assessor.shortfall(*begun.points.joints.shape)
    if short is None or short.code not in _NEVER:
        return []
    what = f"{begun.assessor.measurements} readings for {len(begun.points)} candidates"
    fix = "give a larger --budget or fewer candidates (--drawn); --sure begins it all the same"
    return [Problem("--budget", f"{what}: {words.reason(short)}", fix=fix)]


def unusual_mm(sizes_mm: Sequence[float], noise_mm: float) -> float:
    """Size beyond which a reading is unusual after readings of ``sizes_mm``; inf where few are."""
    if len(sizes_mm) < _USUAL_READINGS:
        return math.inf
    return max(_UNUSUAL * float(np.median(sizes_mm)), _FEWEST_SIGMAS * noise_mm)

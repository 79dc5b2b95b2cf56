"""Values that are allowed and look like slips: they are asked about before they are taken.

And what is known of the noise before it is stated: it is offered, and never taken by itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kinacc.campaign.instrument import Instrument, noise
from kinacc.campaign.plan import Plan
from kinacc.errors import Problem

if TYPE_CHECKING:
    from kinacc.calibration.noise import Noise

_NEAREST_M, _FARTHEST_M = 0.3, 80.0  # at which laser trackers measure
_MUCH_NOISE = 2.0  # times what the calibration left unexplained, noise included
_MUCH_NOISE_MM = 1.0  # where nothing is known of the calibration
_LITTLE_NOISE = 0.8  # of the scatter that was measured
_USUAL_READINGS = 10  # that say what size is usual
_TOO_FEW = "the calibration does not tell it: too few repeats"


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


def of_repeats(instruments: Sequence[Instrument], calibration: Path) -> list[Problem]:
    """The same as :func:`of_little_noise` of a results folder; nothing where it has no readings."""
    known = _noise_of(calibration)
    return of_little_noise(instruments, known) if known else []


def ways_to_noise(known: Sequence[str], several: bool) -> str:
    """How to say what the noise is, in short lines, and what is ``known`` of it.

    ``several``: instruments may be named.
    """
    named = ", or --instrument NAME=MM" if several else ""
    return "\n".join(
        [
            "give it in one of three ways:",
            "      a test (the surest): visit 20 poses three times each, leaving them between,",
            "        run kinacc repeatability FILE -o noise.json, then --repeatability noise.json",
            "      an estimate: --noise-mm MM --noise estimate",
            "        (MM is a guess; the readings of the campaign then tell the noise)",
            f"      a number: --noise-mm MM, or --covariance-mm2{named}",
            *(f"    {each}" for each in known),
        ]
    )


def noise_known(calibration: Path) -> str:
    """The same as :func:`noise_by_repeats` of a results folder."""
    known = _noise_of(calibration)
    return noise_by_repeats(known) if known else _TOO_FEW


def noise_by_repeats(known: Noise) -> str:
    """The noise of the readings of a calibration, and what it does not contain, in short lines."""
    brief = noise_in_brief(known)
    if not brief:
        return _TOO_FEW
    return (
        f"of the calibration, {brief}\n"
        "      along x,y,z of the instrument: the noise is that or more, as they may have been\n"
        "      read back to back, without coming back to the pose, and hold no new set-up of\n"
        "      instrument or target"
    )


def noise_in_brief(known: Noise) -> str:
    """By how much readings of one configuration scatter; empty where there are too few."""
    if known.freedom < _USUAL_READINGS or not (known.std_mm > 0.0).all():
        return ""
    std_mm = ",".join(f"{each:.2g}" for each in known.std_mm)
    where = f"{known.readings} readings at {known.configurations} configurations"
    return f"{where} scatter by {std_mm} mm"


def _noise_of(calibration: Path) -> Noise | None:
    """The noise of the readings in a results folder; None where it has no readings."""
    from kinacc.calibration.noise import of_measurements
    from kinacc.kinematics import robot
    from kinacc.tables import store

    paths = [calibration / f"{name}.parquet" for name in ("measurements", "robot")]
    if not all(path.is_file() for path in paths):
        return None
    measured, described = map(store.read, paths)
    arm = robot.of_text(str(described["description"][0]), "robot.parquet")
    return of_measurements(measured, arm)


def of_little_noise(instruments: Sequence[Instrument], known: Noise) -> list[Problem]:
    """Noise stated smaller than that of the readings of the calibration."""
    problems = []
    for each in instruments:
        std_mm = math.sqrt(float(np.trace(each.covariance_mm2)) / 3.0)
        if known.freedom < _USUAL_READINGS or std_mm >= _LITTLE_NOISE * known.per_axis_mm:
            continue
        what = (
            f"{noise(each)}: readings of the calibration at equal joints scatter by "
            f"{known.per_axis_mm:.3g} mm per axis ({known.freedom} degrees of freedom)"
        )
        fix = (
            f"the noise has to hold how the arm repeats a pose: give {known.per_axis_mm:.2g}, or "
            "more; --sure takes it as it is"
        )
        problems.append(Problem(f"noise of {each.name}", what, fix=fix))
    return problems


def of_distance(begun: Plan) -> list[Problem]:
    """Laser trackers that stand where none does, as where the origin of a frame is no tracker."""
    problems = []
    for each in begun.instruments:
        if each.laser is None:
            continue
        apart = np.linalg.norm(begun.points.modelled_mm - begun.to_base.position_mm, axis=1)
        least, most = 1e-3 * float(apart.min()), 1e-3 * float(apart.max())
        if least >= _NEAREST_M and most <= _FARTHEST_M:
            continue
        what = f"{least:.2f} m to {most:.2f} m from the candidates, by the calibration"
        fix = (
            "its head has to be the origin of the frame of its readings; else state the noise "
            "otherwise. --sure takes it as it is"
        )
        allowed = f"{_NEAREST_M:g} m to {_FARTHEST_M:g} m"
        problems.append(Problem(f"laser tracker {each.name}", what, allowed, fix))
    return problems

"""A comparison of two calibrations in lines, for the terminal and for its page."""

from __future__ import annotations

import numpy as np

from kinacc.calibration.misfit import GIVEN, over_noise
from kinacc.config.error_models import model_name
from kinacc.deployment import compare
from kinacc.deployment.compare import Difference, Shift

_NOTHING = 5e-5  # less is no digit of the four shown after the point
AGAIN = "measure the poses of the first again, calibrate, and compare like with like"
NEXT = {
    compare.OTHER_ROBOT: "compare two calibrations of one arm",
    compare.SAME_READINGS: "choose between the settings by the held-out errors of the two",
    compare.NOT_COMPARABLE: "compare at joints that both cover (--joints FILE), or --model dh",
    compare.UNKNOWN: "look where they differ; a verdict takes two fitted calibrations",
    compare.UNPROVEN: "nothing: keep the calibration that is loaded",
    compare.IN_DOUBT: f"{AGAIN}, before anything is changed at the robot",
    compare.CHANGED: f"{AGAIN}; where the change stays, load the new calibration",
}


def lines(found: Difference) -> list[str]:
    """The verdict and why, how far poses moved, and what standard deviations are worth."""
    shared, names = found.shared, found.names
    by = f"(p = {found.probability:.2g} in {found.directions} directions, if residuals are noise)"
    both = int(found.measured.sum())
    where = f"{both or 'none'} of the {len(found.measured)} poses lie where both were measured"
    unknown = "no verdict on a change: the uncertainty of both has to be known"
    told = [
        {
            compare.OTHER_ROBOT: f"these are different robots ({' and '.join(found.robots)}), "
            f"{number(found.robots_apart_mm)} mm rms apart before any calibration: this is no "
            "change of one arm",
            compare.SAME_READINGS: f"both are fitted to the same {shared.count} readings: nothing "
            "can have moved between them",
            compare.NOT_COMPARABLE: f"{model_name(found.model)} models cannot be compared at these "
            f"poses: {where}",
            compare.UNKNOWN: unknown,
            compare.UNPROVEN: f"no change is proven {by}",
            compare.IN_DOUBT: f"a change of the arm is in doubt: {where}, and other poses give "
            f"other parameters of the same arm {by}",
            compare.CHANGED: f"the arm has changed {by}",
        }[found.verdict]
    ]
    if shared.count and not shared.all_of_both:
        told.append(
            f"{shared.count} readings are in both, of {shared.first} in {names[0]} and "
            f"{shared.second} in {names[1]}: they are counted once"
        )
    if not found.covered.all():
        told.append(
            f"compared at {int(found.covered.sum())} of {len(found.covered)} poses: the others lie "
            f"outside the joint range of the {model_name(found.model)} fits"
        )
    if found.verdict != compare.NOT_COMPARABLE:
        told.append(_moved("flange poses differ by", found.as_they_stand))
        told.append(_moved("after the best base and tool by", found.apart_from_frames))
    pairs = zip(names, found.misfits, strict=True)
    worth = [f"{name}: {over_noise([each])}" for name, each in pairs if each is not None]
    return [*told, f"standard deviations are {GIVEN}; {'; '.join(worth)}"] if worth else told


def _moved(words: str, shift: Shift) -> str:
    by_chance = ""
    if np.isfinite(shift.chance_mm):
        chance = number(shift.chance_mm), number(1e3 * shift.chance_rad)
        by_chance = f" (by chance {chance[0]} mm, {chance[1]} mrad)"
    return (
        f"{words} {number(shift.rms_mm)} mm rms, at most {number(shift.position_mm.max())} mm, "
        f"{number(1e3 * shift.rms_rad)} mrad rms{by_chance}"
    )


def number(value: float) -> str:
    """Three digits, whole thousands in full; 0 for what no digit is shown of."""
    if abs(value) < _NOTHING:
        return "0"
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"

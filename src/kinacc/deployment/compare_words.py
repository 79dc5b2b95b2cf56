"""What moved between two calibrations, in sentences."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kinacc.calibration.misfit import GIVEN, over_noise
from kinacc.calibration.uncertainty import unit_of
from kinacc.config.error_models import model_name
from kinacc.deployment.compare import Difference, Parameters, Shift
from kinacc.deployment.record import Calibration
from kinacc.deployment.shared_readings import SharedReadings

_UNLIKELY = 0.001
_ENOUGH = 0.5  # of the poses
_NOTHING = 5e-5  # less is no digit of the four shown after the point
AGAIN = "measure the poses of the first again, calibrate, and compare like with like"


def short_names(calibrations: Sequence[Calibration]) -> tuple[str, str]:
    """Last parts of the places the calibrations come from, where these differ."""
    first, second = (Path(calibration.name).name for calibration in calibrations)
    return (first, second) if first != second else (calibrations[0].name, calibrations[1].name)


def in_words(found: Difference, calibrations: Sequence[Calibration], measured: np.ndarray) -> str:
    """What moved, in sentences; ``measured`` (n,): the poses given where both were measured."""
    measured = measured[found.covered]
    lines = [*of_readings(found.shared, calibrations), *of_covered(found, calibrations)]
    if says_nothing(calibrations, measured):
        why = nowhere(calibrations, measured)
        return "\n".join([
            *lines,
            f"these calibrations cannot be compared at these poses: {why}; compare at joints that "
            "both cover (--joints), or the DH models (--model dh)",
        ])  # fmt: skip
    if not found.same_robot:
        first, second = (calibration.robot.name for calibration in calibrations)
        lines.append(
            f"these are different robots ({first} and {second}): before any calibration they are "
            f"{number(found.robots_apart_mm)} mm rms apart, after the best base and tool; what "
            "follows is no change of one arm"
        )
    elif np.isfinite(found.probability):
        said = by_parameters(found, measured)
        lines.append(
            f"{found.directions} directions both determine: squared distance "
            f"{found.statistic:.1f}, probability of more by chance {found.probability:.2g}: {said}"
        )
        if has_changed(found) and is_in_doubt(measured):
            lines.append(f"{AGAIN}, before anything is changed at the robot")
    lines += of_deviations(calibrations)
    words = "flange poses differ" if found.shared.all_of_both else "flange poses moved"
    lines.append(moved(words, found.as_they_stand))
    lines.append(moved("after the best base and tool", found.apart_from_frames))
    return "\n".join(lines)


def of_deviations(calibrations: Sequence[Calibration]) -> list[str]:
    """What the standard deviations of both are worth, where both were fitted."""
    names = short_names(calibrations)
    pairs = zip(names, (each.misfit for each in calibrations), strict=True)
    fits = [f"{name}: {over_noise([each])}" for name, each in pairs if each is not None]
    return [f"standard deviations are {GIVEN}; {'; '.join(fits)}"] if fits else []


def verdict(
    found: Difference, calibrations: Sequence[Calibration], measured: np.ndarray
) -> str | None:
    """What a comparison says of the arm, in a few words; None where chance is not known."""
    measured = measured[found.covered]
    if not found.same_robot:
        return "different robots"
    if found.shared.all_of_both:
        return "same readings"
    if says_nothing(calibrations, measured):
        return "not comparable here"
    if not np.isfinite(found.probability):
        return None
    if not has_changed(found):
        return "no change proven"
    return "change in doubt" if is_in_doubt(measured) else "changed"


def by_parameters(found: Difference, measured: np.ndarray) -> str:
    """What the parameters prove; ``measured``: the poses compared where both were measured."""
    noise = "if the residuals are independent noise"
    if not has_changed(found):
        return f"no change is proven, {noise}"
    if not is_in_doubt(measured):
        return f"the arm has changed, {noise}"
    return (
        f"a change of the arm is in doubt: {of_both(measured)}, and other poses "
        "give other parameters of the same arm"
    )


def is_in_doubt(measured: np.ndarray) -> bool:
    """Whether a change may be other poses: most lie where not both were measured."""
    return float(np.mean(measured)) < _ENOUGH


def of_covered(found: Difference, calibrations: Sequence[Calibration]) -> list[str]:
    """At how many of the poses given a comparison was made, where not at all."""
    if found.covered.all():
        return []
    bounded = next(each for each in calibrations if each.model.domain is not None)
    return [
        f"compared at {int(found.covered.sum())} of {len(found.covered)} poses: the others lie "
        f"outside the joint range of the fits, where a {model_name(bounded.choice)} model says "
        "nothing"
    ]


def says_nothing(calibrations: Sequence[Calibration], measured: np.ndarray) -> bool:
    """Whether most poses are where models without parameters of their own say nothing."""
    parametric = all(each.model.comparable is not None for each in calibrations)
    return not parametric and is_in_doubt(measured)


def nowhere(calibrations: Sequence[Calibration], measured: np.ndarray) -> str:
    """Why a comparison at such poses means nothing."""
    model = model_name(calibrations[0].choice)
    return f"{of_both(measured)}, and a {model} model is not to be trusted elsewhere"


def of_both(measured: np.ndarray) -> str:
    """How many poses lie where both calibrations were measured."""
    both = int(np.sum(measured))
    said = f"only {both}" if both else "none"
    return f"{said} of the {len(measured)} poses lie where both were measured"


def has_changed(found: Difference) -> bool:
    """Whether the parameters differ by more than chance allows, where that can be told."""
    return bool(np.isfinite(found.probability)) and found.probability < _UNLIKELY


def of_readings(shared: SharedReadings, calibrations: Sequence[Calibration]) -> list[str]:
    """What readings in both calibrations mean for a verdict."""
    if not shared.count:
        return []
    if shared.all_of_both:
        return [
            f"both are fitted to the same {shared.count} readings: nothing can have moved between "
            "them; what differs comes from the settings of the fits"
        ]
    first, second = short_names(calibrations)
    return [
        f"{shared.count} readings are in both, of {shared.first} in {first} and {shared.second} in "
        f"{second}: they show no change, and are counted once"
    ]


def moved(words: str, shift: Shift) -> str:
    """How far poses moved, beside what chance brings."""
    by_chance = ""
    if np.isfinite(shift.chance_mm):
        chance = number(shift.chance_mm), number(1e3 * shift.chance_rad)
        by_chance = f" (by chance {chance[0]} mm, {chance[1]} mrad)"
    return (
        f"{words}: {number(shift.rms_mm)} mm rms, at most {number(shift.position_mm.max())} mm, "
        f"{number(1e3 * shift.rms_rad)} mrad rms{by_chance}"
    )


def shown_in(each: Parameters) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Names (P,) of parameters without their unit, the unit shown, and its scale: mm, mrad."""
    units = [unit_of(name) for name in each.names]
    names = [
        name.rpartition("_")[0] if unit in ("rad", "mm") else name
        for name, unit in zip(each.names, units, strict=True)
    ]
    scale = np.where(np.array(units) == "rad", 1e3, 1.0)
    shown = [{"rad": "mrad"}.get(unit, unit) for unit in units]
    return np.array(names, dtype=object), np.array(shown, dtype=object), scale


def remarks(each: Parameters) -> np.ndarray:
    """Which calibration leaves each parameter (P,) open; empty where none does."""
    words = {
        "": "",
        "first": "undetermined in the first",
        "second": "undetermined in the second",
        "both": "undetermined in both",
    }
    return np.array([words[where] for where in each.undetermined_in], dtype=object)


def number(value: float) -> str:
    """Three digits for a sentence, whole thousands in full; 0 for what no digit is shown of."""
    if abs(value) < _NOTHING:
        return "0"
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"

"""Two calibrations of one arm on a page: what moved, where, and by how much more than chance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinacc.artifacts.error_models import model_name
from kinacc.deployment.compare import Difference, Parameters
from kinacc.deployment.compare_words import (
    AGAIN,
    by_parameters,
    has_changed,
    nowhere,
    number,
    of_both,
    of_covered,
    of_deviations,
    of_readings,
    says_nothing,
    short_names,
    shown_in,
    verdict,
)
from kinacc.deployment.record import FLANGE, Calibration
from kinacc.kinematics.model import JointState
from kinacc.report.comparison_sections import FAR, LOOKS, Case, moved, parameters, shown, where
from kinacc.report.page import FirstScreen, Page, Table, Text

_MOSTLY = 0.9  # of the poses; a calibration's own lie beyond its limit now and then
_BEYOND = 2.0  # times what chance brings: below it, little stays
_MOST_NAMED = 3


def comparison_page(
    found: Difference,
    calibrations: Sequence[Calibration],
    q_rad: np.ndarray,
    measured: np.ndarray,
) -> Page:
    """The page of a comparison at reported joints ``q_rad`` (n, k), rad and mm.

    ``measured`` (n,): the poses where both were measured. Both are of all poses given to the
    comparison; the page shows those that were compared.
    """
    badge = _badge(found, verdict(found, calibrations, measured))
    q_rad, measured = q_rad[found.covered], measured[found.covered]
    case = _case(found, calibrations, q_rad, measured)
    first, second = case.names
    of_all = [each.robot.name for each in calibrations]
    screen = FirstScreen(
        f"{second} against {first}",
        f"{', '.join(dict.fromkeys(of_all))}, {model_name(case.model)} model; {len(q_rad)} poses "
        "of the flange",
        badge,
        _answers(case, calibrations),
        () if case.extrapolates else (_table(case),),
        _notes(case, calibrations),
    )
    parts = [moved(case), where(case)]
    if found.parameters is not None and found.parameters.names:
        parts.append(parameters(case, found.parameters))
    made = {"first": calibrations[0].name, "second": calibrations[1].name, "model": case.model}
    return Page(screen, tuple(parts), {**made, "poses": str(len(q_rad))})


def _case(
    found: Difference,
    calibrations: Sequence[Calibration],
    q_rad: np.ndarray,
    measured: np.ndarray,
) -> Case:
    one = calibrations[0]
    shown = np.where(one.robot.dh.prismatic, q_rad, np.rad2deg(q_rad))
    position = one.pose(JointState(one.robot.dh_joints(q_rad)), "base", FLANGE).position_mm
    left = tuple(each.residual.position_mm for each in calibrations if each.residual is not None)
    return Case(
        found, short_names(calibrations), one.choice,
        1 + np.flatnonzero(found.covered), shown, one.robot.dh.prismatic, position, measured, left,
        says_nothing(calibrations, measured),
    )  # fmt: skip


def _badge(found: Difference, said: str | None) -> tuple[str, bool]:
    if said is not None:
        return said.upper(), said not in ("same readings", "no change proven")
    times = _times_chance(found)
    known = f"{times:.1f} TIMES CHANCE" if np.isfinite(times) else "CHANCE NOT KNOWN"
    return known, times > _BEYOND


def _times_chance(found: Difference) -> float:
    """How often what stays after the best base and tool is what chance brings; NaN if unknown."""
    apart = found.apart_from_frames
    return apart.rms_mm / apart.chance_mm if apart.chance_mm > 0.0 else np.nan


def _answers(case: Case, calibrations: Sequence[Calibration]) -> tuple[str, ...]:
    found, (first, second) = case.found, case.names
    lines = [_sentence(each) for each in of_readings(found.shared, calibrations)]
    if not found.same_robot:
        robots = " and ".join(each.robot.name for each in calibrations)
        lines.append(
            f"These are different robots ({robots}): what follows is no change of one arm."
        )
    elif case.extrapolates:
        why = nowhere(calibrations, case.measured)
        return *lines, f"These calibrations cannot be compared at these poses: {why}."
    plain, apart = found.as_they_stand, found.apart_from_frames
    fitted = [each.known is not None for each in calibrations]
    one_arm = found.same_robot and not found.shared.all_of_both and all(fitted)
    text = (
        f"From {first} to {second}, the modelled poses {'moved' if one_arm else 'differ'} by "
        f"{number(plain.rms_mm)} mm rms, at most {number(float(plain.position_mm.max()))} mm"
    )
    if one_arm and plain.chance_mm > 0.0:
        text += f"; by chance alone it would be {number(plain.chance_mm)} mm rms"
    lines.append(f"{text}.")
    text = f"After the best base and tool {number(apart.rms_mm)} mm rms stays"
    if one_arm and np.isfinite(times := _times_chance(found)):
        text += f", {times:.1f} times what chance brings"
        if not case.in_doubt:
            little = "little of it is the arm itself"
            text += f": {'the arm itself' if times > _BEYOND else little}"
    lines.append(f"{text}.")
    if not all(fitted):
        unfitted = " and ".join(n for n, known in zip(case.names, fitted, strict=True) if not known)
        lines.append(
            f"There is no verdict on a change: how sure {unfitted} is, is not known, so nobody can "
            "say what chance would bring."
        )
    if found.same_robot and np.isfinite(found.probability):
        said = by_parameters(found, case.measured)
        lines.append(f"By the parameters both determine, {said}.")
    return tuple(lines)


def _table(case: Case) -> Table:
    rows = []
    for key, shift in case.shifts.items():
        turn, by_chance = 1e3 * shift.rms_rad, 1e3 * shift.chance_rad
        sizes = (shift.rms_mm, shift.chance_mm, float(shift.position_mm.max()), turn, by_chance)
        rows.append((LOOKS[key][0], *map(shown, sizes)))
    heads = ("", "rms mm", "by chance mm", "largest mm", "rms mrad", "by chance mrad")
    caption = f"How far the poses of {case.names[1]} are from those of {case.names[0]}"
    return Table(caption, heads, tuple(rows), numeric=frozenset(range(1, 6)))


def _notes(
    case: Case, calibrations: Sequence[Calibration]
) -> tuple[tuple[str, tuple[Text, ...]], ...]:
    check = of_covered(case.found, calibrations)
    if case.left_mm:
        left = " and ".join(f"{number(each)} mm" for each in case.left_mm)
        check.append(f"the {model_name(case.model)} model leaves {left} rms unexplained")
    if case.measured.mean() < _MOSTLY and not case.extrapolates:
        check.append(f"{of_both(case.measured)}; elsewhere one of them is extrapolated")
    each = case.found.parameters
    notes = {
        "CHECK": check,
        "PARAMETERS": (
            _largest(each) + of_deviations(calibrations)
            if each is not None and case.found.same_robot
            else []
        ),
        "VALID": [
            "for these poses of the flange in the robot's base, as the models have them; nothing "
            "was measured for this page"
        ],
        "NEXT": [_next(case)],
    }
    return tuple(
        (name, tuple(Text(_sentence(line)) for line in lines)) for name, lines in notes.items()
        if lines
    )  # fmt: skip


def _largest(each: Parameters) -> list[str]:
    """The parameters that differ the most, and what could not be told."""
    names, unit, scale = shown_in(each)
    size = np.where(np.isfinite(each.sigmas), np.abs(each.sigmas), 0.0)
    far = [row for row in np.argsort(-size, kind="stable") if size[row] > FAR]
    lines = []
    if far:
        named = ", ".join(
            f"{names[row]} by {each.difference[row] * scale[row]:+.3g} {unit[row]} "
            f"({abs(each.sigmas[row]):.1f} standard deviations)"
            for row in far[:_MOST_NAMED]
        )
        more = len(far) - _MOST_NAMED
        lines.append(f"changed the most: {named}{f', and {more} more' if more > 0 else ''}")
    blind = sum(where != "" for where in each.undetermined_in)
    if blind:
        lines.append(f"{blind} of {len(names)} are not determined by the poses, and not counted")
    return lines


def _next(case: Case) -> str:
    found = case.found
    if not found.same_robot:
        return "compare two calibrations of one arm"
    if found.shared.all_of_both:
        return "choose between the settings by the held-out errors of the two"
    if case.extrapolates:
        return "compare at joints that both cover (--joints FILE), or the DH models (--model dh)"
    times = _times_chance(found)
    if not np.isfinite(found.probability) and not np.isfinite(times):
        return (
            "look below where they differ and by how much; a change takes two fitted calibrations"
        )
    if not (has_changed(found) or (np.isnan(found.probability) and times > _BEYOND)):
        return "nothing: keep the calibration that is loaded"
    if case.in_doubt:
        return f"{AGAIN}, before anything is changed at the robot"
    return f"{AGAIN}; where the change stays, load the new calibration and look for its cause"


def _sentence(line: str) -> str:
    """A line with a capital at its begin and a stop at its end."""
    return f"{line[:1].upper()}{line[1:]}."

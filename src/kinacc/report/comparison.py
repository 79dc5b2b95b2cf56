"""Two calibrations of one arm on a page: what moved, where, and by how much more than chance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinacc.config.error_models import model_name
from kinacc.deployment.compare import Difference, Parameters
from kinacc.deployment.compare_words import (
    AGAIN,
    by_parameters,
    has_changed,
    is_in_doubt,
    moved,
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
from kinacc.report import comparison_sections
from kinacc.report.comparison_sections import FAR, SHIFTS, Case
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
    said = verdict(found, calibrations, measured)
    q_rad, measured = q_rad[found.covered], measured[found.covered]
    one = calibrations[0]
    case = Case(
        found,
        short_names(calibrations),
        1 + np.flatnonzero(found.covered),
        np.where(one.robot.dh.prismatic, q_rad, np.rad2deg(q_rad)),
        one.robot.dh.prismatic,
        one.pose(JointState(one.robot.dh_joints(q_rad)), "base", FLANGE).position_mm,
        measured,
    )
    robots = ", ".join(dict.fromkeys(each.robot.name for each in calibrations))
    screen = FirstScreen(
        "{1} against {0}".format(*case.names),
        f"{robots}, {model_name(one.choice)} model; {len(q_rad)} poses of the flange",
        _badge(found, said),
        tuple(map(_sentence, _answers(case, calibrations))),
        () if says_nothing(calibrations, measured) else (_table(case),),
        _notes(case, calibrations),
    )
    parts = [comparison_sections.moved(case), comparison_sections.where(case)]
    if found.parameters is not None and found.parameters.names:
        parts.append(comparison_sections.parameters(case, found.parameters))
    made = {"first": one.name, "second": calibrations[1].name, "model": one.choice}
    return Page(screen, tuple(parts), {**made, "poses": str(len(q_rad))})


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


def _answers(case: Case, calibrations: Sequence[Calibration]) -> list[str]:
    """What the terminal prints, but for what stands in the table and the notes."""
    found = case.found
    lines = of_readings(found.shared, calibrations)
    if not found.same_robot:
        robots = " and ".join(each.robot.name for each in calibrations)
        return [*lines, f"these are different robots ({robots}): this is no change of one arm"]
    if says_nothing(calibrations, case.measured):
        why = nowhere(calibrations, case.measured)
        return [*lines, f"these calibrations cannot be compared at these poses: {why}"]
    if np.isfinite(found.probability):
        lines.append(by_parameters(found, case.measured))
    lines += [
        moved(f"from {case.names[0]} to {case.names[1]}, flange poses differ", found.as_they_stand),
        moved("after the best base and tool", found.apart_from_frames),
    ]
    unfitted = [name for name, each in zip(case.names, calibrations, strict=True) if not each.known]
    if unfitted:
        which = " and ".join(unfitted)
        lines.append(f"no verdict on a change: the uncertainty of {which} is not known")
    return lines


def _table(case: Case) -> Table:
    rows = []
    for key, shift in case.shifts.items():
        sizes = shift.rms_mm, shift.chance_mm, float(shift.position_mm.max())
        turns = 1e3 * shift.rms_rad, 1e3 * shift.chance_rad
        shown = (f"{each:.3f}" if np.isfinite(each) else "–" for each in (*sizes, *turns))
        rows.append((SHIFTS[key][0], *shown))
    heads = ("", "rms mm", "by chance mm", "largest mm", "rms mrad", "by chance mrad")
    caption = f"How far the poses of {case.names[1]} are from those of {case.names[0]}"
    return Table(caption, heads, tuple(rows), numeric=frozenset(range(1, 6)))


def _notes(
    case: Case, calibrations: Sequence[Calibration]
) -> tuple[tuple[str, tuple[Text, ...]], ...]:
    check = of_covered(case.found, calibrations)
    residuals = [each.residual for each in calibrations if each.residual is not None]
    if residuals:
        left = " and ".join(f"{number(each.position_mm)} mm" for each in residuals)
        check.append(
            f"the {model_name(calibrations[0].choice)} model leaves {left} rms unexplained"
        )
    nothing = says_nothing(calibrations, case.measured)
    if case.measured.mean() < _MOSTLY and not nothing:
        check.append(f"{of_both(case.measured)}; elsewhere one of them is extrapolated")
    each, changed = case.found.parameters, []
    if each is not None and case.found.same_robot:
        changed = _largest(each) + of_deviations(calibrations)
    valid = "for these poses of the flange in the robot's base, as modelled; no readings"
    notes = {
        "CHECK": check,
        "PARAMETERS": changed,
        "VALID": [valid],
        "NEXT": [_next(case.found, nothing, is_in_doubt(case.measured))],
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


def _next(found: Difference, nothing: bool, in_doubt: bool) -> str:
    if not found.same_robot:
        return "compare two calibrations of one arm"
    if found.shared.all_of_both:
        return "choose between the settings by the held-out errors of the two"
    if nothing:
        return "compare at joints that both cover (--joints FILE), or the DH models (--model dh)"
    known, times = np.isfinite(found.probability), _times_chance(found)
    if not known and not np.isfinite(times):
        return "look below where they differ; a verdict takes two fitted calibrations"
    if not (has_changed(found) or (not known and times > _BEYOND)):
        return "nothing: keep the calibration that is loaded"
    if in_doubt:
        return f"{AGAIN}, before anything is changed at the robot"
    return f"{AGAIN}; where the change stays, load the new calibration and look for its cause"


def _sentence(line: str) -> str:
    """A line with a capital at its begin and a stop at its end."""
    return f"{line[:1].upper()}{line[1:]}."

"""The candidates of a campaign: rows of a file, drawn between measured poses or in a region."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinacc.cli import rows, spaces
from kinacc.cli.choice import CONFIG
from kinacc.deployment.applicability import is_measured_there
from kinacc.deployment.planning import between, spread, tool_positions
from kinacc.deployment.record import Calibration
from kinacc.errors import InputError, Problem, refuse
from kinacc.kinematics.inverse import limits
from kinacc.kinematics.model import JointState

MEASURED = "measured"
_SOURCES = {
    MEASURED: "drawn between neighbouring measured poses",
    "configured": "drawn evenly in joints from the configured evaluation space",
    "fitted": "drawn evenly from the joints the calibration covers",
    "limits": "drawn evenly from the joint limits",
}
_MOST_DRAWS = 64  # joint values drawn per candidate before the region is called too wide
_MOST_CANDIDATES = 20_000


@dataclass(frozen=True)
class Region:
    """Options that say what may be measured: a file, or where joints are drawn."""

    candidates: str | None
    drawn: int
    region: str | None
    joints_deg: str | None
    inside_mm: str | None
    point: str | None
    seed: int
    config: tuple[str, ...]

    @property
    def is_usual(self) -> bool:
        """Whether neither a region nor ranges of joints are asked for."""
        return self.region is None and self.joints_deg is None


@dataclass(frozen=True)
class CandidatePoses:
    """Reported joints (m, k), their names and directions of travel, and where they come from."""

    joints: np.ndarray
    label: list[str]
    directions: np.ndarray | None
    source: str


def candidates(
    wanted: Region, calibration: Calibration, answers: Mapping | None = None
) -> CandidatePoses:
    """The candidates the options ask for. Raises InputError.

    ``answers`` to what a file leaves open, by option.
    """
    if wanted.candidates is not None:
        file = rows.candidates(wanted.candidates, calibration.robot, _MOST_CANDIDATES, answers)
        label = [str(each) for each in file.label]
        source = f"rows of {Path(wanted.candidates).name}"
        return CandidatePoses(file.joints, label, file.directions, source)
    problems: list[Problem] = []
    box = spaces.joint_ranges(wanted.joints_deg, calibration.robot, problems)
    space = spaces.ranges("--inside-mm", wanted.inside_mm, 3, problems)
    refuse(problems)
    region, drawn_from, inside = _region(wanted, calibration)
    source = _SOURCES[region]
    if box is not None:
        source += ", in the joint ranges given"
    elif drawn_from is not None:
        box, source = drawn_from, "drawn evenly from the configured joint box"
    if space is not None:
        inside = spaces.inside_box(space)
        source += ", the tool in the box given"
    if wanted.is_usual and region != MEASURED:
        source += ", where the calibration was measured"
    if region != MEASURED:
        limited = calibration.robot.q_min_rad, calibration.robot.q_max_rad
        low, high = limited if region == "limits" else _covered(calibration)
        if box is not None:
            low, high = np.maximum(low, box[0]), np.minimum(high, box[1])
        box = low, high
    drawn = _drawn(wanted, calibration, region, box, inside)
    label = [str(number) for number in range(1, len(drawn) + 1)]
    return CandidatePoses(drawn, label, None, source)


def _drawn(wanted: Region, calibration: Calibration, region: str, box, inside) -> np.ndarray:
    """Joints drawn in a region; in the usual one only where the calibration was measured.

    ``box`` of reported joints and test ``inside`` of tool positions narrow it.
    """
    robot, count = calibration.robot, wanted.drawn
    known = region == MEASURED or wanted.is_usual
    while True:
        if region == MEASURED:
            drawn = _between(wanted, calibration, count, box, inside)
        else:
            drawn = spread(robot, count, box, inside, calibration.point(wanted.point))
        at = JointState(robot.dh_joints(drawn))
        if known:
            drawn = drawn[is_measured_there(calibration, at, wanted.point)]
        elif calibration.model.domain is not None:  # coupled joints have no box of their own
            drawn = drawn[~calibration.outside_range(at.q_rad).any(axis=1)]
        if len(drawn) >= wanted.drawn:
            return drawn[: wanted.drawn]
        if count >= _MOST_DRAWS * wanted.drawn:
            what = f"the calibration knows only {len(drawn)} of {count} joint values drawn"
            fix = "narrow the region" if region == MEASURED else "narrow it, or --region measured"
            raise InputError(Problem("candidates", what, f"{wanted.drawn}", fix))
        count *= 4


def _between(wanted: Region, calibration: Calibration, count: int, box, inside) -> np.ndarray:
    """Joints (at most ``count``, k) on the way between neighbouring fitted poses."""
    robot = calibration.robot
    poses = limits.reported_joints(robot, calibration.fitted.q_rad)
    drawn = between(poses, limits.travel_unit(robot), count, wanted.seed)
    kept = limits.within(drawn, robot.q_min_rad, robot.q_max_rad)
    if box is not None:
        kept &= limits.within(drawn, *box)
    if inside is not None:
        kept &= inside(tool_positions(robot, drawn, calibration.point(wanted.point)))
    return drawn[kept]


def _region(wanted: Region, calibration: Calibration):
    """The region asked for or the usual one, with the joint box and test of tool positions of it.

    Without a region and a space configured, candidates are drawn between measured poses.
    """
    region = wanted.region
    usual = MEASURED if calibration.fitted is not None else "fitted"
    if region == MEASURED and usual != MEASURED:
        what = "the results do not hold the poses that were fitted"
        raise InputError(Problem("--region measured", what, "fitted, limits, configured"))
    if region is None and wanted.joints_deg is not None:
        region = "fitted"
    if region is None:
        region = "configured" if _is_configured(wanted, calibration) else usual
    bounded = calibration.model.domain is not None
    if region == "limits" and bounded and wanted.joints_deg is None:
        model = calibration.choice.upper()
        what = f"the {model} model says nothing beyond the joints the data cover"
        raise InputError(Problem("--region limits", what, "measured, fitted"))
    if region != "configured":
        return region, None, None
    settings = spaces.settings_of(calibration.name, wanted.config)
    if settings.inside is None and settings.box is None:
        return usual, None, None
    return region, settings.box, settings.inside


def _is_configured(wanted: Region, calibration: Calibration) -> bool:
    """Whether the configuration given, or the one that lies here, has the calibration's data set.

    One that was given has to be readable; one that only lies here need not be about this arm.
    """
    from kinacc.workflow.data_sets import read_data_sets as read

    if wanted.config:
        return calibration.name in read(wanted.config).settings
    try:
        return Path(CONFIG).is_file() and calibration.name in read((CONFIG,)).settings
    except InputError:
        return False


def _covered(calibration: Calibration) -> tuple[np.ndarray, np.ndarray]:
    """Range of the reported joints that the data cover, where a joint is not coupled to others."""
    robot = calibration.robot
    if calibration.fitted_range_rad is None:
        return robot.q_min_rad, robot.q_max_rad
    return limits.cut_to_range(
        robot, robot.q_min_rad, robot.q_max_rad, calibration.fitted_range_rad
    )

"""The candidates of a campaign: rows of a file, or drawn from a region."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinacc.cli import rows, spaces
from kinacc.cli.choice import CONFIG
from kinacc.deployment.planning.candidates import spread
from kinacc.deployment.record import Calibration
from kinacc.errors import InputError, Problem, refuse
from kinacc.kinematics.inverse import limits

_MOST_DRAWS = 256  # joint values drawn per candidate before the region is called too wide
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
    config: tuple[str, ...]


@dataclass(frozen=True)
class CandidatePoses:
    """Reported joints (m, k), their names and directions of travel, and where they come from."""

    joints: np.ndarray
    label: list[str]
    directions: np.ndarray | None
    source: str


def candidates(wanted: Region, calibration: Calibration) -> CandidatePoses:
    """The candidates the options ask for. Raises InputError."""
    if wanted.candidates is not None:
        file = rows.candidates(wanted.candidates, calibration.robot, _MOST_CANDIDATES)
        label = [str(each) for each in file.label]
        source = f"rows of {Path(wanted.candidates).name}"
        return CandidatePoses(file.joints, label, file.directions, source)
    problems: list[Problem] = []
    box = spaces.joint_ranges(wanted.joints_deg, calibration.robot, problems)
    space = spaces.ranges("--inside-mm", wanted.inside_mm, 3, problems)
    refuse(problems)
    inside, source = None, "drawn evenly from the joint ranges given"
    if box is None:
        box, inside, source = _region(wanted, calibration)
    if space is not None:
        inside = spaces.inside_box(space)
        source += ", the tool in the box given"
    limited = calibration.robot.q_min_rad, calibration.robot.q_max_rad
    low, high = limited if wanted.region == "limits" else _covered(calibration)
    if box is not None:
        low, high = np.maximum(low, box[0]), np.minimum(high, box[1])
    drawn = _spoken_of(calibration, wanted, (low, high), inside)
    label = [str(number) for number in range(1, len(drawn) + 1)]
    return CandidatePoses(drawn, label, None, source)


def _spoken_of(calibration: Calibration, wanted: Region, box, inside) -> np.ndarray:
    """Joints drawn from a box, without those that the model says nothing of."""
    count = wanted.drawn
    while True:
        drawn = spread(calibration.robot, count, box, inside, calibration.point(wanted.point))
        if calibration.model.domain is not None:  # coupled joints have no box of their own
            drawn = drawn[
                ~calibration.outside_range(calibration.robot.dh_joints(drawn)).any(axis=1)
            ]
        if len(drawn) >= wanted.drawn:
            return drawn[: wanted.drawn]
        if count >= _MOST_DRAWS * wanted.drawn:
            what = f"the model speaks of only {len(drawn)} of {count} joint values drawn"
            raise InputError(Problem("candidates", what, f"{wanted.drawn}", "narrow the region"))
        count *= 4


def _region(wanted: Region, calibration: Calibration):
    """Joint box, test of tool positions and words of the region asked for."""
    region = wanted.region
    if region is None:
        region = "configured" if _is_configured(wanted, calibration) else "fitted"
    if region == "limits":
        if calibration.model.domain is not None:
            model = calibration.choice.upper()
            what = f"the {model} model says nothing beyond the joints the data cover"
            raise InputError(Problem("--region limits", what, "fitted"))
        return None, None, "drawn evenly from the joint limits"
    if region == "fitted":
        return None, None, "drawn evenly from the joints the calibration covers"
    settings = spaces.settings_of(calibration.name, wanted.config)
    if settings.inside is not None:
        source = "drawn evenly in joints from the configured evaluation space"
        return None, settings.inside, source
    if settings.box is not None:
        return settings.box, None, "drawn evenly from the configured joint box"
    return None, None, "drawn evenly from the joints the calibration covers"


def _is_configured(wanted: Region, calibration: Calibration) -> bool:
    """Whether the configuration given, or the one that lies here, has the calibration's data set.

    One that was given has to be readable; one that only lies here need not be about this arm.
    """
    from kinacc.workflow.plan import planned as read

    if wanted.config:
        return calibration.name in read(wanted.config).datasets
    try:
        return Path(CONFIG).is_file() and calibration.name in read((CONFIG,)).datasets
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

"""The campaigns of one calibration and their bounds on its largest error."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinacc.campaign import folder
from kinacc.campaign.folder import JOURNAL, PLAN
from kinacc.campaign.plan import Plan
from kinacc.campaign.status import CampaignStatus, status
from kinacc.deployment import folder as results
from kinacc.errors import InputError
from kinacc.kinematics import robot
from kinacc.kinematics.model import JointState
from kinacc.tables.columns import Columns

_SAME_MM = 1e-6  # modelled positions that differ by less are of one model


@dataclass(frozen=True)
class Sought:
    """The status of the campaign of a calibration, if there is one, and what hides others."""

    status: CampaignStatus | None
    remarks: tuple[str, ...] = ()


def newest(name: str, tables: Mapping[str, Columns], places: Iterable[Path]) -> Sought:
    """Return the campaign of the calibration ``name`` among the folders ``places``, the newest.

    ``tables`` are those of its results folder, ``places`` those of :func:`folder.of_results`. A
    campaign holds the positions that its model predicts: one that was begun with an earlier
    calibration of that name is left out.
    """
    remarks = []
    ordered = sorted(set(places), key=_last_reading, reverse=True)
    for number, place in enumerate(ordered, 1):
        try:
            opened = folder.open_(place)
            if not _is_of(opened.plan, tables):
                remarks.append(f"campaign {place} was begun with another calibration of {name}")
                continue
            summary = status(opened, opened.state())
        except InputError:
            command = shlex.join(["kinacc", "campaign", "status", str(place)])
            remarks.append(f"campaign {place} cannot be read: {command}")
            continue
        if others := [str(path) for path in ordered[number:]]:
            remarks.append(f"there are older campaigns: {', '.join(others)}")
        return Sought(summary, tuple(remarks))
    return Sought(None, tuple(remarks))


def finished(tables: Mapping[str, Columns], model: str, places: Iterable[Path]) -> float:
    """Return the upper bound of the last finished campaign on a calibration.

    Parameters
    ----------
    tables : mapping
        Tables of the results folder.
    model : str
        Model that the campaign is about.
    places : iterable of path
        Folders of campaigns (:func:`kinacc.campaign.folder.of_results`).

    Returns
    -------
    float
        Upper bound in mm, by the times of the journals the last; NaN where there is none.
    """
    ended = []
    for place in places:
        with suppress(InputError):
            opened = folder.open_(place)
            if opened.plan.about["model"] != model or not _is_of(opened.plan, tables):
                continue
            summary = status(opened, opened.state())
            bound = summary.of_all
            if summary.next_point is None and np.isfinite(bound.upper_mm) and not bound.excepted:
                ended.append((summary.recorded, bound.upper_mm))
    return max(ended, default=("", np.nan))[1]


def _last_reading(place: Path) -> float:
    """Time of the last reading; of the plan where there is none."""
    journal = place / JOURNAL
    return (journal if journal.is_file() else place / PLAN).stat().st_mtime


def _is_of(plan: Plan, tables: Mapping[str, Columns]) -> bool:
    """Whether the model the campaign judges is the one that the tables hold now."""
    try:
        arm = robot.of_text(str(tables["robot"]["description"][0]), "robot.parquet")
        if len(arm.q_min_rad) != plan.points.joints.shape[1]:
            return False
        about = plan.about
        calibration = results.calibration(tables, arm, about["model"], about["calibration"])
        state = JointState(arm.dh_joints(plan.points.joints), plan.points.directions)
        modelled_mm = calibration.pose(state, "base", about["point"]).position_mm
    except InputError:
        return False  # the model or the target is not there any more
    return bool(np.abs(modelled_mm - plan.points.modelled_mm).max() < _SAME_MM)

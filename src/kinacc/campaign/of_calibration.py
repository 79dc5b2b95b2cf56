"""Campaigns of a calibration: the newest one, and the bounds of finished ones in its history."""

from __future__ import annotations

import shlex
from collections import defaultdict
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.campaign import folder
from kinacc.campaign.beside_results import JOURNAL, PLAN
from kinacc.campaign.plan import Plan
from kinacc.campaign.status import CampaignStatus, status
from kinacc.config.records import Settings
from kinacc.deployment import folder as results
from kinacc.deployment.history import history as compared
from kinacc.deployment.history import session_of
from kinacc.errors import InputError
from kinacc.kinematics.model import JointState
from kinacc.tables import store
from kinacc.tables.columns import Columns, Tables

_SAME_MM = 1e-6  # modelled positions that differ by less are of one model


def newest(
    name: str, model: str, tables: Tables, places: Iterable[Path]
) -> tuple[CampaignStatus | None, tuple[str, ...]]:
    """Return the status of the newest campaign of a calibration, and remarks on others.

    ``name`` of the calibration; ``tables`` are those of its results folder, ``places`` those of
    :func:`kinacc.campaign.beside_results.of_results`. None without a campaign. Campaigns on the
    selected ``model`` come before those on another. A campaign holds the positions that its model
    predicts: one that was begun with an earlier calibration of that name is left out.
    """
    remarks: list[str] = []
    fallback = None
    for place in sorted(set(places), key=_last_reading, reverse=True):
        try:
            opened = folder.open_(place)
            if not _is_of(opened.plan, tables):
                remarks.append(f"campaign {place} was begun with another calibration of {name}")
            elif opened.plan.about["model"] == model:
                return status(opened), tuple(remarks)
            else:
                fallback = fallback or opened
        except InputError:
            command = shlex.join(["kinacc", "campaign", "status", str(place)])
            remarks.append(f"campaign {place} cannot be read: {command}")
    return status(fallback) if fallback else None, tuple(remarks)


def history(inputs: Mapping[str, Any], settings: Settings) -> Columns:
    """Return table ``history``: calibrations of a series against one another, a row each by date.

    Parameters
    ----------
    inputs : mapping
        ``<line>/<table>``: tables of the calibration of each line of the series; files of
        campaigns.
    settings : mapping
        Settings of the data set.
    """
    calibrations = defaultdict[str, dict[str, Any]](dict)
    campaigns = set[Path]()
    for role, value in inputs.items():
        if isinstance(value, Path):
            campaigns.add(value.parent)
        else:
            name, _, table = role.partition("/")
            calibrations[name][table] = value
    sessions = []
    for line in settings["series"]:
        tables = calibrations[line["name"]]
        facts = {
            "digest": store.digest_of("measurements", tables["measurements"]),
            "bound_mm": finished(tables, results.selected_model(tables), campaigns),
            "tolerance_mm": settings["tolerance"]["mm"],
        }
        sessions.append(
            session_of(tables, line["name"], line["date"], line["base"], line["tool"], **facts)
        )
    weight = settings["calibration"]["rotation_weight_mm_per_rad"]
    return compared(sessions, weight)


def finished(tables: Tables, model: str, places: Iterable[Path]) -> float:
    """Return the upper bound (mm) of the campaign on a calibration that was finished last.

    ``model``: the one that the campaign is about; ``places``: folders of campaigns. NaN where there
    is no campaign, by the times of the journals.
    """
    ended = []
    for place in places:
        with suppress(InputError):
            opened = folder.open_(place)
            if opened.plan.about["model"] != model or not _is_of(opened.plan, tables):
                continue
            summary = status(opened)
            bound = summary.of_all
            if summary.next_point is None and np.isfinite(bound.upper_mm) and not bound.excepted:
                ended.append((summary.recorded, bound.upper_mm))
    return max(ended, default=("", np.nan))[1]


def _last_reading(place: Path) -> float:
    """Time of the last reading; of the plan where there is none."""
    journal = place / JOURNAL
    return (journal if journal.is_file() else place / PLAN).stat().st_mtime


def _is_of(plan: Plan, tables: Tables) -> bool:
    """Whether the model the campaign judges is the one that the tables hold now."""
    about, points = plan.about, plan.points
    try:
        calibration = results.calibration(tables, about["model"], about["calibration"])
        state = JointState(calibration.robot.dh_joints(points.joints), points.directions)
        modelled_mm = calibration.pose(state, "base", about["point"]).position_mm
    except (InputError, ValueError):
        return False  # the model or the target is not there any more, or the robot is another one
    return bool(np.abs(modelled_mm - points.modelled_mm).max() < _SAME_MM)

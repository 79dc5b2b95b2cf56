"""What campaigns say of the largest error of one calibration."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinacc.assess.statement import CANDIDATES, TARGETS, Statement
from kinacc.campaign import folder
from kinacc.campaign.journal import JOURNAL, PLAN
from kinacc.campaign.state import State
from kinacc.deployment import folder as results
from kinacc.errors import InputError
from kinacc.kinematics import robot
from kinacc.kinematics.model import JointState
from kinacc.tables.columns import Columns

_ORDER = (CANDIDATES, *(each for each in reversed(TARGETS) if each != CANDIDATES))
_SAME_MM = 1e-6  # modelled positions that differ by less are of one model


@dataclass(frozen=True)
class Assessed:
    """A campaign at its place, how it stands, and what it says: of all candidates if it can.

    ``recorded`` is when its last entry was made; empty where there is none.
    """

    place: Path
    state: State
    said: Statement | None
    recorded: str = ""

    @property
    def next_command(self) -> str:
        """What goes on with the campaign, or ends it."""
        going = self.state.asked is not None
        return shlex.join(["kinacc", "campaign", "next" if going else "report", str(self.place)])


@dataclass(frozen=True)
class Sought:
    """The campaign of a calibration, if there is one, and what stood in the way of others."""

    assessed: Assessed | None
    remarks: tuple[str, ...] = ()


def sought(name: str, tables: Mapping[str, Columns], places: Iterable[Path]) -> Sought:
    """The campaign of the calibration ``name`` among the folders ``places``, the one read last.

    ``tables`` are those of its results folder, ``places`` what :func:`journal.of_results` finds.
    Campaigns keep where their model saw the
    candidates, so that one begun before the arm was calibrated anew is told from one that speaks
    of the models now there.
    """
    remarks = []
    found = sorted(set(places), key=_last_reading, reverse=True)
    for number, place in enumerate(found, 1):
        try:
            opened = folder.open_(place)
            if not _is_of(opened.plan, tables):
                remarks.append(f"campaign {place} was begun with another calibration of {name}")
                continue
            state = opened.state()
        except InputError:
            command = shlex.join(["kinacc", "campaign", "status", str(place)])
            remarks.append(f"campaign {place} cannot be read: {command}")
            continue
        if others := [str(each) for each in found[number:]]:
            remarks.append(f"there are older campaigns: {', '.join(others)}")
        said = sorted(state.statements(), key=lambda each: _ORDER.index(each.target))
        recorded = max(opened.recorded, default="")
        return Sought(Assessed(place, state, said[0] if said else None, recorded), tuple(remarks))
    return Sought(None, tuple(remarks))


def finished(tables: Mapping[str, Columns], model: str, places: Iterable[Path]) -> float:
    """Upper bound, mm, of the last campaign on a calibration's ``model`` that came to its end.

    The last by the times of its journal, so that it is the same wherever its folder is copied to.
    NaN where there is none; one that cannot be read is none.
    """
    ended = []
    for place in places:
        with suppress(InputError):
            opened = folder.open_(place)
            if opened.plan.about["model"] != model or not _is_of(opened.plan, tables):
                continue
            state = opened.state()
            said = min(state.statements(), key=lambda each: _ORDER.index(each.target), default=None)
            whole = said is not None and np.isfinite(said.upper_mm) and not said.excepted
            if state.asked is None and said is not None and whole:
                ended.append((max(opened.recorded, default=""), said.upper_mm))
    return max(ended, default=("", np.nan))[1]


def _last_reading(place: Path) -> float:
    """Time of the last reading; of the plan where there is none."""
    journal = place / JOURNAL
    return (journal if journal.is_file() else place / PLAN).stat().st_mtime


def _is_of(plan, tables: Mapping[str, Columns]) -> bool:
    """Whether the model the campaign judges is the one that the tables hold now."""
    try:
        arm = robot.of_text(str(tables["robot"]["description"][0]), "robot.parquet")
        if len(arm.q_min_rad) != plan.points.joints.shape[1]:
            return False
        about = plan.about
        calibration = results.calibration(tables, arm, about["model"], about["calibration"])
        at = JointState(arm.dh_joints(plan.points.joints), plan.points.directions)
        seen = calibration.pose(at, "base", about["point"]).position_mm
    except InputError:
        return False  # the model or the target is not there any more
    return bool(np.abs(seen - plan.points.modelled_mm).max() < _SAME_MM)

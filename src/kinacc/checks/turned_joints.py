"""Joints misread where positions hardly show it, told by the orientations of the targets.

A joint near the target turns it without moving it much: read with the wrong sign it leaves the
positions of many files as good as they were. The orientations, which change nothing in how the
positions are judged, then contradict the joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinacc.checks import changes, hand_eye, turns
from kinacc.checks.cells import Cells
from kinacc.checks.changes import Meaning
from kinacc.checks.meaning import Misfit, seen_as
from kinacc.kinematics.robot import Robot

BAD_RAD = 0.02  # scatter that no arm as described leaves, calibrated or not
_ROWS = 120
_AS_GOOD = 1.5  # times the misfit of the positions as they are read
_SHOWN = 0.005  # of the points' spread: misfits below are the arm's own


@dataclass(frozen=True)
class Turned:
    """A meaning under which the orientations scatter by ``found_rad``, not ``before_rad``."""

    meaning: Meaning
    before_rad: float
    found_rad: float


def find(cells: Cells, robot: Robot, here: Meaning, least_rad: float) -> Turned | None:
    """One change of the joints that brings the orientations together; None where none does.

    ``least_rad`` is what other ways to read the orientations leave: a change of the joints is
    preferred where it does about as well.
    """
    largest = np.argmax(np.bincount(cells.session[cells.turned]))
    rows = np.flatnonzero(cells.turned & (cells.session == largest))
    few = cells.select(hand_eye.thinned(rows, _ROWS))
    misfit = Misfit(few, robot)
    before, limit = _scatter(few, misfit, here), _AS_GOOD * max(misfit(here), _SHOWN)
    rivals = [r for r in changes.single(here, robot.dh.prismatic) if misfit(r) < limit]
    tried = [(_scatter(few, misfit, each), each) for each in rivals]
    if not tried:
        return None
    # The common changes come first: of those that do about as well, the first.
    least = min(value for value, _ in tried)
    found, best = next((value, each) for value, each in tried if value < 1.5 * least)
    if found > turns.BETTER * before or found > 1.5 * least_rad:
        return None
    return Turned(best, before, found)


def _scatter(cells: Cells, misfit: Misfit, meaning: Meaning) -> float:
    rotation = seen_as(cells, meaning).cells.rotation
    return turns.scatter(misfit.flange(meaning), rotation, cells.target)

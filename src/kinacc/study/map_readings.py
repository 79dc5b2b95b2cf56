"""Readings of Fig. 3: which attitude the flange has before its turns, and which turns it makes.

The paper says that at every place of the grid the flange is turned by +-45 degrees about its own
axes; neither the orientation before these turns nor the frame that keeps it is stated.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import NamedTuple

import numpy as np

from kinacc.artifacts.columns import Columns
from kinacc.study.choices.open_choices import ORIENTATIONS_DEG
from kinacc.study.claims.map_sentences import map_claims


class Reading(NamedTuple):
    """Values of the keys of ``evaluation`` that say which poses the map is about."""

    reference_frame: str
    reference_orientation_deg: tuple[float, float, float]
    rotations: str

    @property
    def orientation(self) -> str:
        """The angles as text: 180, -45, 0."""
        return ", ".join(f"{angle:g}" for angle in self.reference_orientation_deg)

    def of(self, config: Mapping) -> dict:
        """The configuration of a data set under this reading."""
        own = {**self._asdict(), "reference_orientation_deg": [*self.reference_orientation_deg]}
        return {**config, "evaluation": {**config["evaluation"], **own}}


READINGS = tuple(
    Reading(frame, angles, rotations)
    for frame, angles, rotations in product(
        ("slice", "base"), ORIENTATIONS_DEG, ("signs_and_zero", "all_27")
    )
)
SENTENCES = tuple(claim.id for claim in map_claims())


class Shares(NamedTuple):
    """Of every reading (n,): ``arms`` drawn, share of them on which each sentence holds (n, 7),
    sentences that hold on an arm, in the mean, and share of the combinations that are reached.

    NaN where no arm was found; an arm on which a sentence cannot be judged does not count to it.
    """

    arms: np.ndarray
    holds: np.ndarray
    sentences: np.ndarray
    reached: np.ndarray


def shares(table: Columns) -> Shares:
    """Shares over the arms of ``map_readings``, in the order of ``READINGS``."""
    rows = [_rows(table, reading) for reading in READINGS]
    agrees = np.asarray(table["verdict"]) == "agrees"
    judged = agrees | (np.asarray(table["verdict"]) == "differs")
    claim, seed = np.asarray(table["claim"]), np.asarray(table["seed"])
    arms = np.array([len(np.unique(seed[mine])) for mine in rows])
    holds = np.array(
        [[_mean(agrees[mine & judged & (claim == name)]) for name in SENTENCES] for mine in rows]
    )
    counted = [_mean(agrees[mine]) * len(SENTENCES) for mine in rows]
    reached = [_mean(np.asarray(table["reached"])[mine]) for mine in rows]
    return Shares(arms, holds, np.array(counted), np.array(reached))


def _rows(table: Columns, reading: Reading) -> np.ndarray:
    return (
        (np.asarray(table["reference_frame"]) == reading.reference_frame)
        & (np.asarray(table["reference_orientation"]) == reading.orientation)
        & (np.asarray(table["rotations"]) == reading.rotations)
    )


def _mean(values: np.ndarray) -> float:
    return float(np.mean(values)) if len(values) else float("nan")

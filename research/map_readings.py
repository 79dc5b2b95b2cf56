"""Readings of Fig. 3: which attitude the flange has before its turns, and which turns it makes.

The paper says that at every place of the grid the flange is turned by +-45 degrees about its own
axes; neither the orientation before these turns nor the frame that keeps it is stated.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product
from typing import NamedTuple

import numpy as np
import pandas as pd

from kinacc.config.error_models import ALWAYS
from kinacc.study import in_memory
from kinacc.study.claims.claim import sentences, verdict
from kinacc.study.claims.map_sentences import map_values
from research import arm_search
from research.open_choices import ORIENTATIONS_DEG


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
SENTENCES = tuple(claim.id for claim in sentences()["map"])


def judged_arms(reading: Reading, config: Mapping, arms: int, seeds: int) -> Iterator[dict]:
    """Every sentence on every arm accepted under a reading: ``arms`` of at most ``seeds`` tried.

    A calibration has to cover the poses it is judged on, so each reading has its own calibration
    plan and its own arms, drawn by the rule of the shipped ones; the maps have no say in that.
    """
    own = reading.of(config)
    bench = arm_search.bench_of(own)
    for each in arm_search.search(bench, arms, seeds):
        start = {"measurements": in_memory.without_folds(arm_search.measured(bench, each.draw))}
        tables = in_memory.run((*ALWAYS, "accuracy_map"), own, start)
        drawn = tables["accuracy_map"]
        values = map_values(drawn)
        for claim in sentences()["map"]:
            value = values[claim.id]
            yield {
                "reference_frame": reading.reference_frame,
                "reference_orientation": reading.orientation,
                "rotations": reading.rotations,
                "seed": each.draw.seed,
                "reached": float(np.sum(drawn["solutions"]) / np.sum(drawn["wanted"])),
                "claim": claim.id,
                "reproduced": value,
                "verdict": verdict(claim, value),
            }


class Shares(NamedTuple):
    """Of every reading (n,): ``arms`` drawn, share of them on which each sentence holds (n, 7),
    sentences that hold on an arm, in the mean, and share of the combinations that are reached.

    NaN where no arm was found; an arm on which a sentence cannot be judged does not count to it.
    """

    arms: np.ndarray
    holds: np.ndarray
    sentences: np.ndarray
    reached: np.ndarray


def shares(table: pd.DataFrame) -> Shares:
    """Shares over the arms of ``map_readings``, in the order of ``READINGS``."""
    rows = [table[_mine(table, reading)] for reading in READINGS]
    agrees = [own["verdict"] == "agrees" for own in rows]
    judged = [own[own["verdict"].isin(["agrees", "differs"])] for own in rows]
    holds = [
        [(own["verdict"][own["claim"] == name] == "agrees").mean() for name in SENTENCES]
        for own in judged
    ]
    return Shares(
        np.array([own["seed"].nunique() for own in rows]),
        np.array(holds),
        np.array([each.mean() * len(SENTENCES) for each in agrees]),
        np.array([own["reached"].mean() for own in rows]),
    )


LEAST_REACHED = 0.55  # share of the combinations; the paper speaks of none that it did not reach


def choice(table: pd.DataFrame) -> pd.DataFrame:
    """The readings of the table, one of them ``chosen``: the paper's sentences are about its maps.

    Of the readings that reach ``LEAST_REACHED`` of their combinations, the one under which most
    of the seven sentences hold on an arm, in the mean. Readings whose mean is less by no more
    than the standard error of the difference are ties; the simpler one is taken: fewer angles
    that are not zero, then nine turns before 27, then the order of ``READINGS``.
    """
    rows = []
    for reading in READINGS:
        own = table[_mine(table, reading)]
        if own.empty:
            continue
        held = (own["verdict"] == "agrees").groupby(own["seed"]).sum()
        turned = sum(angle != 0.0 for angle in reading.reference_orientation_deg[1:])
        rows.append({
            "reference_frame": reading.reference_frame,
            "reference_orientation": reading.orientation,
            "rotations": reading.rotations,
            "arms": len(held),
            "reached": own.drop_duplicates("seed")["reached"].mean(),
            "sentences": held.mean(),
            "standard_error": held.std(ddof=1) / np.sqrt(len(held)),
            "simplicity": (turned, reading.rotations == "all_27"),
        })  # fmt: skip
    found = pd.DataFrame(rows)
    able = found[found["reached"] >= LEAST_REACHED]
    best = able.loc[able["sentences"].idxmax()]
    error = np.hypot(able["standard_error"], best["standard_error"])
    ties = able[best["sentences"] - able["sentences"] <= error]
    found["chosen"] = (
        found.index == ties["simplicity"].map(tuple).sort_values(kind="stable").index[0]
    )
    return found.drop(columns="simplicity")


def _mine(table: pd.DataFrame, reading: Reading) -> pd.Series:
    return (
        (table["reference_frame"] == reading.reference_frame)
        & (table["reference_orientation"] == reading.orientation)
        & (table["rotations"] == reading.rotations)
    )

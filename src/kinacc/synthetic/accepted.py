"""The draws of the synthetic arm that met the acceptance rule, as shipped with kinacc."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np
import pandas as pd

from kinacc.errors import input_error
from kinacc.kinematics.dh import DHModel
from kinacc.synthetic.draw import Scales

FILE = "accepted_draws.csv"
GEOMETRY = ("theta_offset_rad", "d_mm", "a_mm", "alpha_rad")
JOINTS = 6


@dataclass(frozen=True)
class AcceptedDraw:
    """One arm: its ``seed``, the ``scales`` of its effects, its DH ``geometry``."""

    seed: int
    scales: Scales
    geometry: DHModel


def geometry_columns() -> list[str]:
    """Names of the table's columns that hold the geometry: theta_offset_1_rad, ..., alpha_6_rad."""
    split = [name.rsplit("_", 1) for name in GEOMETRY]
    return [f"{name}_{joint}_{unit}" for joint in range(1, JOINTS + 1) for name, unit in split]


@cache
def rows() -> list[dict[str, float]]:
    """Rows of the table of accepted draws, in order of their seeds; lines with # are remarks."""
    with (resources.files("kinacc") / "synthetic" / FILE).open(encoding="utf-8") as file:
        table = pd.read_csv(file, comment="#", dtype=str)
    return table.astype(float).to_dict("records")


def accepted_draw(number: int) -> AcceptedDraw:
    """One accepted draw.

    Parameters
    ----------
    number : int
        Number of the draw, counted from 0.

    Returns
    -------
    AcceptedDraw
        The arm; lengths in mm, angles in rad.

    Raises
    ------
    InputError
        Where there are fewer draws.
    """
    _require("measurements.synthetic.draw", number + 1)
    row = rows()[number]
    values = np.array([row[name] for name in geometry_columns()]).reshape(JOINTS, -1)
    scales = Scales(*(row[name] for name in Scales._fields))
    geometry = dict(zip(GEOMETRY, values.T, strict=True))
    return AcceptedDraw(int(row["seed"]), scales, DHModel(**geometry, beta_rad=np.zeros(JOINTS)))


def further_draws(own: int, count: int) -> list[int]:
    """Numbers of the first ``count`` accepted draws but the ``own`` one.

    Raises InputError where there are fewer.
    """
    _require("robustness.draws", count + 1)
    return [number for number in range(count + 1) if number != own][:count]


def _require(key: str, count: int) -> None:
    """InputError by the name of a key unless there are that many draws."""
    if not 1 <= count <= len(rows()):
        what = f"{count} accepted draws are wanted, there are {len(rows())}"
        fix = "the rule arms of research/Snakefile searches for more"
        raise input_error(key, what, "", fix)

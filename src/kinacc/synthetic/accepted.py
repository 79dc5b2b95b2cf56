"""The draws of the synthetic arm that met the acceptance rule, as shipped with kinacc."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.kinematics.dh import DHModel
from kinacc.synthetic.draw import AS_TUNED, Roughness, Scales

FILE = "accepted_draws.csv"
GEOMETRY = ("theta_offset_rad", "d_mm", "a_mm", "alpha_rad")
JOINTS = 6


@dataclass(frozen=True)
class AcceptedDraw:
    """One arm: its ``seed``, the ``scales`` of its effects, its DH ``geometry``.

    Another ``roughness`` than the one it was accepted with makes another arm of it.
    """

    seed: int
    scales: Scales
    geometry: DHModel
    roughness: Roughness = AS_TUNED


def geometry_columns() -> list[str]:
    """Names of the table's columns that hold the geometry: theta_offset_1_rad, ..., alpha_6_rad."""
    split = [name.rsplit("_", 1) for name in GEOMETRY]
    return [f"{name}_{joint}_{unit}" for joint in range(1, JOINTS + 1) for name, unit in split]


@cache
def rows() -> tuple[dict[str, str], ...]:
    """The table's rows as texts, in order of their seeds; lines starting with # are remarks."""
    text = (resources.files("kinacc") / "synthetic" / FILE).read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return tuple(csv.DictReader(lines))


def accepted_draw(number: int) -> AcceptedDraw:
    """Accepted draw ``number``, counted from 0. Raises InputError where there are fewer."""
    table = rows()
    if not 0 <= number < len(table):
        raise InputError(
            Problem(
                "measurements.synthetic.draw",
                f"there is no accepted draw {number}",
                f"0 to {len(table) - 1}",
                "the rule arms of research/Snakefile searches for more",
            )
        )
    row = table[number]
    values = np.array([float(row[name]) for name in geometry_columns()]).reshape(JOINTS, -1)
    return AcceptedDraw(
        int(row["seed"]),
        Scales(*(float(row[name]) for name in Scales._fields)),
        DHModel(*values.T, np.zeros(JOINTS)),
    )


def further_draws(own: int, count: int) -> list[int]:
    """Numbers of the first ``count`` accepted draws other than ``own``.

    Raises InputError where there are fewer.
    """
    others = [number for number in range(len(rows())) if number != own]
    if count > len(others):
        raise InputError(
            Problem(
                "robustness.draws",
                f"{count} further draws are wanted",
                f"at most {len(others)}",
                "the rule arms of research/Snakefile searches for more",
            )
        )
    return others[:count]

"""A finished results folder recomputed from its Parquet files alone, as the contract says.

Read with pyarrow, row by row; every pose is one chain of 4x4 matrices.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from scipy.spatial.transform import Rotation

from . import kinematics
from .assessors import gamma99

Row = dict


def rows(folder: Path, name: str) -> list[Row]:
    return pq.read_table(Path(folder) / f"{name}.parquet").to_pylist()


def joints(row: Row, letter: str = "q") -> list[float]:
    return [row[f"{letter}{i}"] for i in range(1, 8) if f"{letter}{i}" in row]


@dataclass(frozen=True)
class Models:
    """Everything needed to place a target: the fitted models and the frames of each."""

    dh: list[tuple[float, ...]]
    vec: list[Row]
    frames: dict[tuple[str, str], np.ndarray]

    def flange(self, model: str, q: list[float], s: list[int]) -> np.ndarray:
        """Flange in the robot base; the VEC's rotation projected to a true one."""
        if model != "vec":
            return kinematics.dh_forward(self.dh if model == "dh" else self.nominal, q)
        series = np.zeros((len(q), 6, 1 + max(row["order"] for row in self.vec)))
        offsets, low, high = np.zeros((len(q), 2)), np.zeros(len(q)), np.zeros(len(q))
        for row in self.vec:
            joint, direction = row["joint"] - 1, row["direction"]
            low[joint], high[joint] = row["q_min_rad"], row["q_max_rad"]
            if direction:
                offsets[joint, direction > 0] = row["coefficient"]
            else:
                error = kinematics.ERROR_NAMES.index(row["error"])
                series[joint, error, row["order"]] = row["coefficient"]
        return kinematics.projected(
            kinematics.vec_forward(self.nominal, series, low, high, offsets, q, s)
        )

    def measured(self, model: str, q: list[float], s: list[int], frame: str) -> np.ndarray:
        """A target as the instrument would see it."""
        return self.frames[model, "base"] @ self.flange(model, q, s) @ self.frames[model, frame]

    @property
    def nominal(self) -> list[tuple[float, ...]]:
        return dh_table({row["joint"]: row for row in self.vec}.values())


def dh_table(records) -> list[tuple[float, ...]]:
    names = ("theta_offset_rad", "d_mm", "a_mm", "alpha_rad", "beta_rad")
    return [tuple(r[n] for n in names) for r in sorted(records, key=lambda r: r["joint"])]


def models(folder: Path) -> Models:
    frames = {(row["model"], row["frame"]): placed(row) for row in rows(folder, "frames")}
    return Models(dh_table(rows(folder, "dh_model")), rows(folder, "vec_model"), frames)


def placed(row: Row) -> np.ndarray:
    """The frame (4, 4) of a row; not turned where it has a position alone."""
    turned = None
    if row["qw"] is not None:
        turned = Rotation.from_quat([row[f"q{c}"] for c in "wxyz"], scalar_first=True)
    return kinematics.frame(row["x_mm"], row["y_mm"], row["z_mm"], turned)


def magnitudes(
    models_: Models, measurements: list[Row], comparison: str
) -> tuple[list[float], list[float]]:
    """Position (mm) and orientation (mrad) magnitudes of one comparison, row by row.

    Two models are compared where the instrument sees them: their own bases are two estimates of
    one place."""
    position, orientation = [], []
    for row in measurements:
        q, s, target = joints(row), joints(row, "s"), row["target"]
        left, right = comparison.split("_vs_")
        other = placed(row) if right == "measured" else models_.measured(right, q, s, target)
        gap, turn = kinematics.apart(models_.measured(left, q, s, target), other)
        position.append(gap)
        if row["qw"] is not None:
            orientation.append(turn)
    return position, orientation


def statistics(values: list[float]) -> dict[str, float]:
    """Mean, max, rms and the 99 % quantile of a gamma fitted by maximum likelihood."""
    return {
        "mean": math.fsum(values) / len(values),
        "max": max(values),
        "rms": math.sqrt(math.fsum(v * v for v in values) / len(values)),
        "gamma99": gamma99(values),
    }

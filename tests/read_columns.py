"""Columns of measurements as arrays, and what a run reads held to what was made."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

Q_DEG = [f"q{i}_deg" for i in range(1, 7)]
XYZ_MM = ["x_mm", "y_mm", "z_mm"]


def joints_of(columns: Mapping) -> np.ndarray:
    """Joints (n, k), rad and mm."""
    return pd.DataFrame(columns).filter(regex=r"^q\d$").to_numpy()


def points_of(columns: Mapping) -> np.ndarray:
    """Positions (n, 3) in mm."""
    return pd.DataFrame(columns)[XYZ_MM].to_numpy()


def turns_of(columns: Mapping) -> Rotation:
    """Orientations (n,)."""
    return Rotation.from_quat(pd.DataFrame(columns)[["qx", "qy", "qz", "qw"]])

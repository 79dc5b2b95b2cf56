"""Files of measured poses, as a tracker writes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation


def write_noisy(
    path: Path, q_rad: np.ndarray, poses: np.ndarray, rng, noise_mm: float, noise_rad: float, **more
) -> Path:
    """As ``write_readings``, of poses (n, 4, 4) that are read with noise."""
    noise = rng.normal(size=(len(poses), 6))
    turned = Rotation.from_rotvec(noise_rad * noise[:, :3]) * Rotation.from_matrix(poses[:, :3, :3])
    return write_readings(path, q_rad, poses[:, :3, 3] + noise_mm * noise[:, 3:], turned, **more)


def write_readings(
    path: Path, q_rad: np.ndarray, position_mm: np.ndarray, turned: Rotation | None = None, **more
) -> Path:
    """Joints (n, k), points (n, 3), orientations and further columns by name; the path."""
    rows = pd.DataFrame(np.rad2deg(q_rad)).rename(columns=lambda i: f"q{i + 1}_deg")
    rows[["x_mm", "y_mm", "z_mm"]] = position_mm
    if turned is not None:
        rows[["qw", "qx", "qy", "qz"]] = turned.as_quat(scalar_first=True)
    rows.assign(**more).to_csv(path, index=False, float_format="%.9f")
    return path

"""Settings of small but whole studies, and measurements that nothing of kinacc made."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from . import kinematics

SETTINGS = """
datasets:
  small:
    robot: mh180
    measurements: {source: %s, file: {path: %s}}
seed: 4711
measurements:
  folds: 4
  validation_fold: 1
  synthetic: {poses: 160, tracker_noise_mm: 0.02}
calibration:
  vec: {order: 3}
  dh: {truncation: 1.0e-4}
evaluation:  # of the maps and points that the oracle reckons
  points: 24
  reference_frame: slice
  reference_orientation_deg: [180, 0, 0]
  rotations: signs_and_zero
map: {slices_deg: [0, 30], grid_mm: 225}
study: {noise_mm: [0.05, 0.3], repetitions: 3, measurements: 24, chunks: 2}
histories: {simulations_searched: 30}
figures: {formats: [svg]}
"""
WORKING_RANGE_DEG = [(-12, 72), (-30, 54), (-74, 18), (-180, 180), (-122, 122), (-180, 180)]


def write_measurements(path: Path) -> None:
    """150 poses and ten revisits of an arm with errors like Table III's, 0.03 mm of noise."""
    rng = np.random.default_rng(2)
    low, high = np.radians(WORKING_RANGE_DEG).T
    table = np.array(kinematics.MH180) + rng.normal(size=(6, 5)) * [1e-3, 0.7, 0.7, 1e-3, 0]
    lever = np.array([1, 1, 1, 3, 4, 6])[:, None, None] * 1e-4
    series = rng.normal(size=(6, 6, 5)) * np.concatenate(
        [np.broadcast_to(0.1, (6, 3, 1)), np.broadcast_to(lever, (6, 3, 1))], axis=1
    )
    q = rng.uniform(low, high, (150, 6))
    q = np.concatenate([q, q[::15]]).round(9)
    lines = ["q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg"]
    degrees = np.degrees(q).round(10)
    for row in degrees:
        frame = kinematics.projected(
            kinematics.vec_forward(
                table, series, low, high, np.zeros((6, 2)), np.radians(row), [0] * 6
            )
        )
        position = (frame[:3, 3] + rng.normal(size=3) * 0.03).round(6)
        angles = Rotation.from_matrix(frame[:3, :3]).as_euler("XYZ", degrees=True).round(8)
        lines.append(",".join(repr(float(x)) for x in [*row, *position, *angles]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")

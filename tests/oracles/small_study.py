"""Settings of small but whole studies, and measurements that nothing of kinacc made."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from measured_files import write_readings
from scipy.spatial.transform import Rotation

from . import kinematics

SETTINGS = """
datasets:
  small:
    robot: mh180
    measurements: {source: %s, file: {path: %s, orientation: {kind: quaternion}}}
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


def write_measurements(path: Path) -> None:
    """150 poses and ten revisits of an arm with errors like Table III's, 0.03 mm of noise."""
    rng = np.random.default_rng(2)
    low, high = kinematics.MEASURED_RAD
    table = np.array(kinematics.MH180) + rng.normal(size=(6, 5)) * [1e-3, 0.7, 0.7, 1e-3, 0]
    lever = np.array([1, 1, 1, 3, 4, 6])[:, None, None] * 1e-4
    lever = np.where(np.arange(6)[:, None] < 3, 0.1, lever)
    series = rng.normal(size=(6, 6, 5)) * lever
    q = rng.uniform(low, high, (150, 6))
    q = np.concatenate([q, q[::15]])
    seen = kinematics.projected(
        kinematics.vec_forward(table, series, low, high, np.zeros((6, 2)), q, np.zeros((160, 6)))
    )
    position = seen[:, :3, 3] + rng.normal(size=(160, 3)) * 0.03
    write_readings(path, q, position, Rotation.from_matrix(seen[:, :3, :3]))

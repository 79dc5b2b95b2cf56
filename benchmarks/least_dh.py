"""The least a DH model can leave of a measured UR10 series, found without kinacc.

Own kinematics, every parameter of every joint free (beta too, and with --gear an error of the
gear ratio), positions alone, all rows, base by closed form, scipy's trust region: python
benchmarks/least_dh.py ../shared/data/ur10_tmac/series_C.csv prints the position rms in mm. What
is held out cannot be fitted better than what is fitted.
"""

from __future__ import annotations

import argparse

import numpy as np
import pandas as pd
from scipy.optimize import least_squares

JOINTS, PER_JOINT = 6, 6  # theta, d, a, alpha, beta, gear; mm and mrad, gear in thousandths
NOMINAL = np.array(
    [
        (0.0, 127.3, 0.0, 90.0),
        (0.0, 0.0, -612.0, 0.0),
        (0.0, 0.0, -572.3, 0.0),
        (0.0, 163.941, 0.0, 90.0),
        (0.0, 115.7, 0.0, -90.0),
        (0.0, 92.2, 0.0, 0.0),
    ]
)


def turn(axis: int, angle: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) about a coordinate axis."""
    matrix = np.zeros((*np.shape(angle), 3, 3))
    one, two = (axis + 1) % 3, (axis + 2) % 3
    matrix[..., axis, axis] = 1.0
    matrix[..., one, one] = matrix[..., two, two] = np.cos(angle)
    matrix[..., two, one] = np.sin(angle)
    matrix[..., one, two] = -np.sin(angle)
    return matrix


def tips(x: np.ndarray, q_rad: np.ndarray) -> np.ndarray:
    """Tool points (n, 3), mm, robot base."""
    rows, point = x[:-3].reshape(JOINTS, PER_JOINT), np.tile(x[-3:], (len(q_rad), 1))
    for joint in reversed(range(JOINTS)):
        theta, d, a, alpha, beta, gear = rows[joint]
        own_theta, own_d, own_a, own_alpha = NOMINAL[joint]
        twist = turn(0, np.deg2rad(own_alpha) + 1e-3 * alpha) @ turn(1, 1e-3 * beta)
        point = point @ twist.T + [own_a + a, 0.0, own_d + d]
        angle = np.deg2rad(own_theta) + 1e-3 * theta + q_rad[:, joint] * (1.0 + 1e-3 * gear)
        point = np.einsum("nij,nj->ni", turn(2, angle), point)
    return point


def aligned(points: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """The points moved rigidly to where they fit ``goal`` best."""
    middle, there = points.mean(axis=0), goal.mean(axis=0)
    left, _, right = np.linalg.svd((points - middle).T @ (goal - there))
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    return (points - middle) @ (left @ flip @ right) + there


def main() -> None:
    """Fit and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("series")
    options.add_argument("--gear", action="store_true")
    given = options.parse_args()
    data = pd.read_csv(given.series)
    q_rad = np.deg2rad(data[[f"q{joint}_deg" for joint in range(1, 7)]].to_numpy())
    goal = data[["x_mm", "y_mm", "z_mm"]].to_numpy()
    free = np.ones(JOINTS * PER_JOINT + 3, dtype=bool)
    free[5:-3:PER_JOINT] = given.gear
    start = np.zeros(free.size)
    start[-1] = 100.0

    def residual(some: np.ndarray) -> np.ndarray:
        x = start.copy()
        x[free] = some
        return (aligned(tips(x, q_rad), goal) - goal).ravel()

    found = least_squares(residual, start[free], max_nfev=60)
    print(f"{given.series}: {np.sqrt(2.0 * found.cost / len(goal)):.4f} mm rms")


if __name__ == "__main__":
    main()

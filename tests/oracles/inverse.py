"""Every joint solution of a pose by brute force: damped Newton from many random starts at once."""

from __future__ import annotations

import math

import numpy as np

from . import kinematics

LEVER_MM = 1000.0  # turns rotation errors into lengths while searching
WEIGHT = np.repeat([1.0, LEVER_MM], 3)


def pose_error(target: np.ndarray, reached: np.ndarray) -> np.ndarray:
    """Position difference and rotation vector (n, 6), in mm, from frames (n, 4, 4) to a target."""
    turn = kinematics.rotation_vector(target[:3, :3] @ np.swapaxes(reached[:, :3, :3], 1, 2))
    return WEIGHT * np.hstack([target[:3, 3] - reached[:, :3, 3], turn])


def dh_step(table, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Flanges (n, 4, 4) and their slopes: joint i turns about the z axis of the frame before it."""
    *before, flange = np.broadcast_arrays(*kinematics.dh_frames(table, q))
    columns = []
    for frame in before:
        lever = flange[:, :3, 3] - frame[:, :3, 3]
        columns.append(np.hstack([np.cross(frame[:, :3, 2], lever), frame[:, :3, 2]]))
    return flange, WEIGHT[:, None] * np.stack(columns, axis=2)


def newton(table, target: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Joints (m, k) to which Levenberg-Marquardt gets from starts (n, k), of those that arrive."""
    q, damping = starts.astype(float), np.full((len(starts), 1, 1), 1e-3)
    here, slope = dh_step(table, q)
    error = pose_error(target, here)
    for _ in range(30):
        across = np.swapaxes(slope, 1, 2)
        normal = across @ slope
        held = damping * np.eye(q.shape[1]) * (normal + 1e-9)
        trial = q + np.linalg.solve(normal + held, across @ error[..., None])[..., 0]
        there, new_slope = dh_step(table, trial)
        new_error = pose_error(target, there)
        better = np.linalg.norm(new_error, axis=1) < np.linalg.norm(error, axis=1)
        for old, new in ((q, trial), (slope, new_slope), (error, new_error)):
            old[better] = new[better]
        damping = np.clip(np.where(better[:, None, None], damping / 10, damping * 10), 1e-15, 1e8)
    return q[np.abs(error).max(axis=1) < 1e-6]


def wrapped(angles: np.ndarray) -> np.ndarray:
    """Angles to (-pi, pi]."""
    return -((-np.asarray(angles) + math.pi) % (2 * math.pi) - math.pi)


def best_turn(angle: float, limits, preferred=(-math.inf, math.inf)) -> float:
    """The whole turn that a joint takes, as the documentation states the rule."""
    turns = [angle + 2 * math.pi * n for n in range(-6, 7)]
    allowed = [turn for turn in turns if limits[0] <= turn <= limits[1]]
    liked = [turn for turn in allowed if preferred[0] <= turn <= preferred[1]]
    if not allowed:
        return next(turn for turn in turns if -math.pi < turn <= math.pi)
    return min(liked or allowed, key=abs)


def all_solutions(table, target: np.ndarray, starts: np.ndarray) -> list[np.ndarray]:
    """Distinct solutions (whole turns aside) reached from any of the starts (n, k)."""
    found: list[np.ndarray] = []
    for q in newton(table, target, starts):
        if not any(np.abs(wrapped(q - other)).max() < 1e-5 for other in found):
            found.append(wrapped(q))
    return found

"""Every joint solution of a pose by brute force: damped Newton from many random starts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from . import kinematics

LEVER_MM = 1000.0  # turns rotation errors into lengths while searching


def pose_error(target: np.ndarray, reached: np.ndarray) -> np.ndarray:
    """Position difference (mm) and rotation vector (rad) from ``reached`` to ``target``."""
    turn = kinematics.rotation_vector(target[:3, :3] @ reached[:3, :3].T)
    return np.concatenate([target[:3, 3] - reached[:3, 3], turn])


def geometric_jacobian(frames: Sequence[np.ndarray]) -> np.ndarray:
    """Joint i turns about the z axis of the frame before it."""
    tip = frames[-1][:3, 3]
    columns = [np.concatenate([np.cross(f[:3, 2], tip - f[:3, 3]), f[:3, 2]]) for f in frames[:-1]]
    return np.array(columns).T


def dh_step(table, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    frames = kinematics.dh_frames(table, q)
    return frames[-1], geometric_jacobian(frames)


def newton(
    step: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    target: np.ndarray,
    start: np.ndarray,
) -> np.ndarray | None:
    """Levenberg-Marquardt to a pose; None where it does not get there."""
    weight = np.array([1, 1, 1, LEVER_MM, LEVER_MM, LEVER_MM])
    q, damping = start.astype(float), 1e-3
    here, slope = step(q)
    error = pose_error(target, here) * weight
    for _ in range(60):
        if np.abs(error).max() < 1e-9:
            return q
        scaled = slope * weight[:, None]
        normal = scaled.T @ scaled
        trial = q + np.linalg.solve(
            normal + damping * np.diag(np.diag(normal) + 1e-9), scaled.T @ error
        )
        there, new_slope = step(trial)
        new_error = pose_error(target, there) * weight
        if np.linalg.norm(new_error) < np.linalg.norm(error):
            q, slope, error, damping = trial, new_slope, new_error, max(damping / 10, 1e-15)
        else:
            damping *= 10
            if damping > 1e8:
                break
    return q if np.abs(error).max() < 1e-6 else None


def wrapped(angles: np.ndarray) -> np.ndarray:
    """Angles to (-pi, pi]."""
    return -((-np.asarray(angles) + math.pi) % (2 * math.pi) - math.pi)


def same_turn(first: np.ndarray, second: np.ndarray) -> bool:
    return bool(np.abs(wrapped(np.asarray(first) - second)).max() < 1e-5)


def all_solutions(
    step: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    target: np.ndarray,
    starts: np.ndarray,
) -> list[np.ndarray]:
    """Distinct solutions (whole turns aside) reached from any of the starts (n, 6)."""
    found: list[np.ndarray] = []
    for start in starts:
        q = newton(step, target, start)
        if q is not None and not any(same_turn(q, other) for other in found):
            found.append(wrapped(q))
    return found

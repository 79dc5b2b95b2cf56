"""Plausible tables in the columns of the artefact contract, for drawing without a study."""

from __future__ import annotations

import numpy as np
from scipy.special import gammainc

NOISE_MM = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3)
TRUE_MM = 0.906


def study_summary(noise_mm=NOISE_MM, assessors=None) -> dict[str, np.ndarray]:
    """Return one row per assessor and noise level."""
    assessors = assessors or {
        "maximum": lambda s: (TRUE_MM + 2.0 * s, 0.5 * s, 1.5 * s),
        "outlier_rejection": lambda s: (0.78 + 0.85 * s, 0.3 * s, 0.3 * s),
        "model_invalidation": lambda s: (0.86 + 0.2 * s, 0.6 * s, 0.6 * s),
    }
    rows = [(name, s, *law(s)) for name, law in assessors.items() for s in noise_mm]
    names, noise, mean, below, above = zip(*rows, strict=True)
    mean, below, above = np.array(mean), np.array(below), np.array(above)
    return {
        "assessor": np.array(names, dtype=object),
        "noise_mm": np.array(noise),
        "mean_mm": mean,
        "min_mm": mean - below,
        "max_mm": mean + above,
        "bias_mm": mean - TRUE_MM,
        "rmse_mm": np.abs(mean - TRUE_MM),
        "repetitions": np.full(mean.size, 100),
    }


def history(
    eta_mm=0.834, seed=1, points=200, iterations=200, noise_mm=0.3, alpha=0.6, example="rejected"
):
    """Return one simulation of model invalidation, by the plain rules (isotropic noise)."""
    rng = np.random.default_rng(seed)
    error = rng.normal(size=(points, 3))
    error /= np.linalg.norm(error, axis=1)[:, None]
    size = rng.gamma(5.4, 0.4 / 5.4, size=points)
    error *= (np.minimum(size, TRUE_MM * 0.97))[:, None]
    error[int(0.8 * points)] *= TRUE_MM / np.linalg.norm(error[int(0.8 * points)])
    mean, count = np.zeros((points, 3)), np.zeros(points, dtype=int)
    chance, rejection, fresh, rows = np.zeros(points), 0.0, 0, []
    for k in range(1, iterations + 1):
        if rejection > alpha:
            j = int(np.argmax(chance))
        elif fresh < points:
            j, fresh = fresh, fresh + 1
        else:
            break
        reading = error[j] + rng.normal(scale=noise_mm, size=3)
        mean[j] = (mean[j] * count[j] + reading) / (count[j] + 1)
        count[j] += 1
        over = max(np.linalg.norm(mean[j]) - eta_mm, 0.0)
        chance[j] = gammainc(1.5, over**2 * count[j] / noise_mm**2 / 2)
        rejection = 1 - np.prod(1 - chance)
        rows.append(
            (k, j, count[j], np.linalg.norm(reading), np.linalg.norm(mean[j]),
             np.linalg.norm(error[j]), rejection)
        )  # fmt: skip
    columns = zip(*rows, strict=True)
    names = ("iteration", "point", "repeat", "measured_mm", "averaged_mm", "true_mm")
    table = dict(zip((*names, "rejection_probability"), map(np.array, columns), strict=True))
    n = len(rows)
    return table | {
        "example": np.full(n, example, dtype=object),
        "noise_mm": np.full(n, noise_mm),
        "alpha": np.full(n, alpha),
        "distance": np.full(n, "squared", dtype=object),
        "covariance": np.full(n, "r", dtype=object),
        "eta_mm": np.full(n, eta_mm),
    }


def accuracy_map(slices=(0, 15, 30, 45, 60), step_mm=25.0, inner_mm=1100.0):
    """Return one row per grid cell, unreachable at the outer lower corner."""
    slice_deg, radius, height = (
        a.ravel()
        for a in np.meshgrid(
            np.array(slices, dtype=float),
            inner_mm + np.arange(0, 900 + step_mm / 2, step_mm),
            -900 + np.arange(0, 500 + step_mm / 2, step_mm),
            indexing="ij",
        )
    )
    wave = np.sin(radius / 170 + slice_deg / 9) * np.cos(height / 140 - slice_deg / 20)
    jump = (height + 0.4 * radius > 60 + 5 * slice_deg) * 0.25
    reached = (radius - 400) ** 2 + (height + 100) ** 2 < 1700**2
    position = np.where(reached, 0.75 + 0.25 * wave + jump, np.nan)
    orientation = np.where(reached, 2.4 - 0.5 * wave + 2 * jump, np.nan)
    return {
        "slice_deg": slice_deg,
        "radius_mm": radius,
        "height_mm": height,
        "position_max_mm": position,
        "orientation_max_mrad": orientation,
        "worst_branch": np.where(reached, "shoulder+ elbow+ wrist-", None),
        "solutions": np.where(reached, 18, 0),
        "wanted": np.full(radius.size, 18),
    }


def joint_angles(count=200, seed=3):
    """Return (count, 6) joint angles in rad that put the MH180's flange low before the base."""
    rng = np.random.default_rng(seed)
    low, high = np.array([[0, 30, -40, -40, -70, -90], [60, 60, -10, 40, -30, 90]])
    return np.radians(rng.uniform(low, high, size=(count, 6)))

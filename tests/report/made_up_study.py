"""Small tables of a study with a known answer: three points, two noise levels, four simulations."""

from __future__ import annotations

from itertools import product

import numpy as np

NOISE_MM = (0.05, 0.3)
LARGEST_MM = 0.5
STATED_MM = {"maximum": (0.4, 0.6, 0.7, 0.9), "model_invalidation": (0.3, 0.4, 0.45, 0.55)}


def points(measured: bool = False) -> dict[str, dict[str, np.ndarray]]:
    """``assessment_points`` and ``measurements``, at the same joints where ``measured``."""
    joints = {f"q{joint}": np.array([0.1, 0.2, 0.3]) * joint for joint in range(1, 7)}
    elsewhere = joints if measured else {name: values + 1 for name, values in joints.items()}
    error = {"point": np.arange(3), "true_error_mm": np.array([0.2, LARGEST_MM, 0.1])}
    return {
        "assessment_points": {**error, **joints},
        "measurements": {**elsewhere, "row": np.full(3, np.nan)},
    }


def study(stated: dict[str, tuple[float, ...]] = STATED_MM, **changed) -> dict:
    """``study`` and its ``study_summary``; ``stated`` by assessor, the same at every noise."""
    runs = list(product(NOISE_MM, stated, range(4)))
    noise, assessor, repetition = (np.array(each) for each in zip(*runs, strict=True))
    assessed = np.array([stated[name][number] for _, name, number in runs])
    table = {
        "noise_mm": noise,
        "assessor": assessor.astype(object),
        "repetition": repetition,
        "assessed_mm": assessed,
        "measurements": np.full(len(runs), 20),
        "points_visited": np.full(len(runs), 3),
        "lower_mm": np.full(len(runs), np.nan),
        "upper_mm": np.full(len(runs), np.nan),
    } | changed
    lines = list(product(stated, NOISE_MM))
    values = np.array([stated[name] for name, _ in lines])
    summary = {
        "assessor": np.array([name for name, _ in lines], dtype=object),
        "noise_mm": np.array([noise for _, noise in lines]),
        "mean_mm": values.mean(axis=1),
        "min_mm": values.min(axis=1),
        "max_mm": values.max(axis=1),
        "bias_mm": values.mean(axis=1) - LARGEST_MM,
        "repetitions": np.full(len(lines), 4),
    }
    return {"study": table, "study_summary": summary}


def histories(**changed) -> dict[str, dict[str, np.ndarray]]:
    """Two examples of five iterations: the first rejects, and reads its second point thrice."""
    parts = [
        ("rejected", 0.4, [0, 1, 1, 2, 1], [0.1, 0.7, 0.65, 0.3, 0.9]),
        ("not_rejected", 0.6, [0, 1, 2, 0, 1], [0.1, 0.2, 0.3, 0.4, 0.5]),
    ]
    rows: dict[str, list] = {}
    for name, eta, visited, probability in parts:
        for number, point in enumerate(visited):
            row = {
                "example": name,
                "simulation": 7,
                "rule": "first <b>simulation</b>",
                "rule_met": 1,
                "noise_mm": 0.3,
                "alpha": 0.6,
                "iteration": number + 1,
                "point": point,
                "repeat": visited[: number + 1].count(point),
                "eta_mm": eta,
                "measured_mm": 0.3 + 0.1 * number,
                "averaged_mm": 0.2 + 0.1 * number,
                "true_mm": (0.2, LARGEST_MM, 0.1)[point],
                "rejection_probability": probability[number],
            }
            for column, value in row.items():
                rows.setdefault(column, []).append(value)
    texts = {"example", "rule"}
    table = {
        name: np.array(values, dtype=object if name in texts else None)
        for name, values in rows.items()
    }
    return {"histories": table | changed}

"""Small tables of a study with a known answer: three points, two noise levels, four simulations."""

from __future__ import annotations

from itertools import product

import numpy as np
import pandas as pd

NOISE_MM = (0.05, 0.3)
LARGEST_MM = 0.5
STATED_MM = {"maximum": (0.4, 0.6, 0.7, 0.9), "model_invalidation": (0.3, 0.4, 0.45, 0.55)}


def points(measured: bool = False) -> dict:
    """``assessment_points`` and ``measurements``, at the same joints where ``measured``."""
    joints = {f"q{joint}": np.array([0.1, 0.2, 0.3]) * joint for joint in range(1, 7)}
    elsewhere = {name: values + (not measured) for name, values in joints.items()}
    error = {"point": np.arange(3), "true_error_mm": np.array([0.2, LARGEST_MM, 0.1])}
    return {
        "assessment_points": {**error, **joints},
        "measurements": {**elsewhere, "row": np.full(3, np.nan)},
    }


def study() -> dict:
    """``study`` and its ``study_summary``; the same is stated at every noise."""
    runs = [
        (assessor, noise, stated)
        for (assessor, every), noise in product(STATED_MM.items(), NOISE_MM)
        for stated in every
    ]
    table = pd.DataFrame(runs, columns=["assessor", "noise_mm", "assessed_mm"])
    groups = table.groupby(["assessor", "noise_mm"], sort=False)["assessed_mm"]
    summary = groups.agg(mean_mm="mean", min_mm="min", max_mm="max", repetitions="count")
    summary["bias_mm"] = summary["mean_mm"] - LARGEST_MM
    return {"study": dict(table), "study_summary": dict(summary.reset_index())}


def histories(**changed) -> dict:
    """Two examples of five iterations: the first rejects, and reads its second point thrice."""
    parts = [
        ("rejected", 0.4, [0, 1, 1, 2, 1], [0.1, 0.7, 0.65, 0.3, 0.9]),
        ("not_rejected", 0.6, [0, 1, 2, 0, 1], [0.1, 0.2, 0.3, 0.4, 0.5]),
    ]
    rows = [
        (name, eta, number + 1, point, visited[: number + 1].count(point), probability[number])
        for name, eta, visited, probability in parts
        for number, point in enumerate(visited)
    ]
    names = ["example", "eta_mm", "iteration", "point", "repeat", "rejection_probability"]
    table = pd.DataFrame(rows, columns=names)
    table["measured_mm"] = 0.2 + 0.1 * table["iteration"]
    table["averaged_mm"] = 0.1 + 0.1 * table["iteration"]
    table["true_mm"] = np.take([0.2, LARGEST_MM, 0.1], table["point"])
    known = {"simulation": 7, "rule": "first <b>simulation</b>", "rule_met": 1, "noise_mm": 0.3}
    return {"histories": dict(table.assign(**known, alpha=0.6)) | changed}

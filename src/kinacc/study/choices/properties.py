"""Properties of a set of operating points that a claim may hang on."""

from __future__ import annotations

import numpy as np

from kinacc.artifacts.columns import Columns

ABOUT = {
    "largest_mm": "largest true error of the operating points, mm",
    "largest_over_second": "largest true error over the second largest",
    "largest_over_mean": "largest true error over the mean",
    "place_of_largest": "when the point of the largest error is visited, as a share of the run",
}


def of_points(points: Columns) -> dict[str, float]:
    """The numbers of ``ABOUT`` for ``assessment_points``."""
    error_mm = np.asarray(points["true_error_mm"], dtype=float)
    largest, second = np.sort(error_mm)[::-1][[0, min(1, error_mm.size - 1)]]
    return {
        "largest_mm": float(largest),
        "largest_over_second": float(largest / second),
        "largest_over_mean": float(largest / error_mm.mean()),
        "place_of_largest": float((error_mm.argmax() + 1) / error_mm.size),
    }

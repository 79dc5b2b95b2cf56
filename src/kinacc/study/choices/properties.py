"""Properties of the operating points and the map that a claim may hang on."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinacc.artifacts.columns import Columns

ABOUT = {
    "largest_mm": "the largest true error of the operating points",
    "largest_over_second": "the largest true error over the second largest",
    "largest_over_mean": "the largest true error over the mean",
    "place_of_largest": "how late in the sequence the point of the largest error stands",
    "reached": "the share of the map's poses that the arm reaches",
}


def of_tables(tables: Mapping[str, Columns]) -> dict[str, float]:
    """The numbers of ``ABOUT`` that ``assessment_points`` and ``accuracy_map`` tell, if there."""
    found = {}
    if "assessment_points" in tables:
        error_mm = np.asarray(tables["assessment_points"]["true_error_mm"], dtype=float)
        largest, second = np.sort(error_mm)[::-1][[0, min(1, error_mm.size - 1)]]
        found["largest_mm"] = float(largest)
        found["largest_over_second"] = float(largest / second)
        found["largest_over_mean"] = float(largest / error_mm.mean())
        found["place_of_largest"] = float((error_mm.argmax() + 1) / error_mm.size)
    if "accuracy_map" in tables:
        cells = tables["accuracy_map"]
        found["reached"] = float(np.sum(cells["solutions"]) / np.sum(cells["wanted"]))
    return found

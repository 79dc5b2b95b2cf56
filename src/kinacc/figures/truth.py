"""The true accuracy a figure is held against, and whether it is a measured one."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinacc.figures.columns import Table, floats

FOOTNOTE = "* measured minus modelled: contains the instrument's noise"


def accuracy_mm(points: Table | None) -> float | None:
    """Return the largest true error of ``assessment_points`` (eq. 7), None without any."""
    if points is None:
        return None
    errors = floats(points, "true_error_mm")
    errors = errors[np.isfinite(errors)]
    return float(errors.max()) if errors.size else None


def is_noisy(settings: Mapping) -> bool:
    """Say whether the true errors are measured ones, which contain the instrument's noise."""
    return settings.get("evaluation", {}).get("space") == "measured"

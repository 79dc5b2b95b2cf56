"""The true accuracy a figure is held against, and whether it is a measured one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kinacc.figures.columns import floats

FOOTNOTE = "* measured minus modelled: contains the instrument's noise"


def known(inputs: Mapping, settings: Mapping) -> dict[str, Any]:
    """Return what a figure is told of the truth and of the data set, as arguments of ``draw``.

    The true accuracy (eq. 7) is the largest true error of ``assessment_points``, None without any;
    it is noisy where the true errors are measured ones.
    """
    errors = floats(inputs.get("assessment_points", {"true_error_mm": ()}), "true_error_mm")
    errors = errors[np.isfinite(errors)]
    return {
        "true_accuracy_mm": float(errors.max()) if errors.size else None,
        "noisy_truth": settings.get("evaluation", {}).get("space") == "measured",
        "dataset": settings.get("dataset"),
    }

"""The true accuracy a figure is held against, and whether it is a measured one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

FOOTNOTE = "* measured minus modelled: contains the instrument's noise"
OF_MODELS = "* taken as true by the study: VEC minus DH of a measured arm"


def known(inputs: Mapping, settings: Mapping) -> dict[str, Any]:
    """Return what a figure shows of the truth and of the data set, as arguments of ``draw``.

    The true accuracy (eq. 7) is the largest true error of ``assessment_points``, None without any.
    Of a measured arm it is only taken as true, as the footnote says.
    """
    largest = pd.Series(inputs.get("assessment_points", {}).get("true_error_mm", ())).max()
    at_measured = settings["evaluation"]["space"] == "measured"
    of_measured = settings["measurements"]["source"] != "synthetic"
    return {
        "true_accuracy_mm": None if pd.isna(largest) else float(largest),
        "taken_as_true": FOOTNOTE if at_measured else OF_MODELS if of_measured else None,
        "dataset": settings.get("dataset"),
    }

"""Words that tables and configuration share: model, comparison, assessor and reading names."""

from __future__ import annotations

from kinacc.config import error_models

MODELS = (*error_models.FITTED, error_models.NOMINAL)
SELECTABLE = tuple(error_models.ERROR_MODELS)
SUBSETS = ("train", "validation")
COMPARISONS = tuple(item.name for item in error_models.COMPARISONS)
FINDING_LEVELS = ("stops", "warning", "note")
LEFT_OUT = "left_out"  # the finding that something of a file is not used
ERRORS = ("delta_x", "delta_y", "delta_z", "eps_x", "eps_y", "eps_z")
VERDICTS = ("agrees", "differs", "not comparable")
# What becomes of a calibration by the next line of a series, and of base and tool since the line.
FIRST, HOLDS, RECALIBRATE, OPEN = "first", "holds", "recalibrate", "cannot be told"
SAME, MOVED = "same", "moved"

"""Contract of the tables that compare models on held-out rows."""

from __future__ import annotations

from kinacc.tables.allowed import COMPARISONS, ESTIMATES, SELECTABLE
from kinacc.tables.columns import (
    ERROR_MM,
    JOINTS_MAX,
    SLIDES,
    TRAVEL_MM,
    Artefact,
    error_vector,
    magnitude,
    real,
    text,
    whole,
)

MODEL_SELECTION = Artefact(
    "model_selection",
    "The model selected on held-out rows: DH, unless another takes off its squared position error "
    "more than two standard errors (paired by configuration) and rms and mean of folds fall too; "
    "of several the one of the lowest rms. DH where nothing was held out.",
    (
        text("model", "the model", SELECTABLE),
        whole("selected", "1 = selected", 0, 1),
        magnitude("held_out_rms_mm", "mm", "position rms over all held-out rows", 1e4, True),
        magnitude("mean_of_folds_mm", "mm", "mean over folds of the position rms", 1e4, True),
        real("gain_mm2", "mm^2", "mean squared error less than DH", -1e8, 1e8, True),
        magnitude("gain_std_error_mm2", "mm^2", "standard error of the gain", 1e8, True),
        whole("configurations", "held-out configurations compared"),
    ),
    ("model",),
)
_TRAVEL = (-TRAVEL_MM, TRAVEL_MM)

JOINT_BIAS = Artefact(
    "joint_bias",
    "Position errors by region of every joint, robot base: what a model leaves systematically.",
    (
        text("comparison", "what is compared with what", COMPARISONS),
        text("estimate", "train or cross_validated", ESTIMATES),
        whole("joint", "joint number, from 1", 1, JOINTS_MAX),
        real("from_rad", "rad", f"where the region of the DH joint begins, {SLIDES}", *_TRAVEL),
        real("to_rad", "rad", f"where the region of the DH joint ends, {SLIDES}", *_TRAVEL),
        whole("n", "target points in the region", 1),
        *error_vector("the mean position error"),
        *(
            magnitude(f"std_error_{axis}_mm", "mm", f"standard error of e{axis}_mm", ERROR_MM, True)
            for axis in "xyz"
        ),
        magnitude("rms_mm", "mm", "root mean square of the position error", ERROR_MM),
    ),
    ("comparison", "estimate", "joint", "from_rad"),
)
WORST_ROWS = Artefact(
    "worst_rows",
    "Rows with the largest position errors of each comparison with the measurement.",
    (
        text("comparison", "what is compared with what", COMPARISONS),
        text("estimate", "train or cross_validated", ESTIMATES),
        whole("rank", "1 = largest", 1),
        whole("row", "row of measurements.parquet, from 0"),
        whole("line", "line of the measured file; null for a synthetic arm", 1, None, True),
        whole("pose", "number of the joint configuration"),
        text("target", "name of the measured target"),
        *error_vector("the position error"),
        magnitude("error_mm", "mm", "magnitude of the position error", ERROR_MM),
    ),
    ("comparison", "estimate", "rank"),
)

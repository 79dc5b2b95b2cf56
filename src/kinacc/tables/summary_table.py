"""Contract of the table that says in one place what a calibration is worth."""

from __future__ import annotations

from kinacc.tables.columns import Artefact, real, text

# What a fact is about; errors of different populations are different topics.
TOPICS = (
    "robot",
    "data",
    "left_out",
    "check",
    "excluded_rows",
    "held_out_error",
    "held_out_orientation_error",
    "training_error",
    "model_difference",
    "held_out_model_difference",
    "selection",
    "range",
    "like_measured",
    "one_way",
    "unidentifiable",
    "poorly_determined",
    "bending",
    "tolerance",
)
SUMMARY = Artefact(
    "summary",
    "What the calibration of a data set is worth, one fact a row; `kinacc summary` prints it.",
    (
        text("topic", "what the fact is about; each population of errors is one", TOPICS),
        text("item", "of what: a model, a comparison, a joint, a kind of finding, a line"),
        text("statistic", "what is stated of it, e.g. mean, quantile_99, largest, share"),
        real("value", "see unit", "the number; null where the fact is a text", nullable=True),
        text("unit", "unit of the value; 1 for a pure number, null without a value", nullable=True),
        text("text", "the fact in words; null where it is a number", nullable=True),
    ),
    ("topic", "item", "statistic", "text"),
)

"""Contract of the robot as it was described when a data set was read."""

from __future__ import annotations

from kinacc.tables.columns import Artefact, text

ROBOT = Artefact(
    "robot",
    "The nominal arm as described when the measurements were read, one row: what later commands "
    "need of it, whatever becomes of its file.",
    (
        text("name", "name of the arm"),
        text("source", "where its figures come from", nullable=True),
        text("date", "when they were taken from there", nullable=True),
        text("description", "the arm as the text of a robot YAML (docs/robots.md)"),
    ),
    ("name",),
)

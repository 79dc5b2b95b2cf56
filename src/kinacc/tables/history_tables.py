"""Contract of the table that says what became of an arm over the lines of its series."""

from __future__ import annotations

from kinacc.tables.allowed import SELECTABLE
from kinacc.tables.columns import (
    ERROR_MM,
    JOINTS_MAX,
    Artefact,
    Column,
    magnitude,
    real,
    text,
    whole,
)

FIRST, HOLDS, RECALIBRATE, OPEN = VERDICTS = ("first", "holds", "recalibrate", "cannot be told")
SAME, MOVED = FLAGS = ("same", "moved")
_DAY = r"\d{4}-\d{2}-\d{2}"


def _errors(name: str, whose: str) -> tuple[Column, ...]:
    statistics = {
        "mean": "mean",
        "quantile_99": "empirical 99 % quantile",
        "largest": "largest",
    }
    return tuple(
        magnitude(f"{name}_{each}_mm", "mm", f"{words} position error {whose}", ERROR_MM, True)
        for each, words in statistics.items()
    )


HISTORY = Artefact(
    "history",
    "What became of an arm over the lines of its series, one row a line by date. In force is the "
    "calibration of the last line before whose verdict was first or recalibrate.",
    (
        text("series", "data set of the line"),
        text("date", "day on which it was measured", pattern=_DAY),
        text("digest", "columns digest of its measurements", pattern="[0-9a-f]{64}"),
        text("base", "the base since the line before; null in the first", FLAGS, nullable=True),
        text("tool", "tool and targets since then; null in the first", FLAGS, nullable=True),
        whole("rows", "rows that were measured", 1),
        whole("configurations", "joint configurations among them", 1),
        real("temperature_c", "degC", "mean temperature stated by the file", -273.15, 1e3, True),
        text("model", "model selected of this line's fits", SELECTABLE),
        *_errors("held_out", "of that model at poses held out of its fits"),
        text("in_force", "line whose calibration was in force before", nullable=True),
        *_errors(
            "in_force",
            "of the calibration in force at this line's poses, base and tool "
            "fitted where they were moved",
        ),
        magnitude(
            "moved_mm",
            "mm",
            "rms movement of predictions at common poses since the "
            "calibration in force, after the best base and tool",
            ERROR_MM,
            True,
        ),
        magnitude("chance_mm", "mm", "moved_mm that chance alone may show", ERROR_MM, True),
        magnitude("beyond_mm", "mm", "by how much moved_mm is beyond chance", ERROR_MM, True),
        real("probability", "1", "of as much or more where nothing changed", 0, 1, True),
        whole(
            "joint",
            "joint that explains most of what moved; null where none clearly does",
            1,
            JOINTS_MAX,
            True,
        ),
        magnitude(
            "bound_mm",
            "mm",
            "bound on the largest error by a finished campaign on this line's calibration",
            ERROR_MM,
            True,
        ),
        magnitude("tolerance_mm", "mm", "tolerance of the configuration", ERROR_MM, True),
        text("verdict", "what is to be done with the calibration in force", VERDICTS),
        text("reason", "why it cannot be told; null where it can", nullable=True),
    ),
    ("series",),
)

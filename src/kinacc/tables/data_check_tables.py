"""Contract of the tables that say what is wrong with measured data, and what was left out."""

from __future__ import annotations

from kinacc.tables.allowed import COMPARISONS, FINDING_LEVELS, IDENTIFIER_PATTERN
from kinacc.tables.columns import (
    ERROR_MRAD,
    REACH_MM,
    ROW_NAME,
    Artefact,
    length,
    real,
    text,
    whole,
)

DATA_CHECK = Artefact(
    "data_check",
    "What the check of the measured file found before anything was fitted; without rows where it "
    "found nothing. Absent for a synthetic arm.",
    (
        text("finding", "kind of finding, as in data_check.accept", pattern=IDENTIFIER_PATTERN),
        text("level", "whether it stops the workflow, warns, or is a note", FINDING_LEVELS),
        text("what", "the finding in words"),
        text("lines", "lines of the file it concerns; null where it concerns none", nullable=True),
        text("fix", "what to do about it", nullable=True),
        text("accepted", "reason to go on, from data_check.accept", nullable=True),
        whole("rows", "number of lines it concerns"),
    ),
    ("finding", "what"),
    may_be_empty=True,
)
EXCLUDED_ROWS = Artefact(
    "excluded_rows",
    "Errors of the delivered models at rows that measurements.file.exclude leaves out: no fit has "
    "seen them. Absent where no row is left out.",
    (
        text("comparison", "what is compared with what", COMPARISONS),
        whole("line", "line of the measured file", 1),
        text("target", "name of the measured target; null where unreadable", nullable=True),
        text("session", "session of the row; null without sessions", nullable=True),
        text("reason", "why the row is left out"),
        *(
            length(f"e{axis}_mm", f"{axis} component of the position error", REACH_MM, True)
            for axis in "xyz"
        ),
        *(
            real(
                f"r{axis}_mrad",
                "mrad",
                f"{axis} component of the orientation error",
                -ERROR_MRAD,
                ERROR_MRAD,
                True,
            )
            for axis in "xyz"
        ),
        *ROW_NAME,
    ),
    ("comparison", "line", "target"),
)

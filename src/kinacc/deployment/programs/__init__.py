"""Robot programs corrected for a calibrated arm: one module a language, only numbers change."""

from kinacc.deployment.programs.correction import (
    AT_MOST_MM,
    LANGUAGES,
    CorrectedProgram,
    compensate_program,
    read_program,
)

__all__ = ["AT_MOST_MM", "LANGUAGES", "CorrectedProgram", "compensate_program", "read_program"]

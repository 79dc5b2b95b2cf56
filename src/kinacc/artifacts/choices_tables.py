"""Contract of the tables of the claims over the paper's open choices."""

from __future__ import annotations

from kinacc.artifacts.allowed import IDENTIFIER_PATTERN, VERDICTS
from kinacc.artifacts.columns import Artefact, real, text, whole

_RUN = whole("run", "number of the run, from 0")
_NAME = "name of a choice, default, arm (another arm), or all, all_and_arm, fig5 (all at once)"
_JUDGED = (
    _RUN,
    text("choice", f"what is varied: {_NAME}", pattern=IDENTIFIER_PATTERN),
    text("value", "value of the choice, null where several are varied at once", nullable=True),
    text("claim", "identifier of the claim", pattern=IDENTIFIER_PATTERN),
    text("verdict", "agrees, differs or not comparable", VERDICTS),
    real("statistic", "see claims", "the reproduced number, null without one", nullable=True),
    text("why", "why the run came to an end before it could be judged", nullable=True),
)
_FACTORS = (
    _RUN,
    text("factor", "a choice, or a property of the operating points", pattern=IDENTIFIER_PATTERN),
    text("kind", "choice or property", ("choice", "property")),
    text("value", "what is chosen, null for a property", nullable=True),
    real("number", "see factor", "size of the property, null for a choice", nullable=True),
)
ALL = (
    Artefact(
        "choices_chunk",
        "Every claim on some of the runs over the paper's open choices.",
        _JUDGED,
        ("run", "claim"),
    ),
    Artefact(
        "choices_factors_chunk",
        "What was chosen in some of the runs, and properties of their operating points.",
        _FACTORS,
        ("run", "factor"),
    ),
    Artefact(
        "choices",
        "Every claim over the choices that the paper leaves open: each varied alone, all at once.",
        _JUDGED,
        ("run", "claim"),
    ),
    Artefact(
        "choices_factors",
        "What was chosen in every run, and properties of its operating points.",
        _FACTORS,
        ("run", "factor"),
    ),
)

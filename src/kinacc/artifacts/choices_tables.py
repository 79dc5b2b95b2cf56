"""Contract of the tables of the claims over the paper's open choices."""

from __future__ import annotations

from kinacc.artifacts.allowed import HOLDS, IDENTIFIER_PATTERN, VERDICTS
from kinacc.artifacts.columns import Artefact, magnitude, real, text, whole

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
_CLAIM = text("claim", "identifier of the claim", pattern=IDENTIFIER_PATTERN)
_SHARES = {
    "arms": "the further arms, all choices as configured",
    "alone": "each choice varied alone",
    "all": "all choices varied at once on the arm as configured",
    "all_and_arm": "all choices and the arm varied at once",
}
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
        "claim_shares",
        "How often every claim holds: over arms, over open choices, over both.",
        (
            _CLAIM,
            text("verdict", "agrees, differs or not comparable, as configured", VERDICTS),
            *(
                column
                for name, words in _SHARES.items()
                for column in (
                    whole(f"{name}_runs", f"runs judged, {words}"),
                    magnitude(f"{name}_share", "1", f"share that agrees, {words}", 1.0, True),
                )
            ),
            text(
                "holds",
                "where it holds: a share of 95 % counts as everywhere, one of 5 % as nowhere",
                HOLDS,
            ),
        ),
        ("claim",),
    ),
    Artefact(
        "claim_reasons",
        "What every claim hangs on: the shares of agreeing runs at a factor's values.",
        (
            _CLAIM,
            text(
                "sample", "runs looked at: arm, all_and_arm or fig5", ("arm", "all_and_arm", "fig5")
            ),
            *_FACTORS[1:3],
            *(
                column
                for name, words in (("least", "least"), ("most", "most"))
                for column in (
                    text(f"{name}_value", f"value at which it agrees {words} often"),
                    magnitude(f"{name}_share", "1", "share of agreeing runs there", 1.0),
                    whole(f"{name}_runs", "runs judged there", 1),
                )
            ),
            magnitude("difference", "1", "difference of both shares", 1.0),
            magnitude("chance", "1", "probability of such shares if the factor had no say", 1.0),
            whole("decides", "1 where that is below 1 % over all factors of the claim", 0, 1),
            whole("rank", "place among the factors of the claim, deciding ones first", 1),
        ),
        ("claim", "sample", "factor"),
        may_be_empty=True,  # from a few runs nothing can be said
    ),
    Artefact(
        "choices_factors",
        "What was chosen in every run, and properties of its operating points.",
        _FACTORS,
        ("run", "factor"),
    ),
)

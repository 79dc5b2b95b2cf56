"""Stage: how often every claim holds over arms and open choices, and what decides it."""

from __future__ import annotations

from collections.abc import Mapping

from kinacc.study.choices.reasons import reasons, shares


def run(inputs: Mapping, settings: Mapping) -> dict[str, dict]:
    """Return ``claim_shares`` and ``claim_reasons``."""
    choices, factors = inputs["choices"], inputs["choices_factors"]
    return {"claim_shares": shares(choices), "claim_reasons": reasons(choices, factors)}

"""Hold the paper's numbers and sentences to the results of a data set."""

from __future__ import annotations

from collections.abc import Mapping

from kinacc.study.claims.evaluate import evaluate, shares_of


def run(inputs: Mapping, settings: Mapping) -> dict[str, Mapping]:
    """Return ``claims``; numbers of Tables I to III are compared on the paper's arm only."""
    tables = {name: table for name, table in inputs.items() if name != "robustness"}
    shares = shares_of(inputs["robustness"]) if "robustness" in inputs else None
    return {"claims": evaluate(tables, paper_arm=settings["robot"] == "mh180", shares=shares)}

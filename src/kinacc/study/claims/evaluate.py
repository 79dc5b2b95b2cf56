"""Every claim against the tables of one data set."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from kinacc.study.claims.claim import Claim, Finding, Tables, verdict
from kinacc.study.claims.history_sentences import history_claims
from kinacc.study.claims.map_sentences import map_claims
from kinacc.study.claims.numbers import number_claims
from kinacc.study.claims.study_sentences import study_claims
from kinacc.tables.columns import Columns
from kinacc.tables.contract import columns_of


def all_claims() -> list[Claim]:
    """Every claim, in the order of the paper."""
    return [*number_claims(), *map_claims(), *study_claims(), *history_claims()]


def evaluate(
    tables: Tables, *, paper_arm: bool, shares: Mapping[str, float] | None = None
) -> Columns:
    """Rows of ``claims`` for the tables of one data set.

    ``tables`` maps artefact names to columns; a claim whose evidence is not there, or that
    compares with the paper's arm while ``paper_arm`` is false, is ``not comparable``. ``shares``
    gives per claim how often it held over further draws of the synthetic arm.
    """
    rows = [_row(claim, tables, paper_arm, shares or {}) for claim in all_claims()]
    return columns_of("claims", rows)


def _row(claim: Claim, tables: Tables, paper_arm: bool, shares: Mapping[str, float]) -> dict:
    missing = [name for name in claim.evidence if name not in tables]
    if missing or (claim.arm_specific and not paper_arm):
        finding, judged = Finding(math.nan), "not comparable"
    else:
        finding = claim.compute(tables)
        judged = verdict(claim, finding)
    return {
        "claim": claim.id,
        "statement": claim.statement,
        "statistic": claim.statistic,
        "evidence": ", ".join(f"{name}.parquet" for name in claim.evidence),
        "paper": claim.paper,
        "reproduced": finding.value,
        "tolerance": claim.tolerance,
        "verdict": judged,
        "share": shares.get(claim.id, math.nan),
        "used_to_choose": claim.used_to_choose,
    }


def shares_of(robustness: Columns) -> dict[str, float]:
    """Share of the draws, among those where a claim could be judged, in which it agreed."""
    shares = {}
    for claim in all_claims():
        verdicts = robustness["verdict"][robustness["claim"] == claim.id]
        judged = verdicts[verdicts != "not comparable"]
        if judged.size:
            shares[claim.id] = float(np.mean(judged == "agrees"))
    return shares


def table_of(inputs: Mapping, settings: Mapping) -> dict[str, Mapping]:
    """Return ``claims``; numbers of Tables I to III are compared on the paper's arm only."""
    tables = {name: table for name, table in inputs.items() if name != "robustness"}
    shares = shares_of(inputs["robustness"]) if "robustness" in inputs else None
    return {"claims": evaluate(tables, paper_arm=settings["robot"] == "mh180", shares=shares)}

"""Every claim against the tables of one data set."""

from __future__ import annotations

import math
from collections.abc import Mapping

import pandas as pd

from kinacc.study.claims.claim import Claim, Tables, verdict
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
    rows = []
    for claim in all_claims():
        judged = claim.evidence in tables and (paper_arm or not claim.arm_specific)
        value = float(claim.compute(tables)) if judged else math.nan
        rows.append(
            {
                "claim": claim.id,
                "statement": claim.statement,
                "statistic": claim.statistic,
                "evidence": f"{claim.evidence}.parquet",
                "paper": claim.paper,
                "reproduced": value,
                "tolerance": claim.tolerance,
                "verdict": verdict(claim, value),
                "share": (shares or {}).get(claim.id, math.nan),
                "used_to_choose": claim.used_to_choose,
            }
        )
    return columns_of("claims", rows)


def table_of(inputs: Mapping, settings: Mapping) -> dict[str, Mapping]:
    """Return ``claims``; numbers of Tables I to III are compared on the paper's arm only.

    A share is that of the further draws on which the claim could be judged.
    """
    tables, shares = dict(inputs), None
    if (robustness := tables.pop("robustness", None)) is not None:
        draws = pd.DataFrame({name: robustness[name] for name in ("claim", "verdict")})
        judged = draws[draws["verdict"] != "not comparable"]
        shares = judged["verdict"].eq("agrees").groupby(judged["claim"]).mean().to_dict()
    return {"claims": evaluate(tables, paper_arm=settings["robot"] == "mh180", shares=shares)}

"""Every claim against the tables of one data set."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import pandas as pd

from kinacc.config.records import Settings
from kinacc.config.schema import defaults
from kinacc.errors import first_few
from kinacc.study.claims.claim import Claim, number_claims, number_values, sentences, verdict
from kinacc.study.claims.map_sentences import map_values
from kinacc.study.claims.study_sentences import history_values, points_values, study_values
from kinacc.tables.columns import Columns, Tables
from kinacc.tables.contract import columns_from

SECTIONS = ("measurements", "calibration", "evaluation", "map", "study", "histories")
_VALUES = {
    "accuracy_map": map_values,
    "assessment_points": points_values,
    "study_summary": study_values,
    "histories": history_values,
}


def all_claims() -> list[Claim]:
    """Every claim, in the order of the paper."""
    return [*number_claims(), *(claim for claims in sentences().values() for claim in claims)]


def values_of(tables: Tables) -> dict[str, float]:
    """Values of the claims whose evidence is there, by claim; NaN where one cannot be computed."""
    values = number_values(tables)
    for evidence, compute in _VALUES.items():
        if evidence in tables:
            values |= compute(tables[evidence])
    return values


def evaluate(
    tables: Tables, *, paper_arm: bool, shares: Mapping[str, float] | None = None
) -> Columns:
    """Evaluate every claim on the tables of one data set.

    Parameters
    ----------
    tables : mapping
        Columns by the name of their artefact.
    paper_arm : bool
        Whether numbers of the paper's own arm are compared.
    shares : mapping, optional
        How often a claim held over further draws of the synthetic arm.

    Returns
    -------
    dict
        Columns of ``claims``. A claim without its evidence is ``not comparable``.
    """
    table = pd.DataFrame(all_claims()).rename(columns={"id": "claim"})
    is_judged = paper_arm | ~table["arm_specific"]
    table["reproduced"] = table["claim"].map(values_of(tables)).astype(float).where(is_judged)
    table["verdict"] = list(map(verdict, all_claims(), table["reproduced"]))
    table["share"] = table["claim"].map(shares or {}).astype(float)
    table["evidence"] += ".parquet"
    return columns_from("claims", table)


def _unlike_the_paper(settings: Settings) -> list[str]:
    """Settings whose values are not the defaults, which are the paper's."""
    values, paper = (
        pd.json_normalize([{key: dict(source[key]) for key in SECTIONS if key in source}]).iloc[0]
        for source in (settings, defaults())
    )
    return [f"{key} {values[key]}" for key in values.index if values[key] != paper[key]]


def table_of(inputs: Tables, settings: Settings) -> Tables:
    """Return ``claims``; numbers of Tables I to III are compared on the paper's arm only.

    A share is that of the further draws on which the claim could be judged. Warns of settings
    other than the paper's.
    """
    if settings["robot"] == "mh180" and (changed := _unlike_the_paper(settings)):
        message = f"the paper's claims are about other settings: {first_few(changed)} here"
        warnings.warn(message, stacklevel=2)
    tables, shares = dict(inputs), None
    if (robustness := tables.pop("robustness", None)) is not None:
        draws = pd.DataFrame({name: robustness[name] for name in ("claim", "verdict")})
        judged = draws[draws["verdict"] != "not comparable"]
        shares = judged["verdict"].eq("agrees").groupby(judged["claim"]).mean().to_dict()
    return {"claims": evaluate(tables, paper_arm=settings["robot"] == "mh180", shares=shares)}

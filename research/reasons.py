"""What a claim hangs on: shares of runs in which it agrees, and the factors that change them most.

The measure: among runs in which everything varies at once, the difference between the shares of
agreeing runs at the value of a factor where the claim agrees most often and where it agrees least
often. A property is a factor of two values, its smaller and its larger half. A factor counts when
chance alone would hardly make its shares differ so (chi-square test, 1 % over all factors).
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.special import chdtrc

from research.open_choices import ALL, ALL_AND_ARM, ARM, DEFAULT, FIG_5

HOLDS = (
    *("everywhere", "hangs on the arm", "hangs on a choice", "hangs on both", "nowhere"),
    "not comparable",
)
EVERYWHERE, ON_ARM, ON_CHOICE, ON_BOTH, NOWHERE, UNKNOWN = HOLDS
GROUPS = ("arms", "alone", "all", "all_and_arm")
STEADY = 0.95  # share of runs from which on a claim holds everywhere
_CHANCE = 0.01  # of naming any factor of a claim without reason
_LEAST_RUNS = 5  # at a value, for its share to count


def shares(choices: pd.DataFrame) -> pd.DataFrame:
    """``claim_shares``: a row per claim, how often it agrees where it can be judged."""
    of = {ARM: "arms", DEFAULT: "default", ALL: "all", ALL_AND_ARM: "all_and_arm", FIG_5: "fig5"}
    group = choices["choice"].map(of).fillna("alone")
    found = {}
    for (claim, name), own in choices.groupby(["claim", group], sort=False):
        row = found.setdefault(claim, {"claim": claim})
        if name == "default":
            row["verdict"] = own["verdict"].iloc[0]
        if name in GROUPS:
            judged = _agrees(own["verdict"]).dropna()
            row |= {f"{name}_runs": judged.size, f"{name}_share": judged.mean()}
    return pd.DataFrame([row | {"holds": _holds(row)} for row in found.values()])


def reasons(choices: pd.DataFrame, factors: pd.DataFrame) -> pd.DataFrame:
    """``claim_reasons``: every factor of every claim, by sample, those that decide first."""
    kinds = dict(zip(factors["factor"], factors["kind"], strict=True))
    rows = []
    for sample in (ARM, ALL_AND_ARM, FIG_5):
        agrees, values = table_of(choices, factors, sample)
        for claim in agrees:
            found = []
            for name in (each for each in values if each != ARM):
                told = _difference(by_value(agrees[claim], values[name]))
                found += [{"claim": claim, "sample": sample, "factor": name, "kind": kinds[name],
                           **told}] if told else []  # fmt: skip
            for row in found:
                row["decides"] = int(row["chance"] < _CHANCE / len(found))
            found.sort(key=lambda row: (-row["decides"], -row["difference"], row["factor"]))
            rows += found
    return pd.DataFrame(rows)


def table_of(
    choices: pd.DataFrame, factors: pd.DataFrame, sample: str
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """By run of a sample: whether every claim agrees (1, 0, NaN), and the value of every factor."""
    mine = choices[choices["choice"] == sample]
    order = [*dict.fromkeys(mine["claim"])]
    agrees = mine.pivot(index="run", columns="claim", values="verdict")[order].apply(_agrees)
    inside = factors[factors["run"].isin(agrees.index)]
    found = {
        name: own.set_index("run")["number" if own["kind"].iloc[0] == "property" else "value"]
        for name, own in inside.groupby("factor", sort=False)
    }
    return agrees, pd.DataFrame(found, index=agrees.index)


def by_value(agrees: pd.Series, values: pd.Series) -> pd.DataFrame:
    """By value of a factor: ``share`` of agreeing runs among the ``runs`` judged."""
    judged = agrees.notna() & values.notna()
    agrees, values = agrees[judged], values[judged]
    if values.dtype.kind == "f" and len(values):
        middle = values.median()
        larger = values > middle
        values = larger.map({True: f"above {middle:.3g}", False: f"up to {middle:.3g}"})
    found = agrees.groupby(values, sort=False).agg(["mean", "size"])
    return found.rename(columns={"mean": "share", "size": "runs"})


def _difference(found: pd.DataFrame) -> dict:
    """How much a factor changes the share; nothing where it has fewer than two values."""
    found = found[found["runs"] >= _LEAST_RUNS]
    if len(found) < 2:
        return {}
    share, runs = found["share"], found["runs"]
    mean = share @ runs / runs.sum()
    variance = mean * (1.0 - mean)
    square = np.sum(runs * (share - mean) ** 2) / variance if variance else 0.0
    least, most = share.idxmin(), share.idxmax()
    return {
        "least_value": least,
        "least_share": share[least],
        "least_runs": runs[least],
        "most_value": most,
        "most_share": share[most],
        "most_runs": runs[most],
        "difference": share[most] - share[least],
        "chance": chdtrc(len(found) - 1, square),
    }


def _holds(row: dict) -> str:
    """Where a claim holds, by its shares over arms and over choices."""
    told = np.array([row.get(f"{name}_share", np.nan) for name in ("arms", "all", "all_and_arm")])
    if np.isnan(told).all():
        return UNKNOWN
    if np.nanmin(told) >= STEADY:
        return EVERYWHERE
    if np.nanmax(told) <= 1.0 - STEADY:
        return NOWHERE
    on_arm, on_choice, _ = (told < STEADY) & (told > 1.0 - STEADY)
    if on_arm and on_choice:
        return ON_BOTH
    return ON_ARM if on_arm else ON_CHOICE


def _agrees(verdicts: pd.Series) -> pd.Series:
    return verdicts.map({"agrees": 1.0, "differs": 0.0})

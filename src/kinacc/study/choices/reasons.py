"""What a claim hangs on: shares of runs in which it agrees, and the factors that change them most.

The measure: among runs in which everything varies at once, the difference between the shares of
agreeing runs at the value of a factor where the claim agrees most often and where it agrees least
often. A property is a factor of two values, its smaller and its larger half. A factor counts when
chance alone would hardly make its shares differ so (chi-square test, 1 % over all factors).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kinacc.artifacts.allowed import HOLDS
from kinacc.artifacts.columns import Columns
from kinacc.artifacts.contract import columns_of
from kinacc.study.choices.open_choices import ALL, ALL_AND_ARM, ARM, DEFAULT, FIG_5, SAMPLES

EVERYWHERE, ON_ARM, ON_CHOICE, ON_BOTH, NOWHERE, UNKNOWN = HOLDS
STEADY = 0.95  # share of runs from which on a claim holds everywhere
_CHANCE = 0.01  # of naming any factor of a claim without reason
_LEAST_RUNS = 5  # at a value, for its share to count


@dataclass(frozen=True)
class Table:
    """The runs of one sample: which claims agree (1), differ (0) or cannot be judged (NaN).

    ``agrees`` by claim (runs,); ``factors`` by name the values (runs,), texts or numbers.
    """

    agrees: dict[str, np.ndarray]
    factors: dict[str, np.ndarray]


def shares(choices: Columns) -> Columns:
    """Columns of ``claim_shares``: one row per claim."""
    groups = {
        "arms": choices["choice"] == ARM,
        "alone": ~np.isin(choices["choice"], (DEFAULT, ARM, *SAMPLES)),
        "all": choices["choice"] == ALL,
        "all_and_arm": choices["choice"] == ALL_AND_ARM,
    }
    rows = []
    for claim in dict.fromkeys(choices["claim"]):
        mine = choices["claim"] == claim
        verdict = choices["verdict"][mine & (choices["choice"] == DEFAULT)][0]
        row = {"claim": claim, "verdict": verdict}
        for name, group in groups.items():
            judged = _agrees(choices["verdict"][mine & group])
            judged = judged[~np.isnan(judged)]
            row |= {f"{name}_runs": judged.size}
            row |= {f"{name}_share": float(judged.mean()) if judged.size else np.nan}
        rows.append(row | {"holds": _holds(row)})
    return columns_of("claim_shares", rows)


def reasons(choices: Columns, factors: Columns) -> Columns:
    """Columns of ``claim_reasons``: every factor of every claim, by sample the largest first."""
    kinds = dict(zip(factors["factor"], factors["kind"], strict=True))
    rows = []
    for sample in (ARM, ALL_AND_ARM, FIG_5):
        table = table_of(choices, factors, sample)
        for claim, agrees in table.agrees.items():
            found = [
                {"claim": claim, "sample": sample, "factor": name, "kind": kinds[name], **told}
                for name, values in table.factors.items()
                if name != ARM
                for told in _difference(agrees, values)
            ]
            limit = _CHANCE / max(len(found), 1)
            for row in found:
                row["decides"] = int(row["chance"] < limit)
            found.sort(key=lambda row: (-row["decides"], -row["difference"], row["factor"]))
            rows += [row | {"rank": rank} for rank, row in enumerate(found, 1)]
    return columns_of("claim_reasons", rows)


def table_of(choices: Columns, factors: Columns, sample: str) -> Table:
    """Verdicts and factors of the runs of a sample."""
    mine = choices["choice"] == sample
    runs = np.unique(choices["run"][mine])
    agrees = {}
    for claim in dict.fromkeys(choices["claim"][mine]):
        rows = mine & (choices["claim"] == claim)
        agrees[claim] = _placed(runs, choices["run"][rows], _agrees(choices["verdict"][rows]))
    found = {}
    inside = np.isin(factors["run"], runs)
    for name in dict.fromkeys(factors["factor"][inside]):
        rows = inside & (factors["factor"] == name)
        told = "number" if factors["kind"][rows][0] == "property" else "value"
        found[name] = _placed(runs, factors["run"][rows], factors[told][rows])
    return Table(agrees, found)


def halves(numbers: np.ndarray) -> tuple[np.ndarray, str, str]:
    """For numbers (n,): which are in the larger half, and words for both halves."""
    middle = float(np.nanmedian(numbers))
    return numbers > middle, f"up to {middle:.3g}", f"above {middle:.3g}"


def by_value(agrees: np.ndarray, values: np.ndarray) -> dict[str, tuple[float, int]]:
    """By value of a factor (runs,): the share of agreeing runs among those judged, their count."""
    judged = ~np.isnan(agrees)
    if values.dtype.kind == "f":
        judged &= ~np.isnan(values)
        if not judged.any():
            return {}
        larger, low, high = halves(values[judged])
        words = np.where(larger, high, low).astype(object)
    else:
        words = values[judged]
    return {
        str(word): (float(agrees[judged][words == word].mean()), int(np.sum(words == word)))
        for word in dict.fromkeys(words)
        if word is not None
    }


def _difference(agrees: np.ndarray, values: np.ndarray) -> Iterator[dict]:
    """How much a factor changes the share; nothing where it has fewer than two values."""
    from scipy.special import chdtrc

    found = {
        word: told for word, told in by_value(agrees, values).items() if told[1] >= _LEAST_RUNS
    }
    if len(found) < 2:
        return
    share, count = np.array(list(found.values())).T
    mean = float(share @ count / count.sum())
    variance = mean * (1.0 - mean)
    square = float(np.sum(count * (share - mean) ** 2) / variance) if variance else 0.0
    words, least, most = list(found), int(np.argmin(share)), int(np.argmax(share))
    yield {
        "least_value": words[least],
        "least_share": share[least],
        "least_runs": int(count[least]),
        "most_value": words[most],
        "most_share": share[most],
        "most_runs": int(count[most]),
        "difference": share[most] - share[least],
        "chance": float(chdtrc(len(found) - 1, square)),
    }


def _holds(row: dict) -> str:
    """Where a claim holds, by its shares over arms and over choices."""
    told = np.array([row[f"{name}_share"] for name in ("arms", "all", "all_and_arm")])
    if np.isnan(told).all():
        return UNKNOWN
    if np.nanmin(told) >= STEADY:
        return EVERYWHERE
    if np.nanmax(told) <= 1.0 - STEADY:
        return NOWHERE
    unsteady = (told < STEADY) & (told > 1.0 - STEADY)
    on_arm, on_choice = unsteady[0], unsteady[1]
    if on_arm and on_choice:
        return ON_BOTH
    return ON_ARM if on_arm else ON_CHOICE


def _agrees(verdicts: np.ndarray) -> np.ndarray:
    known = {"agrees": 1.0, "differs": 0.0}
    return np.array([known.get(verdict, np.nan) for verdict in verdicts])


def _placed(runs: np.ndarray, at: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values of the runs ``at``, in the order of ``runs``; NaN or None where there is none."""
    empty = np.nan if values.dtype.kind == "f" else None
    found = np.full(runs.size, empty, dtype=values.dtype)
    found[np.searchsorted(runs, at)] = values
    return found

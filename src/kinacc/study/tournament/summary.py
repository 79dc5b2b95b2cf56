"""Summing up a tournament: errors, coverage with its interval, and whether confidence is kept."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy

from kinacc.artifacts.columns import Columns
from kinacc.artifacts.contract import columns_of
from kinacc.assess.binomial import binomial_interval

CELL = ("assessor", "target", "field", "candidates", "noise_mm", "budget", "setup", "world")
KIND = ("assessor", "target", "setup", "world")  # what a verdict is about
FAMILY_ERROR = 0.01  # of all tests of one assessor together
MOST_BELOW = 0.03  # coverage a cell may be below the confidence, significant or not
ENOUGH = 200  # statements without which a cell cannot tell three points from chance


def summed(rows: Mapping[str, np.ndarray]) -> Columns:
    """The rows of ``cells`` as columns of ``tournament_cells``."""
    return columns_of("tournament_cells", cells(rows))


def cells(rows: Mapping[str, np.ndarray]) -> list[dict]:
    """One row per assessor, target and cell.

    ``upper_holds`` and ``lower_holds`` are shares of the statements made; ``upper_low`` and
    ``upper_high`` the exact 95 % interval of the first; upper bounds of all points but some are
    held to the largest of these. ``broken`` counts statements whose
    assumption is not true of the field: coverage and excess leave them out, and
    ``broken_holds`` is their coverage alone. ``attainable_mm`` and ``proven_mm`` are means over the
    campaigns they were computed for. ``sound`` counts campaigns, with a statement or
    without, whose assumption is true.
    """
    return [_cell(rows, key, places) for key, places in _groups(rows).items()]


def judged(summary: Mapping[str, np.ndarray]) -> Columns:
    """Whether every assessor keeps what it says, over all cells of a target, setup and world.

    Holm's test of every cell against its confidence at a family-wise 1 %, and no cell with 200
    statements or more further than three points below. ``worst_holds`` is the smallest coverage,
    ``worst_begun`` the same of all campaigns begun, where no statement is no false one;
    ``withheld_sound`` the largest share of a cell's campaigns without a statement although what
    it would rest on is true. Lower bounds are tested in the same way.
    """
    found = []
    kinds = zip(*(summary[name] for name in KIND), strict=True)
    for kind in dict.fromkeys(kinds):
        every = np.all([summary[n] == each for n, each in zip(KIND, kind, strict=True)], axis=0)
        mine = every & ~np.isnan(summary["confidence"]) & (summary["stated"] > summary["broken"])
        if not mine.any():
            continue
        own = {name: np.asarray(column)[mine] for name, column in summary.items()}
        tried = (own["stated"] - own["broken"]).astype(int)
        held = np.rint(own["upper_holds"] * tried).astype(int)
        least = own["confidence"] - MOST_BELOW
        begun = 1.0 - (tried - held) / own["repetitions"]
        found.append(
            {
                **dict(zip(KIND, kind, strict=True)),
                "cells": int(mine.sum()),
                "statements": int(tried.sum()),
                "rejected": _rejected(held, tried, own["confidence"]),
                "below": int(np.sum((held < least * tried) & (tried >= ENOUGH))),
                "worst_holds": float(own["upper_holds"].min()),
                "worst_begun": float(begun.min()),
                "mean_holds": float(held.sum() / tried.sum()),
                **_lower(own),
                "withheld": _withheld(summary, every),
                "withheld_sound": _withheld_sound(summary, every),
                "alarmed": float(
                    summary["alarmed"][every].sum() / summary["repetitions"][every].sum()
                ),
            }
        )
    return columns_of("tournament_verdicts", found)


def _rejected(held: np.ndarray, tried: np.ndarray, confidence: np.ndarray) -> int:
    """Number of cells whose share of bounds that hold is significantly below the confidence."""
    return int(holm(scipy.special.bdtr(held, tried, confidence), FAMILY_ERROR).sum())


def _lower(own: Mapping[str, np.ndarray]) -> dict:
    """How the lower bounds of some cells fared."""
    some = own["lower_stated"] > 0
    if not some.any():
        return {"lower_rejected": 0, "lower_worst": np.nan, "lower_holds": np.nan}
    tried, holds = own["lower_stated"][some].astype(int), own["lower_holds"][some]
    held = np.rint(holds * tried).astype(int)
    return {
        "lower_rejected": _rejected(held, tried, own["confidence"][some]),
        "lower_worst": float(holds.min()),
        "lower_holds": float(held.sum() / tried.sum()),
    }


def in_order(summary: Mapping[str, np.ndarray]) -> Columns:
    """The rows in the order of their keys, so that parts of any number give the same table."""
    keys = list(zip(*(summary[name].tolist() for name in CELL), strict=True))
    order = sorted(range(len(keys)), key=keys.__getitem__)
    return {name: np.asarray(column)[order] for name, column in summary.items()}


def _withheld(summary: Mapping[str, np.ndarray], mine: np.ndarray) -> float:
    """Share of the campaigns of some cells that state no upper bound."""
    stated, all_of = (int(summary[name][mine].sum()) for name in ("stated", "repetitions"))
    return 1.0 - stated / all_of


def _withheld_sound(summary: Mapping[str, np.ndarray], mine: np.ndarray) -> float:
    """Largest share, over some cells, of campaigns with a true assumption that state nothing."""
    mine = mine & (summary["sound"] > 0)
    kept = (summary["stated"][mine] - summary["broken"][mine]) / summary["sound"][mine]
    return float(np.max(1.0 - kept)) if kept.size else np.nan


def holm(chances: np.ndarray, error: float) -> np.ndarray:
    """Which of the hypotheses with these p-values (n,) Holm's procedure rejects."""
    chances = np.asarray(chances, dtype=float)
    order = np.argsort(chances, kind="stable")
    limits = error / np.arange(chances.size, 0, -1)
    passed = np.cumprod(chances[order] <= limits).astype(bool)
    rejected = np.zeros(chances.size, dtype=bool)
    rejected[order] = passed
    return rejected


def _groups(rows: Mapping[str, np.ndarray]) -> dict[tuple, list[int]]:
    groups: dict[tuple, list[int]] = {}
    for place, key in enumerate(zip(*(rows[name].tolist() for name in CELL), strict=True)):
        groups.setdefault(key, []).append(place)
    return dict(sorted(groups.items()))


def _cell(rows: Mapping[str, np.ndarray], key: tuple, places: list[int]) -> dict:
    own = {name: column[places] for name, column in rows.items()}
    miss = own["value_mm"] - own["true_mm"]
    valued = ~np.isnan(miss)
    stated = ~np.isnan(own["upper_mm"])
    broken = stated & (own["assumption"] == "broken")
    counted = stated & ~broken
    tried = int(counted.sum())
    excess = (own["upper_mm"] - own["bounded_mm"])[counted]
    above = (own["lower_mm"] - own["true_mm"])[~np.isnan(own["lower_mm"])]
    beyond = (own["upper_mm"] >= own["bounded_mm"])[broken]
    low, high = binomial_interval(int(np.sum(excess >= 0)), tried) if tried else (np.nan, np.nan)
    every = np.nanmax(own["confidence"]) if not np.isnan(own["confidence"]).all() else np.nan
    return {
        **dict(zip(CELL, key, strict=True)),
        "repetitions": len(places),
        "true_mm": own["true_mm"].mean(),
        "bias_mm": miss[valued].mean() if valued.any() else np.nan,
        "rmse_mm": np.sqrt(np.mean(miss[valued] ** 2)) if valued.any() else np.nan,
        "confidence": every,
        "stated": int(stated.sum()),
        "broken": int(broken.sum()),
        "sound": int(np.sum(own["assumption"] != "broken")),
        "upper_holds": np.mean(excess >= 0) if tried else np.nan,
        "broken_holds": beyond.mean() if beyond.size else np.nan,
        "upper_low": low,
        "upper_high": high,
        "lower_stated": int(above.size),
        "lower_holds": np.mean(above <= 0) if above.size else np.nan,
        "alarmed": int(np.sum(own["alarmed"])),
        "excepted": own["excepted"][stated].mean() if stated.any() else np.nan,
        "excess_mm": excess.mean() if tried else np.nan,
        "width_mm": (own["upper_mm"] - own["lower_mm"])[counted].mean() if tried else np.nan,
        **{name: _finite_mean(own[name]) for name in ("attainable_mm", "proven_mm")},
        "measurements": own["measurements"].mean(),
        "points_visited": own["points_visited"].mean(),
    }


def _finite_mean(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if finite.size else np.nan

"""Summing up a tournament: errors, coverage with its interval, and whether confidence is kept."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.special import bdtr

from kinacc.campaign.planning import binomial_interval

KIND = ["assessor", "target", "setup", "world"]  # what a verdict is about
CELL = ["assessor", "target", "field", "candidates", "noise_mm", "budget", "setup", "world"]
FAMILY_ERROR = 0.01  # of all tests of one assessor together
MOST_BELOW = 0.03  # coverage a cell may be below the confidence, significant or not
ENOUGH = 200  # statements without which a cell cannot tell three points from chance


def cells(rows: pd.DataFrame) -> pd.DataFrame:
    """One row per assessor, target and cell, of one row per campaign and statement.

    ``upper_holds`` and ``lower_holds`` are shares of the statements made; ``upper_low`` and
    ``upper_high`` the exact 95 % interval of the first; upper bounds of all points but some are
    held to the largest of these. ``broken`` counts statements whose assumption is not true of the
    field: coverage and excess leave them out, and ``broken_holds`` is their coverage alone.
    ``attainable_mm`` and ``proven_mm`` are means over the campaigns they were computed for.
    ``sound`` counts campaigns, with a statement or without, whose assumption is true.
    """
    groups = rows.groupby(CELL, sort=True)
    return pd.DataFrame([dict(zip(CELL, key, strict=True)) | _cell(own) for key, own in groups])


def _cell(own: pd.DataFrame) -> dict:
    miss = own["value_mm"] - own["true_mm"]
    stated, is_broken = own["upper_mm"].notna(), own["assumption"] == "broken"
    excess = own["upper_mm"] - own["bounded_mm"]
    counted, broken = excess[stated & ~is_broken], excess[stated & is_broken]
    above = (own["lower_mm"] - own["true_mm"]).dropna()
    held = int(np.sum(counted >= 0))
    low, high = binomial_interval(held, counted.size) if counted.size else (np.nan, np.nan)
    limits = own[["attainable_mm", "proven_mm"]].replace([np.inf, -np.inf], np.nan).mean()
    return {
        "repetitions": len(own),
        "true_mm": own["true_mm"].mean(),
        "bias_mm": miss.mean(),
        "rmse_mm": np.sqrt((miss**2).mean()),
        "confidence": own["confidence"].max(),
        "stated": int(stated.sum()),
        "broken": broken.size,
        "sound": int(np.sum(~is_broken)),
        "upper_holds": (counted >= 0).mean(),
        "broken_holds": (broken >= 0).mean(),
        "upper_low": low,
        "upper_high": high,
        "lower_stated": above.size,
        "lower_holds": (above <= 0).mean(),
        "alarmed": int(own["alarmed"].sum()),
        "excepted": own["excepted"][stated].mean(),
        "excess_mm": counted.mean(),
        "width_mm": (own["upper_mm"] - own["lower_mm"])[counted.index].mean(),
        **limits,
        "measurements": own["measurements"].mean(),
        "points_visited": own["points_visited"].mean(),
    }


def judged(table: pd.DataFrame) -> pd.DataFrame:
    """Whether every assessor keeps what it says, over all cells of a target, setup and world.

    Holm's test of every cell against its confidence at a family-wise 1 %, and no cell with 200
    statements or more further than three points below. ``worst_holds`` is the smallest coverage,
    ``worst_begun`` the same of all campaigns begun, where no statement is no false one;
    ``withheld_sound`` the largest share of a cell's campaigns without a statement although what
    it would rest on is true. Lower bounds are tested in the same way.
    """
    rows = [
        dict(zip(KIND, key, strict=True)) | _verdict(own, tested)
        for key, own in table.groupby(KIND, sort=False)
        if len(tested := own[own["confidence"].notna() & (own["stated"] > own["broken"])])
    ]
    return pd.DataFrame(rows)


def _verdict(every: pd.DataFrame, own: pd.DataFrame) -> dict:
    tried = own["stated"] - own["broken"]
    held = np.rint(own["upper_holds"] * tried)
    below = (held < (own["confidence"] - MOST_BELOW) * tried) & (tried >= ENOUGH)
    lower = own[own["lower_stated"] > 0]
    lower_held = np.rint(lower["lower_holds"] * lower["lower_stated"])
    sound = every[every["sound"] > 0]
    return {
        "cells": len(own),
        "statements": int(tried.sum()),
        "rejected": rejected(held, tried, own["confidence"]),
        "below": int(below.sum()),
        "worst_holds": own["upper_holds"].min(),
        "worst_begun": (1.0 - (tried - held) / own["repetitions"]).min(),
        "mean_holds": held.sum() / tried.sum(),
        "lower_rejected": rejected(lower_held, lower["lower_stated"], lower["confidence"]),
        "lower_worst": lower["lower_holds"].min(),
        "lower_holds": lower_held.sum() / lower["lower_stated"].sum() if len(lower) else np.nan,
        "withheld": 1.0 - every["stated"].sum() / every["repetitions"].sum(),
        "withheld_sound": (1.0 - (sound["stated"] - sound["broken"]) / sound["sound"]).max(),
        "alarmed": every["alarmed"].sum() / every["repetitions"].sum(),
    }


def rejected(held: pd.Series, tried: pd.Series, confidence: pd.Series) -> int:
    """Number of cells whose share of bounds that hold is significantly below the confidence."""
    return int(holm(bdtr(held, tried.astype(int), confidence), FAMILY_ERROR).sum())


def holm(chances: np.ndarray, error: float) -> np.ndarray:
    """Which of the hypotheses with these p-values (n,) Holm's procedure rejects."""
    chances = np.asarray(chances, dtype=float)
    order = np.argsort(chances, kind="stable")
    limits = error / np.arange(chances.size, 0, -1)
    found = np.zeros(chances.size, dtype=bool)
    found[order] = np.cumprod(chances[order] <= limits).astype(bool)
    return found

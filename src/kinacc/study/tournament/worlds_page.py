"""The tournament in words, part on worlds: what bounds are worth in other worlds than stated."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinacc.assess.binomial import binomial_interval
from kinacc.assess.conditions import CONDITIONS, STATED
from kinacc.study.tournament.contest import SETUPS

PLAIN = "plain"
KINDS = ("assessor", "setup", "world", "candidates", "budget", "noise_mm")
_TARGET = "candidates"
_SETTINGS = {each.name: each.settings for each in SETUPS}


def with_setups(cells: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Cells of any tournament with ``setup`` and ``world``, which earlier ones had one of."""
    count = len(cells["assessor"])
    one = {"setup": np.full(count, PLAIN, object), "world": np.full(count, STATED, object)}
    return {**one, **cells}


def as_stated(cells: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The cells in which assessors have their own settings and readings are as stated."""
    every = with_setups(cells)
    mine = (every["setup"] == PLAIN) & (every["world"] == STATED)
    return {name: np.asarray(column)[mine] for name, column in every.items()}


def has_worlds(cells: Mapping[str, np.ndarray]) -> bool:
    """Whether readings come about in more ways than one."""
    return len(set(with_setups(cells)["world"])) > 1


def of_kinds(cells: Mapping[str, np.ndarray]) -> list[dict]:
    """Over all fields, by assessor, setup, world, candidates, budget and noise, all candidates.

    Shares of all campaigns begun in which the upper and the lower bound is not false, with the
    exact 95 % intervals, and smallest shares of a field; shares of those stated and alarmed; median
    and largest excess over the attainable one.
    """
    every = with_setups(cells)
    about = every["target"] == _TARGET
    kinds = zip(*(every[name][about].tolist() for name in KINDS), strict=True)
    found = []
    for kind in sorted(set(kinds), key=_place):
        mine = about & np.all(
            [every[n] == each for n, each in zip(KINDS, kind, strict=True)], axis=0
        )
        own = {name: np.asarray(column)[mine] for name, column in every.items()}
        begun = int(own["repetitions"].sum())
        over = np.divide(own["excess_mm"], own["attainable_mm"])
        found.append(
            {
                **dict(zip(KINDS, kind, strict=True)),
                "begun": begun,
                "fields": len(own["field"]),
                **_shares("upper", own["upper_holds"], own["stated"] - own["broken"], own),
                **_shares("lower", own["lower_holds"], own["lower_stated"], own),
                "stated": own["stated"].sum() / begun,
                "alarmed": own["alarmed"].sum() / begun,
                "confidence": np.nanmax(own["confidence"]) if own["stated"].any() else np.nan,
                "excepted": own["excepted"][np.isfinite(own["excepted"])].max(initial=0.0),
                "over": over[np.isfinite(over)],
            }
        )
    return found


def _place(kind: tuple) -> tuple:
    """Where a kind stands: settings of their own after plain ones, other worlds after stated."""
    named = dict(zip(KINDS, kind, strict=True))
    own = named["setup"] != PLAIN, named["setup"], named["world"] != STATED
    return named["assessor"], *own, named["world"], *kind


def _shares(side: str, holds: np.ndarray, stated: np.ndarray, own: Mapping) -> dict:
    """Of all campaigns begun of some cells: share without a false bound; worst field's."""
    false = np.rint((1.0 - np.nan_to_num(holds, nan=1.0)) * stated).astype(int)
    begun, made = int(own["repetitions"].sum()), int(stated.sum())
    low, high = binomial_interval(begun - int(false.sum()), begun)
    return {
        side: 1.0 - false.sum() / begun,
        f"{side}_low": low,
        f"{side}_high": high,
        f"{side}_worst": float(np.min(1.0 - false / own["repetitions"])),
        f"{side}_stated": 1.0 - false.sum() / made if made else np.nan,
    }


def section(cells: Mapping[str, np.ndarray]) -> list[str]:
    """Lines of the page on a tournament with worlds."""
    rows = of_kinds(cells)
    lines = ["### Readings that are not as stated", ""]
    lines += ["| setup | settings |", "|---|---|"]
    for name in dict.fromkeys(row["setup"] for row in rows):
        told = ", ".join(f"`{key}: {value}`" for key, value in _SETTINGS.get(name, {}).items())
        lines.append(f"| {name} | {told or 'none of their own'} |")
    lines += ["", "| world | readings |", "|---|---|"]
    lines += [
        f"| {name} | {CONDITIONS[name].meaning} |"
        for name in dict.fromkeys(row["world"] for row in rows)
    ]
    lines += [
        "",
        "Bounds on all candidates, campaigns of all fields together. *Not false*: share of all "
        "campaigns begun without a false bound, in brackets that of the worst field; a campaign "
        "without a statement has none. *Said*: share in which readings were found to contradict "
        "what the bounds rest on, or single readings to be suspicious. *Over attainable*: median "
        "field (worst).",
        "",
        "| assessor | setup | world | candidates | budget | campaigns | confidence | stated | said "
        "| upper not false | of those stated | lower not false | of those stated | all but "
        "| over attainable |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    return lines + [_line(row) for row in rows]


def _line(row: Mapping) -> str:
    over = row["over"]
    near = f"{np.median(over):.2f} ({over.max():.2f})" if over.size else "-"
    return (
        f"| {row['assessor']} | {row['setup']} | {row['world']} | {row['candidates']} "
        f"| {row['budget']} | {row['begun']} | {_number(row['confidence'], 2)} "
        f"| {row['stated']:.1%} | {row['alarmed']:.1%} "
        f"| {row['upper']:.3f} ({row['upper_worst']:.3f}) | {_number(row['upper_stated'])} "
        f"| {row['lower']:.3f} ({row['lower_worst']:.3f}) | {_number(row['lower_stated'])} "
        f"| {row['excepted']:.0f} | {near} |"
    )


def _number(value: float, digits: int = 3) -> str:
    return "-" if np.isnan(value) else f"{value:.{digits}f}"

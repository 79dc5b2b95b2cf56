"""What tables from the accuracy map to the claims must say of each other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kinacc.artifacts.allowed import ASSESSORS, COVARIANCES, DISTANCES, OUTLIER_RULES, SEARCHES
from kinacc.artifacts.contract import ARTEFACTS
from kinacc.errors import Problem
from kinacc.workflow.verification.rule import TOLERANCE, Columns, Rule, Tables, mark


def _accuracy_map(tables: Tables) -> Iterator[Problem]:
    table = tables["accuracy_map"]
    none = table["solutions"] == 0
    for name in ("position_max_mm", "orientation_max_mrad"):
        wrong = np.isnan(table[name]) != none
        yield from mark("accuracy_map", wrong, f"{name} null", "null exactly where solutions is 0")
    for name in ("worst_branch", "orientation_worst_branch"):
        wrong = np.array([value is None for value in table[name]]) != none
        yield from mark("accuracy_map", wrong, f"{name} null", "null exactly where solutions is 0")
    for name in (each for each in table if each[0] == "q" and each[1:].isdigit()):
        wrong = np.isnan(table[name]) != none
        yield from mark("accuracy_map", wrong, f"{name} null", "null exactly where solutions is 0")
    wrong = table["solutions"] + table["extrapolating"] > table["wanted"]
    yield from mark("accuracy_map", wrong, "more combinations than tried", "at most wanted")


def _assessment_points(tables: Tables) -> Iterator[Problem]:
    table = tables["assessment_points"]
    error = np.sqrt(sum(table[f"e{axis}_mm"] ** 2 for axis in "xyz"))
    wrong = ~np.isclose(error, table["true_error_mm"], rtol=1e-9, atol=1e-12)
    yield from mark("assessment_points", wrong, "true_error_mm", "length of (ex, ey, ez)")
    wrong = np.sort(table["point"]) != np.arange(len(table["point"]))
    yield from mark("assessment_points", wrong, "point out of sequence", "0, 1, 2, ...")


def _study(tables: Tables) -> Iterator[Problem]:
    table = tables["study"]
    wrong = table["points_visited"] > table["measurements"]
    yield from mark("study", wrong, "more points than measurements", "at most measurements")
    with np.errstate(invalid="ignore"):
        wrong = table["lower_mm"] > table["upper_mm"]
    yield from mark("study", wrong, "lower_mm above upper_mm", "lower_mm <= upper_mm")
    visited = table["points_visited"] > len(tables["assessment_points"]["point"])
    yield from mark("study", visited, "more points than there are", "assessment_points.parquet")
    worlds = {
        name: sorted(zip(table["noise_mm"][at], table["repetition"][at], strict=True))
        for name in sorted(set(table["assessor"]))
        for at in [table["assessor"] == name]
    }
    for name in ASSESSORS:
        if name not in worlds:
            yield Problem("study.parquet", f"no rows of {name}", f"all of {', '.join(ASSESSORS)}")
    for name, own in worlds.items():
        if own != worlds.get("maximum", own):
            what = f"{name} was run on other simulations than maximum"
            yield Problem("study.parquet", what, "the same noise_mm and repetition")


def _study_summary(tables: Tables) -> Iterator[Problem]:
    study, summary = tables["study"], tables["study_summary"]
    truth = float(np.max(tables["assessment_points"]["true_error_mm"]))
    told = {
        (assessor, noise): i
        for i, (assessor, noise) in enumerate(
            zip(summary["assessor"], summary["noise_mm"], strict=True)
        )
    }
    keys = set(zip(study["assessor"], study["noise_mm"], strict=True))
    for assessor, noise in sorted(keys ^ set(told)):
        side = "study_summary" if (assessor, noise) in keys else "study"
        yield Problem(
            f"{side}.parquet", f"no rows of {assessor} at {noise:g} mm", "as in the other"
        )
    for assessor, noise in sorted(keys & set(told)):
        values = study["assessed_mm"][
            (study["assessor"] == assessor) & (study["noise_mm"] == noise)
        ]
        right = {
            "mean_mm": values.mean(),
            "min_mm": values.min(),
            "max_mm": values.max(),
            "bias_mm": values.mean() - truth,
            "rmse_mm": np.sqrt(np.mean((values - truth) ** 2)),
            "repetitions": values.size,
        }
        for name, value in right.items():
            found = summary[name][told[assessor, noise]]
            if not np.isclose(found, value, rtol=1e-9, atol=1e-9):
                place = f"study_summary.parquet, row {told[assessor, noise]}"
                what = f"{name} {found:g} of {assessor} at {noise:g} mm"
                yield Problem(place, what, f"{value:g}, computed from study.parquet")


def _readings(tables: Tables) -> Iterator[Problem]:
    table = tables["readings"]
    switches = ("outlier_rule", "distance", "covariance", "search")
    combinations = list(zip(*(table[name] for name in switches), strict=True))
    outlier = {(rule, None, None, None) for rule in OUTLIER_RULES}
    invalidation = {(None, d, c, s) for d in DISTANCES for c in COVARIANCES for s in SEARCHES}
    for noise in np.unique(tables["study_summary"]["noise_mm"]):
        for assessor, wanted in (
            ("outlier_rejection", outlier),
            ("model_invalidation", invalidation),
        ):
            at = np.flatnonzero((table["noise_mm"] == noise) & (table["assessor"] == assessor))
            found = [combinations[i] for i in at]
            if len(found) != len(wanted) or set(found) != wanted:
                what = f"{len(found)} rows of {assessor} at {noise:g} mm"
                allowed = f"{len(wanted)}, one per reading, null where a switch does not apply"
                yield Problem("readings.parquet", what, allowed)
    yield from _mean_between("readings", table)
    yield from _default_among_readings(table, tables["study_summary"])
    truth = float(np.max(tables["assessment_points"]["true_error_mm"]))
    wrong = ~np.isclose(table["bias_mm"], table["mean_mm"] - truth, rtol=1e-9, atol=1e-9)
    yield from mark("readings", wrong, "bias_mm", "mean_mm minus the true accuracy")


def _default_among_readings(table: Columns, summary: Columns) -> Iterator[Problem]:
    """The default reading is one of the readings: study_summary holds one of their rows."""
    numbers = ("noise_mm", "mean_mm", "min_mm", "max_mm")
    for i, assessor in enumerate(summary["assessor"]):
        if assessor not in ("outlier_rejection", "model_invalidation"):
            continue
        same = table["assessor"] == assessor
        for name in numbers:
            same &= np.isclose(table[name], summary[name][i], rtol=1e-9, atol=1e-9)
        if not same.any():
            what = f"{assessor} at {summary['noise_mm'][i]:g} mm agrees with no reading"
            yield Problem(f"study_summary.parquet, row {i}", what, "a row of readings.parquet")


def _mean_between(name: str, table: Columns) -> Iterator[Problem]:
    slack = TOLERANCE
    wrong = (table["mean_mm"] < table["min_mm"] - slack) | (
        table["mean_mm"] > table["max_mm"] + slack
    )
    yield from mark(name, wrong, "mean_mm outside its range", "min_mm <= mean_mm <= max_mm")


def _histories(tables: Tables) -> Iterator[Problem]:
    table, points = tables["histories"], tables["assessment_points"]
    truth = dict(zip(points["point"], points["true_error_mm"], strict=True))
    true = np.array([truth.get(point, np.nan) for point in table["point"]])
    wrong = ~np.isclose(true, table["true_mm"], rtol=1e-9, atol=1e-12)
    yield from mark("histories", wrong, "true_mm", "true_error_mm of the point")
    for example in dict.fromkeys(table["example"]):
        at = np.flatnonzero(table["example"] == example)
        order = at[np.argsort(table["iteration"][at], kind="stable")]
        if not np.array_equal(table["iteration"][order], np.arange(1, len(at) + 1)):
            yield Problem("histories.parquet", f"iterations of {example}", "1, 2, 3, ...")
        seen: dict[int, int] = {}
        wrong = np.zeros(len(table["point"]), dtype=bool)
        for i in order:
            point = int(table["point"][i])
            seen[point] = seen.get(point, 0) + 1
            wrong[i] = table["repeat"][i] != seen[point]
        yield from mark("histories", wrong, "repeat", "counted from 1 at every point")
        for name in ("eta_mm", "noise_mm", "alpha"):
            if len(set(table[name][at])) > 1:
                yield Problem("histories.parquet", f"{name} of {example} varies", "one value")


def _claims(tables: Tables) -> Iterator[Problem]:
    table = tables["claims"]
    for i, evidence in enumerate(table["evidence"]):
        for word in str(evidence).replace(".parquet", "").split(","):
            if word.strip() not in ARTEFACTS:
                place = f"claims.parquet, row {i}"
                yield Problem(place, f"evidence {word.strip()!r}", "names of artefacts")
    for name in ("statement", "statistic"):
        short = np.array([len(str(text).split()) < 2 for text in table[name]])
        yield from mark("claims", short, f"{name} of less than two words", "a sentence")
    numbers = ~np.isnan(table["paper"] + table["reproduced"] + table["tolerance"])
    with np.errstate(invalid="ignore"):
        near = (
            np.abs(table["reproduced"] - table["paper"]) <= table["tolerance"] * (1 + 1e-9) + 1e-12
        )
    judged = np.isin(table["verdict"], ("agrees", "differs"))
    wrong = numbers & judged & ((table["verdict"] == "agrees") != near)
    yield from mark("claims", wrong, "verdict", "agrees exactly within the tolerance")


def _robustness(tables: Tables) -> Iterator[Problem]:
    table, known = tables["robustness"], set(tables["claims"]["claim"])
    foreign = np.array([claim not in known for claim in table["claim"]], dtype=bool)
    yield from mark("robustness", foreign, "unknown claim", "claims of claims.parquet")


def _shares(tables: Tables) -> Iterator[Problem]:
    claims, draws = tables["claims"], tables["robustness"]
    for i, (claim, share) in enumerate(zip(claims["claim"], claims["share"], strict=True)):
        verdicts = draws["verdict"][draws["claim"] == claim]
        judged = verdicts[verdicts != "not comparable"]
        if np.isnan(share) or not judged.size:
            continue
        right = float(np.mean(judged == "agrees"))
        if abs(share - right) > TOLERANCE:
            allowed = f"{right:g}, counted from robustness.parquet"
            yield Problem(f"claims.parquet, row {i}", f"share {share:g} of {claim}", allowed)


RULES: tuple[tuple[tuple[str, ...], Rule], ...] = (
    (("accuracy_map",), _accuracy_map),
    (("assessment_points",), _assessment_points),
    (("study", "assessment_points"), _study),
    (("study", "study_summary", "assessment_points"), _study_summary),
    (("readings", "study_summary", "assessment_points"), _readings),
    (("histories", "assessment_points"), _histories),
    (("claims",), _claims),
    (("robustness", "claims"), _robustness),
    (("robustness", "claims"), _shares),
)

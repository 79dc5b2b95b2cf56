"""What rows and tables of one data set must say of each other, beyond single columns.

Every rule takes tables by artefact name and yields problems whose place is artefact and row; it
runs where all tables it needs are there and readable.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from kinacc.artifacts.allowed import ASSESSORS, COVARIANCES, DISTANCES, OUTLIER_RULES, SEARCHES
from kinacc.artifacts.contract import ARTEFACTS
from kinacc.artifacts.store import rows
from kinacc.errors import Problem

Columns = Mapping[str, np.ndarray]
Tables = Mapping[str, Columns]

_TOLERANCE = 1e-9


def _mark(place: str, wrong: np.ndarray, what: str, allowed: str) -> Iterator[Problem]:
    """A problem naming the marked rows, if there are any."""
    if wrong.any():
        yield Problem(f"{place}.parquet", f"{what} in {rows(wrong)}", allowed)


def _unit_quaternions(name: str) -> Callable[[Tables], Iterator[Problem]]:
    def rule(tables: Tables) -> Iterator[Problem]:
        parts = np.stack([tables[name][column] for column in ("qw", "qx", "qy", "qz")])
        null = np.isnan(parts)
        yield from _mark(
            name, null.any(axis=0) != null.all(axis=0), "quaternion null in part", "all or none"
        )
        length = np.linalg.norm(parts, axis=0)
        wrong = np.abs(length - 1.0) > 1e-6
        yield from _mark(name, wrong, "quaternion not of length 1", "unit quaternions")
        yield from _mark(name, parts[0] < -_TOLERANCE, "quaternion with qw < 0", "qw >= 0")

    return rule


def _measurements(tables: Tables) -> Iterator[Problem]:
    table = tables["measurements"]
    joints = np.stack(
        [values for name, values in table.items() if name[0] == "q" and name[1:].isdigit()]
    )
    first = np.unique(table["pose"], return_index=True, return_inverse=True)
    same = joints[:, first[1]][:, first[2]]
    yield from _mark(
        "measurements", np.any(joints != same, axis=0), "pose at other joints", "one configuration"
    )
    for name in ("fold", "subset"):
        values = table[name].astype(str)
        wrong = values != values[first[1]][first[2]]
        yield from _mark("measurements", wrong, f"pose in another {name}", f"one {name} per pose")


def _frames(name: str, models: tuple[str, ...]) -> Callable[[Tables], Iterator[Problem]]:
    def rule(tables: Tables) -> Iterator[Problem]:
        present = set(zip(tables[name]["model"], tables[name]["frame"], strict=True))
        for model in models:
            for frame in ("base", "tool"):
                if (model, frame) not in present:
                    what = f"no {frame} of model {model}"
                    yield Problem(f"{name}.parquet", what, "base and tool of every model")

    return rule


def _vec_frames_kept(tables: Tables) -> Iterator[Problem]:
    before, after = tables["vec_frames"], tables["frames"]
    kept = {row[0]: row[1:] for row in _frame_rows(after)}
    for row in _frame_rows(before):
        if kept.get(row[0]) != row[1:]:
            what = f"frame {row[0]} of model vec differs from vec_frames.parquet"
            yield Problem("frames.parquet", what, "the frames of the VEC fit")


def _frame_rows(table: Columns) -> list[tuple]:
    names = [name for name in table if name not in ("model", "frame")]
    return [
        (table["frame"][i], *(float(table[name][i]) for name in names))
        for i in np.flatnonzero(table["model"] == "vec")
    ]


def _every_joint(name: str) -> Callable[[Tables], Iterator[Problem]]:
    def rule(tables: Tables) -> Iterator[Problem]:
        joints = sorted({int(joint) for joint in tables[name]["joint"]})
        measured = tables["measurements"]
        count = sum(column[0] == "q" and column[1:].isdigit() for column in measured)
        if joints != list(range(1, count + 1)):
            what = f"joints {', '.join(map(str, joints))}"
            yield Problem(f"{name}.parquet", what, f"1 to {count}, as in measurements.parquet")

    return rule


def _vec_model(tables: Tables) -> Iterator[Problem]:
    table = tables["vec_model"]
    yield from _mark(
        "vec_model", table["q_min_rad"] >= table["q_max_rad"], "empty joint range", "q_min < q_max"
    )
    turning = (table["direction"] != 0) & (table["error"] != "eps_z")
    yield from _mark("vec_model", turning, "travel direction", "only in eps_z (eq. 6)")
    first = np.unique(table["joint"], return_index=True, return_inverse=True)
    for name in (
        "q_min_rad",
        "q_max_rad",
        "theta_offset_rad",
        "d_mm",
        "a_mm",
        "alpha_rad",
        "beta_rad",
    ):
        wrong = table[name] != table[name][first[1]][first[2]]
        yield from _mark("vec_model", wrong, f"another {name}", "one value per joint")


def _residuals(tables: Tables) -> Iterator[Problem]:
    table = tables["residuals"]
    kinds = list(zip(table["comparison"], table["subset"], table["quantity"], strict=True))
    pooled = np.isnan(table["fold"])
    for kind in dict.fromkeys(kinds):
        count = sum(bool(pooled[i]) for i, each in enumerate(kinds) if each == kind)
        if count != 1:
            what = f"{count} pooled rows of {', '.join(kind)}"
            yield Problem("residuals.parquet", what, "exactly one (fold null)")
    for wanted in ("vec_vs_measured", "dh_vs_vec", "dh_vs_measured", "nominal_vs_measured"):
        if (wanted, "train", "position") not in kinds:
            yield Problem("residuals.parquet", f"no row {wanted}, train, position")
    right = np.where(table["quantity"] == "position", "mm", "mrad")
    yield from _mark("residuals", table["unit"] != right, "unit", "position mm, orientation mrad")
    slack = 1.0 + _TOLERANCE
    yield from _mark(
        "residuals",
        (table["rms"] > table["max"] * slack) | (table["mean"] > table["rms"] * slack),
        "mean, rms and max out of order",
        "mean <= rms <= max",
    )


def _accuracy_map(tables: Tables) -> Iterator[Problem]:
    table = tables["accuracy_map"]
    none = table["solutions"] == 0
    for name in ("position_max_mm", "orientation_max_mrad"):
        wrong = np.isnan(table[name]) != none
        yield from _mark("accuracy_map", wrong, f"{name} null", "null exactly where solutions is 0")
    for name in ("worst_branch", "orientation_worst_branch"):
        wrong = np.array([value is None for value in table[name]]) != none
        yield from _mark("accuracy_map", wrong, f"{name} null", "null exactly where solutions is 0")
    wrong = table["solutions"] + table["extrapolating"] > table["wanted"]
    yield from _mark("accuracy_map", wrong, "more combinations than tried", "at most wanted")


def _assessment_points(tables: Tables) -> Iterator[Problem]:
    table = tables["assessment_points"]
    error = np.sqrt(sum(table[f"e{axis}_mm"] ** 2 for axis in "xyz"))
    wrong = ~np.isclose(error, table["true_error_mm"], rtol=1e-9, atol=1e-12)
    yield from _mark("assessment_points", wrong, "true_error_mm", "length of (ex, ey, ez)")
    wrong = np.sort(table["point"]) != np.arange(len(table["point"]))
    yield from _mark("assessment_points", wrong, "point out of sequence", "0, 1, 2, ...")


def _study(tables: Tables) -> Iterator[Problem]:
    table = tables["study"]
    wrong = table["points_visited"] > table["measurements"]
    yield from _mark("study", wrong, "more points than measurements", "at most measurements")
    with np.errstate(invalid="ignore"):
        wrong = table["lower_mm"] > table["upper_mm"]
    yield from _mark("study", wrong, "lower_mm above upper_mm", "lower_mm <= upper_mm")
    visited = table["points_visited"] > len(tables["assessment_points"]["point"])
    yield from _mark("study", visited, "more points than there are", "assessment_points.parquet")
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


def _mean_between(name: str, table: Columns) -> Iterator[Problem]:
    slack = _TOLERANCE
    wrong = (table["mean_mm"] < table["min_mm"] - slack) | (
        table["mean_mm"] > table["max_mm"] + slack
    )
    yield from _mark(name, wrong, "mean_mm outside its range", "min_mm <= mean_mm <= max_mm")


def _histories(tables: Tables) -> Iterator[Problem]:
    table, points = tables["histories"], tables["assessment_points"]
    truth = dict(zip(points["point"], points["true_error_mm"], strict=True))
    true = np.array([truth.get(point, np.nan) for point in table["point"]])
    wrong = ~np.isclose(true, table["true_mm"], rtol=1e-9, atol=1e-12)
    yield from _mark("histories", wrong, "true_mm", "true_error_mm of the point")
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
        yield from _mark("histories", wrong, "repeat", "counted from 1 at every point")
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
        yield from _mark("claims", short, f"{name} of less than two words", "a sentence")
    numbers = ~np.isnan(table["paper"] + table["reproduced"] + table["tolerance"])
    with np.errstate(invalid="ignore"):
        near = (
            np.abs(table["reproduced"] - table["paper"]) <= table["tolerance"] * (1 + 1e-9) + 1e-12
        )
    judged = np.isin(table["verdict"], ("agrees", "differs"))
    wrong = numbers & judged & ((table["verdict"] == "agrees") != near)
    yield from _mark("claims", wrong, "verdict", "agrees exactly within the tolerance")


def _robustness(tables: Tables) -> Iterator[Problem]:
    table, known = tables["robustness"], set(tables["claims"]["claim"])
    foreign = np.array([claim not in known for claim in table["claim"]], dtype=bool)
    yield from _mark("robustness", foreign, "unknown claim", "claims of claims.parquet")


RULES: tuple[tuple[tuple[str, ...], Callable[[Tables], Iterator[Problem]]], ...] = (
    (("measurements",), _unit_quaternions("measurements")),
    (("measurements",), _measurements),
    (("vec_frames",), _unit_quaternions("vec_frames")),
    (("vec_frames",), _frames("vec_frames", ("vec",))),
    (("frames",), _unit_quaternions("frames")),
    (("frames",), _frames("frames", ("vec", "dh", "nominal"))),
    (("vec_frames", "frames"), _vec_frames_kept),
    (("vec_model",), _vec_model),
    (("vec_model", "measurements"), _every_joint("vec_model")),
    (("dh_model", "measurements"), _every_joint("dh_model")),
    (("residuals",), _residuals),
    (("accuracy_map",), _accuracy_map),
    (("assessment_points",), _assessment_points),
    (("study", "assessment_points"), _study),
    (("study", "study_summary", "assessment_points"), _study_summary),
    (("readings", "study_summary"), _readings),
    (("histories", "assessment_points"), _histories),
    (("claims",), _claims),
    (("robustness", "claims"), _robustness),
)


def contradictions(tables: Tables) -> list[Problem]:
    """Everything the tables of one data set say that cannot be."""
    problems: list[Problem] = []
    for needed, rule in RULES:
        if all(name in tables and len(next(iter(tables[name].values()))) for name in needed):
            problems += rule(tables)
    return problems

"""Claims: each can agree and each can differ, and only its evidence decides."""

from __future__ import annotations

import math

import numpy as np
import pytest

from kinacc.study.claims import all_claims, evaluate
from kinacc.study.histories import KEPT, LARGER, REJECTED
from kinacc.synthetic.draw import TABLE_II

NOISE_MM = np.arange(0.05, 0.301, 0.05)
TRUTH_MM = 0.9


def summary(**curves: tuple[np.ndarray, np.ndarray, np.ndarray]) -> dict[str, np.ndarray]:
    """study_summary from (mean, min, max) per assessor."""
    names, rows = [], []
    for name, (mean, low, high) in curves.items():
        names += [name] * NOISE_MM.size
        rows.append(np.column_stack([NOISE_MM, mean, low, high, mean - TRUTH_MM]))
    table = np.concatenate(rows)
    columns = ("noise_mm", "mean_mm", "min_mm", "max_mm", "bias_mm")
    return {"assessor": np.array(names, dtype=object)} | dict(zip(columns, table.T, strict=True))


def as_in_the_paper() -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    maximum = TRUTH_MM + 2.0 * NOISE_MM
    outlier = TRUTH_MM - 0.2 + 1.2 * NOISE_MM
    invalidation = TRUTH_MM + 0.02 - 0.05 * NOISE_MM
    return {
        "maximum": (maximum, maximum - 0.5 * NOISE_MM, maximum + 1.5 * NOISE_MM),
        "outlier_rejection": (outlier, outlier - 0.5 * NOISE_MM, outlier + 0.5 * NOISE_MM),
        "model_invalidation": (
            invalidation,
            invalidation - 0.8 * NOISE_MM,
            invalidation + 0.8 * NOISE_MM,
        ),
    }


def row(tables, claim: str, **options) -> dict[str, object]:
    columns = evaluate(tables, paper_arm=True, **options)
    place = list(columns["claim"]).index(claim)
    return {name: values[place] for name, values in columns.items()}


STUDY_CLAIMS = [claim.id for claim in all_claims() if claim.evidence == "study_summary"]


@pytest.mark.parametrize("claim", STUDY_CLAIMS)
def test_study_sentence_agrees_where_the_curves_are_the_papers(claim):
    assert row({"study_summary": summary(**as_in_the_paper())}, claim)["verdict"] == "agrees"


def flipped(assessor: str, change) -> dict[str, np.ndarray]:
    curves = as_in_the_paper()
    curves[assessor] = change(*curves[assessor])
    return summary(**curves)


SLOPE = 4.0 * NOISE_MM - 4.0 * NOISE_MM.mean()
BREAKING = {
    "all_affected_by_noise": (
        "model_invalidation",
        lambda mean, low, high: (mean + 1.5 * NOISE_MM, low, high),
    ),
    "maximum_overestimates": ("maximum", lambda m, lo, hi: (m - 0.2, lo - 0.2, hi - 0.2)),
    "maximum_much_larger": ("maximum", lambda m, lo, hi: (m - 0.3, lo - 0.3, hi - 0.3)),
    "maximum_grows_with_noise": ("maximum", lambda m, lo, hi: (m[::-1], lo, hi)),
    "maximum_skewed_upward": ("maximum", lambda m, lo, hi: (m, m - (hi - m), m + (m - lo))),
    "outlier_rejection_grows_with_noise": (
        "outlier_rejection",
        lambda m, lo, hi: (m[::-1], lo, hi),
    ),
    "outlier_rejection_below_at_low_noise": (
        "outlier_rejection",
        lambda m, lo, hi: (m + 0.2, lo, hi),
    ),
    "outlier_rejection_above_at_high_noise": (
        "outlier_rejection",
        lambda m, lo, hi: (m - 0.4, lo, hi),
    ),
    "outlier_rejection_smaller_spread": (
        "outlier_rejection",
        lambda m, lo, hi: (m, m - 9 * NOISE_MM, m + 9 * NOISE_MM),
    ),
    "outlier_rejection_more_even": (
        "outlier_rejection",
        lambda m, lo, hi: (m, m - 0.01 * NOISE_MM, hi),
    ),
    "outlier_rejection_equally_bad": (
        "outlier_rejection",
        lambda m, lo, hi: (np.full(6, TRUTH_MM), lo, hi),
    ),
    "model_invalidation_varies_least": (
        "model_invalidation",
        lambda m, lo, hi: (m + SLOPE, lo, hi),
    ),
    "model_invalidation_even_spread": (
        "model_invalidation",
        lambda m, lo, hi: (m, lo, m + 2.0 * (hi - m)),
    ),
    "model_invalidation_larger_spread": (
        "model_invalidation",
        lambda m, lo, hi: (m, m - 0.1 * NOISE_MM, m + 0.1 * NOISE_MM),
    ),
    "model_invalidation_performs_well": (
        "model_invalidation",
        lambda m, lo, hi: (m - 0.5, lo, hi),
    ),
    "model_invalidation_less_sensitive": (
        "model_invalidation",
        lambda m, lo, hi: (m + SLOPE, lo, hi),
    ),
}


@pytest.mark.parametrize("claim", STUDY_CLAIMS)
def test_study_sentence_differs_where_its_curve_breaks_it(claim):
    assert row({"study_summary": flipped(*BREAKING[claim])}, claim)["verdict"] == "differs"


def test_few_points_near_the_limit_counts_points():
    errors = np.full(200, 0.5)
    errors[:9] = 0.89
    errors[0] = 0.9
    few = {"assessment_points": {"true_error_mm": errors}}
    assert row(few, "few_points_near_limit")["reproduced"] == pytest.approx(9 / 200)
    assert row(few, "few_points_near_limit")["verdict"] == "agrees"
    errors[:11] = 0.89
    assert row(few, "few_points_near_limit")["verdict"] == "differs"


def dh_model() -> dict[str, np.ndarray]:
    return {"joint": np.arange(1, 7)} | {
        name: getattr(TABLE_II, name).copy()
        for name in ("theta_offset_rad", "d_mm", "a_mm", "alpha_rad")
    }


def test_table_2_angles_are_compared_modulo_a_turn():
    table = dh_model()
    table["theta_offset_rad"] = table["theta_offset_rad"] + 2.0 * math.pi
    assert row({"dh_model": table}, "table2_theta_offset_4")["verdict"] == "agrees"
    table["theta_offset_rad"][3] += 0.0031
    assert row({"dh_model": table}, "table2_theta_offset_4")["verdict"] == "differs"


def test_antiparallel_lengths_are_judged_by_their_difference_alone():
    table = dh_model()
    table["d_mm"] = table["d_mm"] + np.array([0, 100.0, 100.0, 0, 0, 0])
    assert row({"dh_model": table}, "table2_d_2")["verdict"] == "not comparable"
    assert row({"dh_model": table}, "table2_d_2_minus_d_3")["verdict"] == "agrees"
    table["d_mm"][1] += 1.01
    assert row({"dh_model": table}, "table2_d_2_minus_d_3")["verdict"] == "differs"


def history(example: str, true_mm, probability, eta_mm: float, repeat=None, point=None):
    count = len(true_mm)
    return {
        "example": np.full(count, example, dtype=object),
        "alpha": np.full(count, 0.6),
        "iteration": np.arange(1, count + 1),
        "point": np.arange(count) if point is None else np.asarray(point),
        "repeat": np.ones(count, int) if repeat is None else np.asarray(repeat),
        "eta_mm": np.full(count, eta_mm),
        "averaged_mm": np.asarray(true_mm, dtype=float),
        "true_mm": np.asarray(true_mm, dtype=float),
        "rejection_probability": np.asarray(probability, dtype=float),
    }


def joined(*parts):
    return {"histories": {k: np.concatenate([p[k] for p in parts]) for k in parts[0]}}


HISTORY_CLAIMS = [claim.id for claim in all_claims() if claim.evidence == "histories"]
GOOD_HISTORIES = joined(
    history(REJECTED, [0.1, 0.2, 0.9, 0.9], [0.1, 0.5, 0.7, 0.8], 0.8, [1, 1, 1, 2], [0, 1, 2, 2]),
    history(LARGER, [0.1, 0.2, 0.9], [0.1, 0.5, 0.6], 0.85),
    history(KEPT, [0.1, 0.2, 0.2, 0.9], [0.1, 0.7, 0.5, 0.5], 1.0, [1, 1, 2, 1], [0, 1, 1, 2]),
)
BAD_HISTORIES = joined(
    history(
        REJECTED,
        [0.85] + [0.1] * 60 + [0.9, 0.1, 0.1],
        [0.1] * 63 + [0.6],
        0.95,
        [1] * 63 + [2],
        [*range(63), 62],
    ),
    history(LARGER, [0.1], [0.61], 0.85),
    history(KEPT, [0.1, 1.1], [0.1, 0.7], 1.0),
)


@pytest.mark.parametrize("claim", HISTORY_CLAIMS)
def test_history_sentence_agrees_and_differs(claim):
    assert row(GOOD_HISTORIES, claim)["verdict"] == "agrees"
    if claim == "fig5_few_true_errors_above":  # its bound must lie below the errors it counts
        bad = joined(history(REJECTED, [0.85, 0.85, 0.9], [0.1, 0.1, 0.7], 0.8))
    elif claim == "fig5_approaches_alpha":
        bad = joined(history(REJECTED, [0.1] * 60, [0.1] * 50 + [0.6] * 10, 0.8))
    else:
        bad = BAD_HISTORIES
    assert row(bad, claim)["verdict"] == "differs"


ANGLES_DEG = (0.0, 15.0, 30.0, 45.0, 60.0)
SIDE = 21


def accuracy_map(position_peaks, orientation_peaks, wrist) -> dict[str, np.ndarray]:
    """Bumps at given (radius, height) fractions; ``wrist`` gives the configuration per cell."""
    columns, rows = np.meshgrid(np.arange(SIDE), np.arange(SIDE))
    parts = []
    for angle, position, orientation in zip(
        ANGLES_DEG, position_peaks, orientation_peaks, strict=True
    ):
        flip = wrist(columns, rows)
        names = np.where(flip, "X+ Y+ Z+, front-up-flip", "X+ Y+ Z+, front-up-noflip")
        parts.append(
            {
                "slice_deg": np.full(SIDE * SIDE, angle),
                "radius_mm": columns.ravel() * 25.0,
                "height_mm": rows.ravel() * 25.0,
                "position_max_mm": bump(columns, rows, position).ravel(),
                "orientation_max_mrad": (bump(columns, rows, orientation) - 0.5 * flip).ravel(),
                "worst_branch": names.ravel().astype(object),
                "orientation_worst_branch": names.ravel().astype(object),
                "solutions": np.full(SIDE * SIDE, 18),
            }
        )
    return {"accuracy_map": {k: np.concatenate([p[k] for p in parts]) for k in parts[0]}}


def bump(columns, rows, peak):
    distance = np.hypot(columns / (SIDE - 1) - peak[0], rows / (SIDE - 1) - peak[1])
    return 1.0 + np.exp(-((distance / 0.2) ** 2))


OUTER = [(0.8, 0.5), (0.3, 0.8), (0.7, 0.3), (0.2, 0.3), (0.8, 0.6)]
SPREAD = [(0.2, 0.7), (0.8, 0.8), (0.5, 0.9), (0.8, 0.2), (0.5, 0.5)]
# Jumps of the map sit at the edges of the flipped wrist's stripe, where these peaks are as well.
EDGE = [(0.7, 0.4), (0.7, 0.5), (0.7, 0.45), (0.7, 0.6), (0.7, 0.3)]


def nowhere(columns, rows):
    return np.zeros_like(columns, dtype=bool)


def in_stripe(columns, rows):
    return (columns >= 7) & (columns < 14)


def test_map_sentences_agree_on_maps_like_the_papers():
    tables = accuracy_map(OUTER, SPREAD, in_stripe)
    for claim in (
        "map_nonlinear",
        "map_position_outer_reaches",
        "map_position_less_predictable_inside",
        "map_discontinuities_at_wrist_changes",
    ):
        assert row(tables, claim)["verdict"] == "agrees", claim
    near = accuracy_map(OUTER, EDGE, in_stripe)
    assert row(near, "map_orientation_near_discontinuities")["verdict"] == "agrees"
    unpredictable = accuracy_map([(0.3 + 0.1 * i, 0.5) for i in range(5)], SPREAD, nowhere)
    assert row(unpredictable, "map_orientation_less_predictable")["verdict"] == "agrees"
    assert row(unpredictable, "map_largest_changes_location")["verdict"] == "agrees"


def test_map_sentences_differ_on_maps_unlike_the_papers():
    same = [(0.5, 0.5)] * 5
    never = accuracy_map(same, same, nowhere)
    for claim in (
        "map_largest_changes_location",
        "map_position_outer_reaches",
        "map_discontinuities_at_wrist_changes",
    ):
        assert row(never, claim)["verdict"] == "differs", claim
    inner = [(0.9, 0.1), (0.5, 0.5), (0.5, 0.5), (0.5, 0.5), (0.9, 0.9)]
    assert (
        row(accuracy_map(inner, same, in_stripe), "map_position_less_predictable_inside")["verdict"]
        == "differs"
    )
    assert (
        row(accuracy_map(inner, same, in_stripe), "map_orientation_less_predictable")["verdict"]
        == "differs"
    )
    far = accuracy_map(OUTER, [(1.0, 0.8)] * 5, in_stripe)
    assert row(far, "map_orientation_near_discontinuities")["verdict"] == "differs"
    plane = far["accuracy_map"]["radius_mm"] * 1e-3
    far["accuracy_map"]["position_max_mm"] = plane
    assert row(far, "map_nonlinear")["verdict"] == "differs"


def test_missing_evidence_is_not_comparable_and_never_a_crash():
    assert set(evaluate({}, paper_arm=True)["verdict"]) == {"not comparable"}

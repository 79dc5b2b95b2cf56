"""Claims: each can agree and each can differ, and only its evidence decides."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from kinacc.study.claims import all_claims, evaluate
from kinacc.study.claims.claim import verdict
from kinacc.study.claims.evaluate import values_of
from kinacc.study.histories import KEPT, LARGER, REJECTED
from kinacc.synthetic.draw import TABLE_II

NOISE_MM = np.arange(0.05, 0.301, 0.05)
TRUTH_MM = 0.9
CLAIMS = {claim.id: claim for claim in all_claims()}
# As in the paper, by assessor: the mean, and how far the smallest and the largest are from it.
CURVES = {
    "maximum": (TRUTH_MM + 2.0 * NOISE_MM, -0.5 * NOISE_MM, 1.5 * NOISE_MM),
    "outlier_rejection": (TRUTH_MM - 0.2 + 1.2 * NOISE_MM, -0.5 * NOISE_MM, 0.5 * NOISE_MM),
    "model_invalidation": (TRUTH_MM + 0.02 - 0.05 * NOISE_MM, -0.8 * NOISE_MM, 0.8 * NOISE_MM),
}


def judged(tables, claim: str) -> str:
    return verdict(CLAIMS[claim], values_of(tables)[claim])


def summary(changed: str = "", *changes) -> dict[str, pd.DataFrame]:
    """The paper's study_summary, where mean, min and max of one assessor are changed by so much."""
    parts = []
    for name, (mean, low, high) in CURVES.items():
        curves = zip((mean, mean + low, mean + high), changes or (0, 0, 0), strict=True)
        lines = [line + change if name == changed else line for line, change in curves]
        columns = dict(zip(("mean_mm", "min_mm", "max_mm"), lines, strict=True))
        parts.append(pd.DataFrame({"assessor": name, "noise_mm": NOISE_MM, **columns}))
    table = pd.concat(parts)
    return {"study_summary": table.assign(bias_mm=table["mean_mm"] - TRUTH_MM)}


SLOPE, FALLING = 4.0 * (NOISE_MM - NOISE_MM.mean()), NOISE_MM[::-1] - NOISE_MM
BREAKING = {
    "all_affected_by_noise": ("model_invalidation", 1.5 * NOISE_MM, 0, 0),
    "maximum_overestimates": ("maximum", -0.2, -0.2, -0.2),
    "maximum_much_larger": ("maximum", -0.3, -0.3, -0.3),
    "maximum_grows_with_noise": ("maximum", 2.0 * FALLING, 0, 0),
    "maximum_skewed_upward": ("maximum", 0, -NOISE_MM, -NOISE_MM),
    "outlier_rejection_grows_with_noise": ("outlier_rejection", 1.2 * FALLING, 0, 0),
    "outlier_rejection_below_at_low_noise": ("outlier_rejection", 0.2, 0, 0),
    "outlier_rejection_above_at_high_noise": ("outlier_rejection", -0.4, 0, 0),
    "outlier_rejection_smaller_spread": ("outlier_rejection", 0, -8.5 * NOISE_MM, 8.5 * NOISE_MM),
    "outlier_rejection_more_even": ("outlier_rejection", 0, 0.49 * NOISE_MM, 0),
    "outlier_rejection_equally_bad": ("outlier_rejection", 0.2 - 1.2 * NOISE_MM, 0, 0),
    "model_invalidation_varies_least": ("model_invalidation", SLOPE, 0, 0),
    "model_invalidation_even_spread": ("model_invalidation", 0, 0, 0.8 * NOISE_MM),
    "model_invalidation_larger_spread": (
        "model_invalidation", 0, 0.7 * NOISE_MM, -0.7 * NOISE_MM
    ),
    "model_invalidation_performs_well": ("model_invalidation", -0.5, 0, 0),
    "model_invalidation_less_sensitive": ("model_invalidation", SLOPE, 0, 0),
}  # fmt: skip


def of_evidence(name: str) -> list[str]:
    return [claim.id for claim in CLAIMS.values() if claim.evidence == name]


@pytest.mark.parametrize("claim", of_evidence("study_summary"))
def test_a_study_sentence_agrees_on_the_papers_curves_and_differs_where_one_breaks_it(claim):
    assert judged(summary(), claim) == "agrees"
    assert judged(summary(*BREAKING[claim]), claim) == "differs"


def test_few_points_near_the_limit_counts_points():
    errors = np.full(200, 0.5)
    errors[:9] = 0.89
    errors[0] = 0.9
    few = {"assessment_points": {"true_error_mm": errors}}
    assert values_of(few)["few_points_near_limit"] == pytest.approx(9 / 200)
    assert judged(few, "few_points_near_limit") == "agrees"
    errors[:11] = 0.89
    assert judged(few, "few_points_near_limit") == "differs"


def dh_model() -> dict[str, np.ndarray]:
    return {"joint": np.arange(1, 7)} | {
        name: getattr(TABLE_II, name).copy()
        for name in ("theta_offset_rad", "d_mm", "a_mm", "alpha_rad")
    }


def test_table_2_angles_are_compared_modulo_a_turn():
    table = dh_model()
    table["theta_offset_rad"] = table["theta_offset_rad"] + 2.0 * math.pi
    assert judged({"dh_model": table}, "table2_theta_offset_4") == "agrees"
    table["theta_offset_rad"][3] += 0.0031
    assert judged({"dh_model": table}, "table2_theta_offset_4") == "differs"


def test_antiparallel_lengths_are_judged_by_their_difference_alone():
    table = dh_model()
    table["d_mm"] = table["d_mm"] + np.array([0, 100.0, 100.0, 0, 0, 0])
    assert judged({"dh_model": table}, "table2_d_2") == "not comparable"
    assert judged({"dh_model": table}, "table2_d_2_minus_d_3") == "agrees"
    table["d_mm"][1] += 1.01
    assert judged({"dh_model": table}, "table2_d_2_minus_d_3") == "differs"


def history(example: str, true_mm, probability, eta_mm: float, repeat=None, point=None):
    numbers = range(len(true_mm))
    rows = {"true_mm": true_mm, "averaged_mm": true_mm, "rejection_probability": probability}
    rows |= {"point": point or numbers, "repeat": repeat or 1, "iteration": numbers}
    return pd.DataFrame(rows | {"example": example, "alpha": 0.6, "eta_mm": eta_mm})


def joined(*parts):
    return {"histories": pd.concat(parts, ignore_index=True)}


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


@pytest.mark.parametrize("claim", of_evidence("histories"))
def test_history_sentence_agrees_and_differs(claim):
    assert judged(GOOD_HISTORIES, claim) == "agrees"
    if claim == "fig5_few_true_errors_above":  # its bound must lie below the errors it counts
        bad = joined(history(REJECTED, [0.85, 0.85, 0.9], [0.1, 0.1, 0.7], 0.8))
    elif claim == "fig5_approaches_alpha":
        bad = joined(history(REJECTED, [0.1] * 60, [0.1] * 50 + [0.6] * 10, 0.8))
    else:
        bad = BAD_HISTORIES
    assert judged(bad, claim) == "differs"


ANGLES_DEG = (0.0, 15.0, 30.0, 45.0, 60.0)
SIDE = 21


def accuracy_map(position_peaks, orientation_peaks, wrist) -> dict[str, np.ndarray]:
    """Bumps at given (radius, height) fractions; ``wrist`` gives the configuration per cell."""
    columns, rows = np.meshgrid(np.arange(SIDE), np.arange(SIDE))
    flip = wrist(columns, rows)
    names = np.where(flip, "X+ Y+ Z+, front-up-flip", "X+ Y+ Z+, front-up-noflip").astype(object)
    position = [bump(columns, rows, peak) for peak in position_peaks]
    orientation = [bump(columns, rows, peak) - 0.5 * flip for peak in orientation_peaks]
    slices = {
        "radius_mm": [columns * 25.0] * 5,
        "height_mm": [rows * 25.0] * 5,
        "position_max_mm": position,
        "orientation_max_mrad": orientation,
        "worst_branch": [names] * 5,
        "orientation_worst_branch": [names] * 5,
    }
    cells = {name: np.ravel(values) for name, values in slices.items()}
    cells["slice_deg"] = np.repeat(ANGLES_DEG, SIDE * SIDE)
    return {"accuracy_map": cells | {"solutions": np.full(5 * SIDE * SIDE, 18)}}


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
        assert judged(tables, claim) == "agrees", claim
    near = accuracy_map(OUTER, EDGE, in_stripe)
    assert judged(near, "map_orientation_near_discontinuities") == "agrees"
    unpredictable = accuracy_map([(0.3 + 0.1 * i, 0.5) for i in range(5)], SPREAD, nowhere)
    assert judged(unpredictable, "map_orientation_less_predictable") == "agrees"
    assert judged(unpredictable, "map_largest_changes_location") == "agrees"


def test_map_sentences_differ_on_maps_unlike_the_papers():
    same = [(0.5, 0.5)] * 5
    never = accuracy_map(same, same, nowhere)
    for claim in (
        "map_largest_changes_location",
        "map_position_outer_reaches",
        "map_discontinuities_at_wrist_changes",
    ):
        assert judged(never, claim) == "differs", claim
    inner = [(0.9, 0.1), (0.5, 0.5), (0.5, 0.5), (0.5, 0.5), (0.9, 0.9)]
    outwards = accuracy_map(inner, same, in_stripe)
    assert judged(outwards, "map_position_less_predictable_inside") == "differs"
    assert judged(outwards, "map_orientation_less_predictable") == "differs"
    far = accuracy_map(OUTER, [(1.0, 0.8)] * 5, in_stripe)
    assert judged(far, "map_orientation_near_discontinuities") == "differs"
    plane = far["accuracy_map"]["radius_mm"] * 1e-3
    far["accuracy_map"]["position_max_mm"] = plane
    assert judged(far, "map_nonlinear") == "differs"


@pytest.mark.parametrize("angle", [0.0, 15.0])
def test_a_map_of_one_slice_cannot_be_compared_with_sentences_on_others(angle):
    whole = accuracy_map(OUTER, SPREAD, in_stripe)["accuracy_map"]
    here = whole["slice_deg"] == angle
    slice_ = {"accuracy_map": {name: values[here] for name, values in whole.items()}}
    for claim in ("map_largest_changes_location", "map_position_less_predictable_inside"):
        assert judged(slice_, claim) == "not comparable", claim
    assert judged(slice_, "map_discontinuities_at_wrist_changes") == "agrees"


def test_missing_evidence_is_not_comparable_and_never_a_crash():
    assert set(evaluate({}, paper_arm=True)["verdict"]) == {"not comparable"}

"""Every table kinacc leaves behind, as data: columns, units, meaning, limits and row keys.

Import costs nothing but the standard library: the configuration, the stages, the documentation and
the check of a finished results folder all read this one description.

A column named with an asterisk (``q*``) stands for one column per joint: ``q1`` .. ``qk``.
A value that does not apply is null, never zero.
"""

from __future__ import annotations

import math

from kinacc.artifacts.allowed import (
    ASSESSOR_PATTERN,
    COMPARISONS,
    COVARIANCES,
    DISTANCES,
    ERRORS,
    ESTIMATES,
    EXAMPLES,
    IDENTIFIER_PATTERN,
    MODELS,
    OUTLIER_RULES,
    QUANTITIES,
    SEARCHES,
    SUBSETS,
    UNITS_OF_RESIDUALS,
    VERDICTS,
)
from kinacc.artifacts.columns import Artefact, Column, real, text, whole

PROVENANCE_KEYS = ("kinacc_version", "config_hash", "code_hash", "inputs_hash", "seed")
JOINTS_MIN, JOINTS_MAX = 4, 7


def _length(name: str, meaning: str, limit: float, nullable=False) -> Column:
    return real(name, "mm", meaning, -limit, limit, nullable)


def _magnitude(name: str, unit: str, meaning: str, high: float, nullable=False) -> Column:
    return real(name, unit, meaning, 0.0, high, nullable)


_REACH_MM = 1.0e5  # no laser tracker sees further than 100 m
_ERROR_MM = 1.0e3
_ERROR_MRAD = 4.0e3  # beyond half a turn, pi rad, an orientation error has no meaning
_TURN_RAD = 4.0 * math.pi

_JOINTS = (
    real("q*", "rad", "reported position of each joint", -_TURN_RAD, _TURN_RAD),
    Column(
        "s*",
        "int8",
        "1",
        "travel direction of each joint on arrival: -1, +1, or 0 where unknown",
        choices=(-1, 0, 1),
    ),
)


def _position(of: str, nullable: bool = False) -> tuple[Column, ...]:
    return tuple(
        _length(f"{axis}_mm", f"{axis} coordinate of {of}", _REACH_MM, nullable) for axis in "xyz"
    )


def _quaternion(of: str, nullable: bool = False) -> tuple[Column, ...]:
    return tuple(
        real(f"q{part}", "1", f"{part} of the unit quaternion of {of}, w >= 0", -1, 1, nullable)
        for part in "wxyz"
    )


def _error_vector(of: str) -> tuple[Column, ...]:
    return tuple(
        _length(f"e{axis}_mm", f"{axis} component of {of}, robot base frame", _ERROR_MM)
        for axis in "xyz"
    )


_DH_PARAMETERS = (
    ("theta_offset_rad", "rad", "joint angle offset theta", _TURN_RAD),
    ("d_mm", "mm", "offset d along the joint axis", 2.0e4),
    ("a_mm", "mm", "length a along the common normal", 2.0e4),
    ("alpha_rad", "rad", "twist alpha about the common normal", _TURN_RAD),
    ("beta_rad", "rad", "Hayati twist beta about y, 0 where the joint has none", _TURN_RAD),
)
_DH = tuple(
    real(name, unit, f"{meaning} (nominal)", -limit, limit)
    for name, unit, meaning, limit in _DH_PARAMETERS
)
_DH_FITTED = tuple(
    real(name, unit, meaning, -limit, limit) for name, unit, meaning, limit in _DH_PARAMETERS
)
_DH_STD = tuple(
    _magnitude(
        f"std_{name}", unit, f"standard deviation of {name}, null if undetermined", 1e4, True
    )
    for name, unit, _, _ in _DH_PARAMETERS
)

_FRAME_COLUMNS = (
    text("model", "model the frame belongs to", MODELS),
    text(
        "frame",
        "base (robot base in the instrument's frame), tool (tool centre point in the flange frame) "
        "or the name of a target (in the flange frame)",
    ),
    *_position("the frame's origin"),
    *_quaternion("the frame's orientation"),
)

_FIT_COLUMNS = (
    text("quantity", "what the row states, e.g. rank, singular_value", pattern=IDENTIFIER_PATTERN),
    whole(
        "number",
        "running number within the quantity, from 1; null for a single value",
        1,
        None,
        True,
    ),
    text("parameter", "parameter the row speaks of; null where none", nullable=True),
    real("value", "see unit", "the value", nullable=True),
    text("unit", "unit of the value; 1 for a pure number"),
)

_SWITCHES = (
    text(
        "outlier_rule",
        "rule for the cut c of eq. 14; null where it does not apply",
        OUTLIER_RULES,
        nullable=True,
    ),
    text(
        "distance",
        "what eq. 18 integrates up to; null where it does not apply",
        DISTANCES,
        nullable=True,
    ),
    text(
        "covariance", "divisor of eq. 24; null where it does not apply", COVARIANCES, nullable=True
    ),
    text(
        "search",
        "how the smallest bound not rejected is searched; null where it does not apply",
        SEARCHES,
        nullable=True,
    ),
)
_ASSESSOR = text("assessor", "method of assessment", pattern=ASSESSOR_PATTERN)
_NOISE = _magnitude("noise_mm", "mm", "standard deviation of the noise per axis", 10.0)
_ASSESSMENT = (
    _magnitude("assessed_mm", "mm", "assessed accuracy", _ERROR_MM),
    whole("measurements", "measurements spent", 1),
    whole("points_visited", "distinct operating points measured", 1),
    _magnitude("lower_mm", "mm", "lower bound the assessor states", _ERROR_MM, True),
    _magnitude("upper_mm", "mm", "upper bound the assessor states", _ERROR_MM, True),
)
_SUMMARY = (
    _magnitude("mean_mm", "mm", "mean assessed accuracy over the repetitions", _ERROR_MM),
    _magnitude("min_mm", "mm", "smallest assessed accuracy over the repetitions", _ERROR_MM),
    _magnitude("max_mm", "mm", "largest assessed accuracy over the repetitions", _ERROR_MM),
    _length("bias_mm", "mean assessed minus true accuracy", _ERROR_MM),
)

MEASUREMENTS = Artefact(
    "measurements",
    "Measured poses, one row per reading of one target.",
    (
        whole("pose", "number of the joint configuration"),
        *_JOINTS,
        text("target", "name of the measured target"),
        *_position("the target in the instrument's frame"),
        *_quaternion("the target in the instrument's frame, null for position only", True),
        whole("repeat", "number of the reading at this configuration and target"),
        text("subset", "train (used by the delivered fits) or validation (held out)", SUBSETS),
        whole("fold", "fold in which the row is held out; null without folds", nullable=True),
    ),
    ("pose", "target", "repeat"),
)
VEC_MODEL = Artefact(
    "vec_model",
    "Volumetric error compensation model: Chebyshev coefficients over the nominal DH.",
    (
        whole("joint", "joint number, from 1", 1, JOINTS_MAX),
        text("error", "element of the error matrix of eq. 6", ERRORS),
        whole(
            "direction",
            "0 = both directions; -1 or +1 = offset added when the joint travels that way",
            None,
            None,
            choices=(-1, 0, 1),
        ),
        whole("order", "order of the Chebyshev polynomial, first kind", 0, 40),
        real(
            "coefficient", "mm for delta, rad for eps", "coefficient of the polynomial", -1e3, 1e3
        ),
        _magnitude(
            "std", "mm for delta, rad for eps", "standard deviation of the coefficient", 1e4, True
        ),
        real("q_min_rad", "rad", "joint position mapped to -1", -_TURN_RAD, _TURN_RAD),
        real("q_max_rad", "rad", "joint position mapped to +1", -_TURN_RAD, _TURN_RAD),
        *_DH,
    ),
    ("joint", "error", "direction", "order"),
)
DH_MODEL = Artefact(
    "dh_model",
    "Fitted DH model, T = Rz(q + theta) Tz(d) Tx(a) Rx(alpha) Ry(beta) per joint.",
    (whole("joint", "joint number, from 1", 1, JOINTS_MAX), *_DH_FITTED, *_DH_STD),
    ("joint",),
)
VEC_FRAMES = Artefact(
    "vec_frames", "Frames estimated with the VEC model.", _FRAME_COLUMNS, ("model", "frame")
)
FRAMES = Artefact("frames", "Frames of every model.", _FRAME_COLUMNS, ("model", "frame"))
VEC_FIT = Artefact(
    "vec_fit",
    "How the VEC fit went: rank, singular values, prior, iterations, parameters.",
    _FIT_COLUMNS,
    ("quantity", "number", "parameter"),
)
DH_FIT = Artefact(
    "dh_fit",
    "How the DH fit went: rank, singular values, truncation, iterations, parameters.",
    _FIT_COLUMNS,
    ("quantity", "number", "parameter"),
)
POSE_ERRORS = Artefact(
    "pose_errors",
    "Error vectors pose by pose, of the delivered models and of the cross-validated ones.",
    (
        text("comparison", "what is compared with what", COMPARISONS),
        text(
            "estimate",
            "train (delivered models) or cross_validated (the row was held out)",
            ESTIMATES,
        ),
        whole("row", "row of measurements.parquet, from 0"),
        whole("pose", "number of the joint configuration"),
        text("target", "name of the measured target"),
        whole("repeat", "number of the reading"),
        text("subset", "train or validation, as in measurements", SUBSETS),
        whole("fold", "fold in which the row is held out; null without folds", nullable=True),
        *_error_vector("the position error"),
        *(
            real(
                f"r{axis}_mrad",
                "mrad",
                f"{axis} of the orientation error as a rotation vector, null for position only",
                -_ERROR_MRAD,
                _ERROR_MRAD,
                True,
            )
            for axis in "xyz"
        ),
    ),
    ("comparison", "estimate", "row"),
)
RESIDUALS = Artefact(
    "residuals",
    "Residual statistics: Table I (vec_vs_measured), Table III (dh_vs_vec) and the like.",
    (
        text("comparison", "what is compared with what", COMPARISONS),
        text("subset", "train or validation", SUBSETS),
        whole("fold", "held-out fold; null = pooled over folds, or no folds", nullable=True),
        text("quantity", "position or orientation", QUANTITIES),
        text("unit", "unit of the statistics", UNITS_OF_RESIDUALS),
        whole("n", "number of target points", 1),
        _magnitude("mean", "see unit", "mean magnitude", 1e4),
        _magnitude("max", "see unit", "largest magnitude", 1e4),
        _magnitude("rms", "see unit", "root mean square of the magnitude", 1e4),
        _magnitude(
            "gamma99", "see unit", "99 % quantile of a fitted gamma distribution", 1e5, True
        ),
    ),
    ("comparison", "subset", "fold", "quantity"),
)
ACCURACY_MAP = Artefact(
    "accuracy_map",
    "Largest error per cell of the evaluation space over orientations and branches (Fig. 3).",
    (
        real("slice_deg", "deg", "angle of the radial slice", -360, 360),
        _magnitude("radius_mm", "mm", "distance from the robot's first axis", 2.0e4),
        _length("height_mm", "height in the robot base frame", 2.0e4),
        _magnitude(
            "position_max_mm", "mm", "largest position error, null if unreachable", _ERROR_MM, True
        ),
        _magnitude(
            "orientation_max_mrad",
            "mrad",
            "largest orientation error, null if unreachable",
            _ERROR_MRAD,
            True,
        ),
        text(
            "worst_branch",
            "orientation, inverse branch of the largest position error, null if unreachable",
            nullable=True,
        ),
        text(
            "orientation_worst_branch",
            "orientation, inverse branch of the largest orientation error, null if unreachable",
            nullable=True,
        ),
        whole("solutions", "orientation x branch combinations reached, 0 if unreachable"),
        whole("wanted", "orientation x branch combinations tried", 1),
        whole("extrapolating", "combinations left out: reached, but outside the VEC's range"),
    ),
    ("slice_deg", "radius_mm", "height_mm"),
)
ASSESSMENT_POINTS = Artefact(
    "assessment_points",
    "Operating points of the study with their true errors.",
    (
        whole("point", "number of the operating point, from 0"),
        *_JOINTS,
        *_error_vector("VEC minus DH position of the tool (measured minus DH on measured data)"),
        _magnitude("true_error_mm", "mm", "magnitude of the error vector", _ERROR_MM),
    ),
    ("point",),
)
STUDY_CHUNK = Artefact(
    "study_chunk",
    "One part of the Monte Carlo study: every assessor under every reading.",
    (
        _NOISE,
        whole("repetition", "number of the simulation, from 0"),
        _ASSESSOR,
        *_SWITCHES,
        *_ASSESSMENT,
    ),
    ("noise_mm", "repetition", "assessor", "outlier_rule", "distance", "covariance", "search"),
)
STUDY = Artefact(
    "study",
    "Monte Carlo study of the assessors, default reading.",
    (
        _NOISE,
        whole("repetition", "number of the simulation, from 0"),
        _ASSESSOR,
        *_ASSESSMENT,
    ),
    ("noise_mm", "repetition", "assessor"),
)
STUDY_SUMMARY = Artefact(
    "study_summary",
    "The study per assessor and noise (Fig. 4), default reading.",
    (
        _ASSESSOR,
        _NOISE,
        *_SUMMARY,
        _magnitude("rmse_mm", "mm", "root mean square of assessed minus true accuracy", _ERROR_MM),
        whole("repetitions", "number of simulations", 1),
    ),
    ("assessor", "noise_mm"),
)
READINGS = Artefact(
    "readings",
    "Ablation: the study under every reading of the paper.",
    (_ASSESSOR, *_SWITCHES, _NOISE, *_SUMMARY),
    ("assessor", "outlier_rule", "distance", "covariance", "search", "noise_mm"),
)
HISTORIES = Artefact(
    "histories",
    "Model invalidation, iteration by iteration (Figs. 5 and 6).",
    (
        text("example", "which history: rejected (Fig. 5), not_rejected (Fig. 6), ...", EXAMPLES),
        whole("simulation", "number of the simulation shown, the repetition of the study"),
        text("rule", "what the simulation was chosen by"),
        whole("rule_met", "1 if the example's rule is met, 0 if the nearest thing is shown", 0, 1),
        _NOISE,
        _magnitude("alpha", "1", "threshold on the rejection probability", 1.0),
        text("distance", "what eq. 18 integrates up to", DISTANCES),
        text("covariance", "divisor of eq. 24", COVARIANCES),
        whole("iteration", "number of the measurement, from 1", 1),
        whole("point", "operating point measured, as in assessment_points"),
        whole("repeat", "number of the measurement at this point, from 1", 1),
        _magnitude("eta_mm", "mm", "accuracy bound under test", _ERROR_MM),
        _magnitude("measured_mm", "mm", "magnitude of the single measured error", _ERROR_MM),
        _magnitude(
            "averaged_mm", "mm", "magnitude of the average over the point's repeats", _ERROR_MM
        ),
        _magnitude("true_mm", "mm", "magnitude of the point's true error", _ERROR_MM),
        _magnitude(
            "rejection_probability", "1", "rejection probability after the measurement", 1.0
        ),
    ),
    ("example", "iteration"),
)
CLAIMS = Artefact(
    "claims",
    "The paper's numbers and sentences, each recomputed.",
    (
        text("claim", "identifier of the claim", pattern=IDENTIFIER_PATTERN),
        text("statement", "what the paper says"),
        text("statistic", "what was computed, in words"),
        text("evidence", "artefact it is computed from"),
        real(
            "paper",
            "see statement",
            "the paper's number, null where a sentence has none",
            nullable=True,
        ),
        real(
            "reproduced",
            "see statement",
            "the reproduced number, null where there is none",
            nullable=True,
        ),
        real(
            "tolerance",
            "see statement",
            "largest difference that agrees, null where there is none",
            nullable=True,
        ),
        text("verdict", "agrees, differs or not comparable", VERDICTS),
        _magnitude(
            "share", "1", "share of further accepted draws of the arm for which it holds", 1.0, True
        ),
    ),
    ("claim",),
)
ROBUSTNESS = Artefact(
    "robustness",
    "Every claim on further accepted draws of the synthetic arm.",
    (
        whole("draw", "number of the accepted draw"),
        text("claim", "identifier of the claim", pattern=IDENTIFIER_PATTERN),
        real(
            "reproduced",
            "see claims",
            "the reproduced number, null where there is none",
            nullable=True,
        ),
        text("verdict", "agrees, differs or not comparable", VERDICTS),
    ),
    ("draw", "claim"),
)

ARTEFACTS: dict[str, Artefact] = {
    artefact.name: artefact
    for artefact in (
        MEASUREMENTS,
        VEC_MODEL,
        VEC_FRAMES,
        VEC_FIT,
        DH_MODEL,
        FRAMES,
        DH_FIT,
        RESIDUALS,
        POSE_ERRORS,
        ACCURACY_MAP,
        ASSESSMENT_POINTS,
        STUDY_CHUNK,
        STUDY,
        STUDY_SUMMARY,
        READINGS,
        HISTORIES,
        CLAIMS,
        ROBUSTNESS,
    )
}

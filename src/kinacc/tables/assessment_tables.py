"""Contract of the tables from the accuracy map to the claims."""

from __future__ import annotations

from dataclasses import replace

from kinacc.tables.allowed import (
    ASSESSOR_PATTERN,
    COVARIANCES,
    DISTANCES,
    EXAMPLES,
    IDENTIFIER_PATTERN,
    OUTLIER_RULES,
    SEARCHES,
    VERDICTS,
)
from kinacc.tables.columns import (
    ERROR_MM,
    ERROR_MRAD,
    JOINTS,
    SLIDES,
    Artefact,
    Column,
    absent_if_unstated,
    error_vector,
    length,
    magnitude,
    real,
    text,
    whole,
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
_NOISE = magnitude("noise_mm", "mm", "standard deviation of the noise per axis", 10.0)
_ASSESSMENT = (
    magnitude("assessed_mm", "mm", "assessed accuracy", ERROR_MM),
    whole("measurements", "measurements spent", 1),
    whole("points_visited", "distinct operating points measured", 1),
    magnitude("lower_mm", "mm", "lower bound the assessor states", ERROR_MM, True),
    magnitude("upper_mm", "mm", "upper bound the assessor states", ERROR_MM, True),
)
_SUMMARY = (
    magnitude("mean_mm", "mm", "mean assessed accuracy over the repetitions", ERROR_MM),
    magnitude("min_mm", "mm", "smallest assessed accuracy over the repetitions", ERROR_MM),
    magnitude("max_mm", "mm", "largest assessed accuracy over the repetitions", ERROR_MM),
    length("bias_mm", "mean assessed minus true accuracy", ERROR_MM),
)
ACCURACY_MAP = Artefact(
    "accuracy_map",
    "Largest error per cell of the evaluation space over orientations and branches (Fig. 3).",
    (
        real("slice_deg", "deg", "angle of the radial slice", -360, 360),
        magnitude("radius_mm", "mm", "distance from the robot's first axis", 2.0e4),
        length("height_mm", "height in the robot base frame", 2.0e4),
        magnitude(
            "position_max_mm", "mm", "largest position error, null if unreachable", ERROR_MM, True
        ),
        magnitude(
            "orientation_max_mrad",
            "mrad",
            "largest orientation error, null if unreachable",
            ERROR_MRAD,
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
        replace(
            JOINTS[0],
            nullable=True,
            meaning="reported position of each joint at the largest position error, "
            f"{SLIDES}, null if unreachable",
        ),
    ),
    ("slice_deg", "radius_mm", "height_mm"),
)
ASSESSMENT_POINTS = Artefact(
    "assessment_points",
    "Operating points of the study with their operating-point errors.",
    (
        whole("point", "number of the operating point, from 0"),
        *JOINTS,
        *error_vector("VEC minus DH position of the tool (measured minus DH on measured data)"),
        magnitude(
            "true_error_mm",
            "mm",
            "operating-point error, the magnitude of the vector; the study takes it as the truth",
            ERROR_MM,
        ),
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
        magnitude("rmse_mm", "mm", "root mean square of assessed minus true accuracy", ERROR_MM),
        whole("repetitions", "number of simulations", 1),
        *absent_if_unstated(
            magnitude("std_error_mm", "mm", "standard error of mean_mm and bias_mm", ERROR_MM)
        ),
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
        magnitude("alpha", "1", "threshold on the rejection probability", 1.0),
        text("distance", "what eq. 18 integrates up to", DISTANCES),
        text("covariance", "divisor of eq. 24", COVARIANCES),
        whole("iteration", "number of the measurement, from 1", 1),
        whole("point", "operating point measured, as in assessment_points"),
        whole("repeat", "number of the measurement at this point, from 1", 1),
        magnitude("eta_mm", "mm", "accuracy bound under test", ERROR_MM),
        magnitude("measured_mm", "mm", "magnitude of the single measured error", ERROR_MM),
        magnitude(
            "averaged_mm", "mm", "magnitude of the average over the point's repeats", ERROR_MM
        ),
        magnitude("true_mm", "mm", "magnitude of the point's true error", ERROR_MM),
        magnitude("rejection_probability", "1", "rejection probability after the measurement", 1.0),
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
        magnitude(
            "share", "1", "share of further accepted draws of the arm for which it holds", 1.0, True
        ),
        Column(
            "used_to_choose",
            "bool",
            "1",
            "whether the sentence chose a reading of the paper, and is no evidence",
        ),
    ),
    ("claim",),
)
_DRAWS = (
    whole("draw", "number of the accepted draw"),
    text("claim", "identifier of the claim", pattern=IDENTIFIER_PATTERN),
    real("reproduced", "see claims", "the reproduced number, null without one", nullable=True),
    text("verdict", "agrees, differs or not comparable", VERDICTS),
)
ROBUSTNESS_CHUNK = Artefact(
    "robustness_chunk", "Every claim on some of the further draws.", _DRAWS, ("draw", "claim")
)
ROBUSTNESS = Artefact(
    "robustness",
    "Every claim on further accepted draws of the synthetic arm.",
    _DRAWS,
    ("draw", "claim"),
)
ALL = (
    ACCURACY_MAP,
    ASSESSMENT_POINTS,
    STUDY_CHUNK,
    STUDY,
    STUDY_SUMMARY,
    READINGS,
    HISTORIES,
    CLAIMS,
    ROBUSTNESS_CHUNK,
    ROBUSTNESS,
)

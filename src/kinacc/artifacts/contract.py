"""Every table kinacc leaves behind, as data: columns, units, meaning, limits and row keys.

Import costs nothing but the standard library: the configuration, the stages, the documentation and
the check of a finished results folder all read this one description.

A column named with an asterisk (``q*``) stands for one column per joint: ``q1`` .. ``qk``.
A value that does not apply is null, never zero. After a change run
``python tools/document_artifacts.py``, which rewrites docs/artifacts.md.
"""

from __future__ import annotations

from kinacc.artifacts import (
    assessment_tables,
    calibration_tables,
    campaign_tables,
    covariance_tables,
    data_check_tables,
    model_comparison_tables,
    robot_table,
    tournament_tables,
)
from kinacc.artifacts.columns import Artefact

PROVENANCE_KEYS = ("kinacc_version", "config_hash", "code_hash", "inputs_hash", "seed")

ARTEFACTS: dict[str, Artefact] = {
    artefact.name: artefact
    for artefact in (
        calibration_tables.MEASUREMENTS,
        robot_table.ROBOT,
        data_check_tables.DATA_CHECK,
        calibration_tables.VEC_MODEL,
        calibration_tables.VEC_FRAMES,
        calibration_tables.VEC_FIT,
        calibration_tables.VEC_ORDERS,
        calibration_tables.DH_MODEL,
        calibration_tables.FRAMES,
        calibration_tables.DH_FIT,
        covariance_tables.VEC_COVARIANCE,
        covariance_tables.DH_COVARIANCE,
        covariance_tables.DH_IDENTIFIED,
        calibration_tables.RESIDUALS,
        calibration_tables.POSE_ERRORS,
        data_check_tables.EXCLUDED_ROWS,
        model_comparison_tables.MODEL_SELECTION,
        model_comparison_tables.JOINT_BIAS,
        model_comparison_tables.WORST_ROWS,
        assessment_tables.ACCURACY_MAP,
        assessment_tables.ASSESSMENT_POINTS,
        assessment_tables.STUDY_CHUNK,
        assessment_tables.STUDY,
        assessment_tables.STUDY_SUMMARY,
        assessment_tables.READINGS,
        assessment_tables.HISTORIES,
        assessment_tables.CLAIMS,
        assessment_tables.ROBUSTNESS_CHUNK,
        assessment_tables.ROBUSTNESS,
        *tournament_tables.ALL,
        *campaign_tables.ALL,
    )
}

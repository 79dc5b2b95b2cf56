"""Modules of the package in which code is changed, and how."""

from __future__ import annotations

STAGES = "kinacc.workflow.stages"
# (module, function, factor on what it returns): each moves numbers of some stages.
WRAPPED: tuple[tuple[str, str, float], ...] = (
    ("kinacc.assess.outlier_rejection", "largest_inlier", 1.001),
    ("kinacc.assess.model_invalidation", "_magnitude", 1.001),
    ("kinacc.distributions", "gamma99", 1.01),
    ("kinacc.geometry", "exp_so3", 1.00001),
    ("kinacc.geometry", "log_so3", 1.001),
    ("kinacc.geometry", "project_so3", 1.0001),
    ("kinacc.synthetic.physical", "smooth_errors", 1.001),
    ("kinacc.synthetic.physical", "gravity_torque_knm", 1.01),
    ("kinacc.synthetic.plan", "configurations", 1.0001),
    ("kinacc.kinematics.region", "levels_mm", 1.001),
    ("kinacc.kinematics.region", "_sobol", 0.999),
    ("kinacc.kinematics.vec", "_errors", 1.001),
)
# (module, table of its stage, column, factor)
SCALED: tuple[tuple[str, str, str, float], ...] = (
    (f"{STAGES}.measurements", "measurements", "z_mm", 1.000001),
    (f"{STAGES}.error_model", "dh_model", "a_mm", 1.00001),
    (f"{STAGES}.error_model", "vec_model", "coefficient", 1.01),
    (f"{STAGES}.residuals", "pose_errors", "ex_mm", 1.001),
    (f"{STAGES}.residuals", "residuals", "mean", 1.001),
    (f"{STAGES}.excluded_rows", "excluded_rows", "ey_mm", 1.001),
    (f"{STAGES}.summary", "summary", "value", 1.001),
    (f"{STAGES}.accuracy_map", "accuracy_map", "position_max_mm", 1.001),
    (f"{STAGES}.assessment_points", "assessment_points", "ez_mm", 1.001),
    (f"{STAGES}.study_chunk", "study_chunk", "assessed_mm", 1.001),
    (f"{STAGES}.study", "study_summary", "bias_mm", 1.001),
    (f"{STAGES}.histories", "histories", "measured_mm", 1.001),
    (f"{STAGES}.claims", "claims", "reproduced", 1.001),
)
# Modules that only get a remark: some of one stage, some of all; none has kernels to be compiled.
COMMENTED: tuple[str, ...] = (
    "kinacc",
    "kinacc.errors",
    "kinacc.artifacts.store",
    "kinacc.artifacts.columns",
    "kinacc.assess.world",
    "kinacc.calibration.dh_fit",
    "kinacc.calibration.vec_fit",
    "kinacc.calibration.residuals",
    "kinacc.calibration.compliance_fit",
    "kinacc.checks.noise",
    "kinacc.config.names",
    "kinacc.kinematics.robot.reader",
    "kinacc.measurements.reader",
    "kinacc.study.claims.numbers",
    "kinacc.study.histories",
    "kinacc.study.operating_points",
    "kinacc.synthetic.tracker",
    "kinacc.workflow.runner",
    f"{STAGES}.summary",
)
# (file of the package, text in it, text instead)
DATA_FILES: tuple[tuple[str, str, str], ...] = (
    ("kinematics/robots/mh180.yaml", "a_mm: 1150", "a_mm: 1150.5"),
    ("kinematics/robots/mh180.yaml", "d_mm: -1225", "d_mm: -1224.5"),
    ("synthetic/accepted_draws.csv", "323.653189", "323.753189"),
)

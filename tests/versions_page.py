"""What docs/versions.md states of floats beside 50 digits, and tests/integration_oracle holds.

``allowed`` leaves room for other kernels of BLAS: about ten times what was ``seen``.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Stated:
    """Largest difference of floats from 50 digits, and what makes it that large."""

    unit: str
    seen: float
    allowed: float
    why: str


REACH = "24 products of matrices on 2.5 m, each rounded to 1.1e-16"
SAME = "as above, twice"
MAP = "the fit ends when its next step is below 1e-6 mm; the Gram matrix squares the condition"
SVD = "condition of the directions kept: 1 / truncation = 100"
GRAM = "squares of the condition, in directions that only the prior holds"
SUMS = "sums of as many numbers"

STATED = {
    "forward kinematics, position": Stated("mm", 3.5e-13, 3e-12, REACH),
    "forward kinematics, rotation": Stated("1", 3.0e-16, 3e-15, "the same products of rotations"),
    "forward kinematics, joints that bend": Stated("mm", 7.0e-13, 6e-12, REACH),
    "vec_model: coefficient": Stated("mm or mrad", 2.8e-10, 3e-9, MAP),
    "vec_model: std": Stated("share", 4.8e-11, 5e-10, GRAM),
    "vec_covariance": Stated("share of the largest variance", 9.4e-11, 9e-10, GRAM),
    "vec_fit: cost": Stated("share", 4.1e-11, 4e-10, "slope of the cost times the coefficients'"),
    "dh_model": Stated("mm or mrad", 8.4e-12, 8e-11, SVD),
    "dh_model: std": Stated("share", 3.3e-12, 3e-11, SVD),
    "dh_fit: cost": Stated("share", 7.9e-15, 8e-14, "least at the fit: its slope is zero"),
    "dh_fit: singular_value": Stated("share of the largest", 3.4e-13, 3e-12, "BLAS"),
    "dh_model, base and tool estimated": Stated("mm or mrad", 7.1e-12, 7e-11, SVD),
    "dh_model: std, base and tool estimated": Stated("share", 8.7e-13, 9e-12, SVD),
    "dh_fit: cost, base and tool estimated": Stated("share", 9.7e-14, 1e-12, "as above"),
    "dh_fit: singular_value, base and tool estimated": Stated(
        "share of the largest", 4.3e-13, 4e-12, "base and tool projected out"
    ),
    "frames: position": Stated("mm", 5.4e-13, 5e-12, "follows the parameters"),
    "frames: rotation": Stated("1", 5.9e-15, 6e-14, "follows the parameters"),
    "pose_errors: position": Stated("mm", 5.7e-13, 5e-12, SAME),
    "pose_errors: orientation": Stated("mrad", 7.6e-13, 7e-12, SAME),
    "residuals: mean, max, rms": Stated("last places", 1.2, 8.0, SUMS),
    "residuals: gamma99": Stated("last places", 9.7, 100.0, "log mean less mean log: a difference"),
    "model_selection": Stated("mm, mm^2", 6.3e-17, 2e-15, SUMS),
    "joint_bias": Stated("mm", 6.0e-16, 6e-15, SUMS),
    "accuracy_map: position": Stated("mm", 9.8e-14, 1e-11, SAME),
    "accuracy_map: orientation": Stated("mrad", 2.3e-13, 5e-12, SAME),
    "accuracy_map: joints": Stated("rad", 4.1e-16, 1e-13, "a Newton step below 1e-6 mm squared"),
    "assessment_points": Stated("mm", 6.3e-13, 6e-12, SAME),
    "study": Stated("mm", 6.3e-17, 2e-15, "maximum and outlier rejection; bounds are equal"),
    "study_summary": Stated("mm", 1.4e-16, 2e-15, SUMS),
    "histories: sizes": Stated("mm", 2.0e-16, 2e-15, "sums of readings"),
    "histories: rejection_probability": Stated("1", 4.5e-16, 1e-14, "1 less a product"),
    "nearest point of a ball": Stated("mm", 3.5e-16, 5e-15, "Newton's steps to rounding"),
    "distance to a ball": Stated("share", 4.4e-16, 5e-14, "condition of the covariance, some 100"),
    "limits on sizes": Stated("mm", 8.1e-13, 5e-12, "bisection ends at a share of 1e-12"),
    "limits on probabilities": Stated("1", 6.3e-17, 2e-15, "scipy's own inverse"),
    "gamma quantile": Stated(
        "share", 3.6e-14, 1e-11, "shapes of 1e4, where the logarithms' difference is 5e-5"
    ),
}


def lines() -> list[str]:
    """The table of the page."""
    found = ["| what | seen | held to | unit | why so much |", "|---|---|---|---|---|"]
    for name, each in STATED.items():
        found.append(
            f"| {name} | {each.seen:.1e} | {each.allowed:.0e} | {each.unit} | {each.why} |"
        )
    return found

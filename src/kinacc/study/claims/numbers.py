"""The paper's numbers: Tables I to III and the true accuracy of the assessed points."""

from __future__ import annotations

import math

import numpy as np

from kinacc.study.claims.claim import Claim, Statistic, Tables
from kinacc.synthetic.draw import TABLE_II

RELATIVE_TOLERANCE = 0.10  # Tables I and III and the true accuracy
ANGLE_TOLERANCE_RAD = 0.003
LENGTH_TOLERANCE_MM = 1.0

_RESIDUALS = {
    "table1": ("Table I", "vec_vs_measured", "VEC model and robot"),
    "table3": ("Table III", "dh_vs_vec", "DH and VEC model"),
}
_RESIDUAL_VALUES = {
    ("table1", "position"): (0.705, 1.635, 1.731),
    ("table1", "orientation"): (1.487, 3.149, 3.248),
    ("table3", "position"): (0.405, 0.847, 0.918),
    ("table3", "orientation"): (1.336, 2.851, 2.866),
}
_STATISTICS = {"mean": "mean", "max": "maximum", "gamma99": "99 % gamma quantile"}

# Table II; theta 5 read as q5 - 3.141 (printed 3.114 would turn the wrist by 1.6 degrees).
TABLE_2 = {
    column: tuple(getattr(TABLE_II, column).tolist())
    for column in ("theta_offset_rad", "d_mm", "a_mm", "alpha_rad")
}
TRUE_ACCURACY_MM = 0.906


def number_claims() -> list[Claim]:
    """Claims on every number of Tables I to III and on the true accuracy of 0.906 mm."""
    accuracy = Claim(
        "true_accuracy",
        f"The true accuracy of the assessed subset is {TRUE_ACCURACY_MM} mm",
        f"largest true_error_mm; within {RELATIVE_TOLERANCE:.0%}",
        "assessment_points",
        lambda tables: float(np.max(tables["assessment_points"]["true_error_mm"])),
        paper=TRUE_ACCURACY_MM,
        tolerance=RELATIVE_TOLERANCE * TRUE_ACCURACY_MM,
        arm_specific=True,
    )
    return [*_residual_claims("table1"), *_table_2(), *_residual_claims("table3"), accuracy]


def _residual_claims(table: str) -> list[Claim]:
    title, comparison, between = _RESIDUALS[table]
    return [
        Claim(
            f"{table}_{quantity}_{column}",
            f"{title}: {text} of the {quantity} residual between {between} is {value} {unit}",
            f"{column} of comparison {comparison}, subset train, {quantity}; "
            f"within {RELATIVE_TOLERANCE:.0%}",
            "residuals",
            _residual(comparison, quantity, column),
            paper=value,
            tolerance=RELATIVE_TOLERANCE * value,
            arm_specific=True,
        )
        for quantity, unit in (("position", "mm"), ("orientation", "mrad"))
        for (column, text), value in zip(
            _STATISTICS.items(), _RESIDUAL_VALUES[table, quantity], strict=True
        )
    ]


def _residual(comparison: str, quantity: str, column: str) -> Statistic:
    def compute(tables: Tables) -> float:
        rows = tables["residuals"]
        chosen = np.isnan(np.asarray(rows["fold"], dtype=float))
        for name, value in (
            ("comparison", comparison),
            ("subset", "train"),
            ("quantity", quantity),
        ):
            chosen &= np.asarray(rows[name]) == value
        return float(rows[column][chosen][0]) if chosen.any() else math.nan

    return compute


def _table_2() -> list[Claim]:
    claims = []
    for column, values in TABLE_2.items():
        name, unit = column.rsplit("_", 1)
        tolerance = ANGLE_TOLERANCE_RAD if unit == "rad" else LENGTH_TOLERANCE_MM
        remark = ", as an angle modulo 2 pi" if unit == "rad" else ""
        for joint, value in enumerate(values, 1):
            statistic, paired = (
                f"{column} of joint {joint}{remark}",
                name == "d" and joint in (2, 3),
            )
            if paired:
                statistic += "; not judged alone, only d2 - d3 can be seen"
            claims.append(
                Claim(
                    f"table2_{name}_{joint}",
                    f"Table II: {name} of joint {joint} is {value} {unit}",
                    statistic,
                    "dh_model",
                    _parameter(column, joint, value),
                    paper=value,
                    tolerance=math.nan if paired else tolerance,
                    arm_specific=True,
                )
            )
    difference = round(TABLE_2["d_mm"][1] - TABLE_2["d_mm"][2], 3)
    d_2, d_3 = (_parameter("d_mm", joint, 0.0) for joint in (2, 3))
    claims.append(
        Claim(
            "table2_d_2_minus_d_3",
            f"Table II: d of joint 2 minus d of joint 3 is {difference:.3f} mm",
            "d_mm of joint 2 minus d_mm of joint 3: axes 2 and 3 are antiparallel, so "
            "only the difference can be seen",
            "dh_model",
            lambda tables: d_2(tables) - d_3(tables),
            paper=difference,
            tolerance=LENGTH_TOLERANCE_MM,
            arm_specific=True,
        )
    )
    return claims


def _parameter(column: str, joint: int, near: float) -> Statistic:
    """A DH parameter of a joint; of angles the turn nearest to ``near``."""

    def compute(tables: Tables) -> float:
        rows = tables["dh_model"]
        value = float(rows[column][np.asarray(rows["joint"]) == joint][0])
        if column.endswith("_rad"):
            value = near + math.remainder(value - near, 2.0 * math.pi)
        return value

    return compute

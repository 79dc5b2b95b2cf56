"""Figures of a calibration from its tables: errors, joint ranges, rows left out."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import pandas as pd

from kinacc.config.error_models import COMPARISONS, MEASURED, NOMINAL, Comparison
from kinacc.kinematics import dh
from kinacc.kinematics.robot import Robot
from kinacc.tables.allowed import SELECTABLE
from kinacc.tables.columns import Columns

LARGE_SHARE = 0.99  # of rows whose error is at most the quantile stated
TABLES = ("measurements", "robot", "frames", "dh_identified", "pose_errors", "model_selection")
# Statistics that a tolerance of the configuration can be about.
TOLERANCE_OF = {
    "mean": "mean held-out position error",
    "quantile_99": "99 % quantile of held-out position errors",
    "bound": "upper bound of a campaign",
}
_ORDER = (NOMINAL, *SELECTABLE)
_AXES = {
    "position": ("mm", ["ex_mm", "ey_mm", "ez_mm"]),
    "orientation": ("mrad", ["rx_mrad", "ry_mrad", "rz_mrad"]),
}
_PARALLEL_DEG = 5.0  # a flange axis that turns less is called parallel in all poses
_LEAST_LENGTH = 1e-9


@dataclass(frozen=True)
class Tolerance:
    """Largest position error allowed.

    Attributes
    ----------
    mm : float
        The error.
    of : str
        The statistic it is about: a key of ``TOLERANCE_OF``.
    """

    mm: float
    of: str

    def __str__(self) -> str:
        return f"{self.mm:g} mm for the {TOLERANCE_OF[self.of]}"


def selected(choice: Columns) -> str:
    """The selected model of a table.

    Parameters
    ----------
    choice : mapping
        Columns of ``model_selection``.

    Returns
    -------
    str
        Kind of the model.
    """
    return next(str(n) for n, yes in zip(choice["model"], choice["selected"], strict=True) if yes)


def held_out_errors(pose_errors: Columns | pd.DataFrame, model: str) -> pd.DataFrame:
    """Rows of ``pose_errors`` of a model against measurements, held out in every comparison.

    Parameters
    ----------
    pose_errors
        The table.
    model
        Kind of the model.

    Returns
    -------
    DataFrame
        Its columns, at rows that all models were tried on.
    """
    table = pd.DataFrame(pose_errors)
    table = table[table["estimate"] == "cross_validated"]
    tried = table.groupby("row")["comparison"].transform("nunique")
    table = table[tried == table["comparison"].nunique()]
    return table[table["comparison"] == Comparison(MEASURED, model).name]


def error_statistics(pose_errors: Columns, configuration: np.ndarray) -> pd.DataFrame:
    """Statistics of every comparison over the rows that all comparisons of an estimate share.

    Parameters
    ----------
    pose_errors
        Table ``pose_errors``.
    configuration
        Configuration number (n,) of every measured row.

    Returns
    -------
    One row for each comparison, estimate (``cross_validated``, ``train``) and quantity, the
    simplest model first: ``comparison``, ``reference``, ``model``, ``estimate``, ``quantity``,
    ``unit``, ``n``, ``mean``, ``quantile_99``, ``largest`` and ``rms`` of magnitudes in mm or mrad,
    and ``std_error`` of the mean over ``configurations``.

    Notes
    -----
    Readings of one configuration share its error, so the standard error is that of a ratio of sums
    over configurations (Cochran, Sampling Techniques, 1977, eq. 6.13); NaN for a single one. It
    assumes configurations drawn independently, and fitted models as they are.
    """
    errors = pd.DataFrame(dict(pose_errors))
    errors["configuration"] = configuration[errors["row"]]
    known = sorted(COMPARISONS, key=lambda comparison: _ORDER.index(comparison.model))
    errors = errors[errors["comparison"].isin([comparison.name for comparison in known])]
    tried = errors.groupby(["estimate", "row"])["comparison"].transform("nunique")
    errors = errors[tried == errors.groupby("estimate")["comparison"].transform("nunique")]
    groups = dict(list(errors.groupby(["comparison", "estimate"])))
    rows = []
    for comparison, quantity, estimate in product(known, _AXES, ("cross_validated", "train")):
        unit, axes = _AXES[quantity]
        group = groups.get((comparison.name, estimate), errors[:0]).dropna(subset=axes)
        if group.empty:
            continue
        size = np.sqrt(np.square(group[axes].astype(float)).sum(axis=1))
        of_configurations = (size - size.mean()).groupby(group["configuration"]).sum()
        count = len(of_configurations)
        rows.append(
            {
                "comparison": comparison.name,
                "reference": comparison.reference,
                "model": comparison.model,
                "estimate": estimate,
                "quantity": quantity,
                "unit": unit,
                "n": len(size),
                "mean": size.mean(),
                "quantile_99": size.quantile(LARGE_SHARE),
                "largest": size.max(),
                "rms": np.sqrt(np.mean(size**2)),
                "std_error": of_configurations.std() * np.sqrt(count) / len(size),
                "configurations": count,
            }
        )
    return pd.DataFrame(rows)


def frames_are_fitted(frames: Columns) -> bool:
    """Whether base and tool were fitted: then the models have different ones."""
    table = pd.DataFrame(dict(frames)).set_index("model")
    places = table[["x_mm", "y_mm", "z_mm", "qx", "qy", "qz"]]
    fitted = places.index[places.index != NOMINAL][0]
    return not np.array_equal(places.loc[[NOMINAL]], places.loc[[fitted]])


def reported_joints(measurements: Columns, joints: int) -> np.ndarray:
    """Reported joints (n, joints) of the table ``measurements``, rad or mm."""
    numbers = range(1, joints + 1)
    return np.stack([np.asarray(measurements[f"q{n}"], dtype=float) for n in numbers], axis=1)


def covered(measurements: Columns, robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest value (k,), (k,) of each reported joint."""
    joints = reported_joints(measurements, len(robot.q_min_rad))
    return joints.min(axis=0), joints.max(axis=0)


def flange_spread_deg(measurements: Columns, robot: Robot) -> float | None:
    """Largest angle between the flange z axis and its mean, None where it is 5 deg or more."""
    joints = robot.dh_joints(reported_joints(measurements, len(robot.q_min_rad)))
    axis = dh.forward(robot.dh, joints).rotation[..., 2]
    mean = axis.mean(axis=0)
    along = axis @ mean / max(float(np.linalg.norm(mean)), _LEAST_LENGTH)
    off = float(np.rad2deg(np.arccos(np.clip(along.min(), -1.0, 1.0))))
    return off if off < _PARALLEL_DEG else None

"""Fewer different poses than the VEC model has coefficients."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinacc.calibration.observations import from_columns
from kinacc.calibration.vec_estimator import VECEstimator
from kinacc.checks.suspicion import Suspicion, suspicion
from kinacc.kinematics.robot import Robot
from kinacc.measurements import folds
from kinacc.tables.columns import Columns

_PER_POSE = 6  # a rigid body has no more, however many targets it carries


def found(columns: Columns, robot: Robot, calibration: Mapping) -> list[Suspicion]:
    """Whether the VEC model has more coefficients than the poses give independent readings."""
    count = len(columns["pose"])
    seen = from_columns({**columns, "fold": np.full(count, np.nan)}, robot)
    fit = VECEstimator.of(calibration, robot, seen)
    same = folds.configurations_of(columns)
    # A target adds three components to a pose, an orientation three; repeats add none.
    pairs, first = np.unique(np.stack([same, seen.target]), axis=1, return_index=True)
    turned = np.zeros(same.max() + 1)
    np.maximum.at(turned, pairs[0], 3.0 * seen.has_rotation[first])
    components = np.minimum(3.0 * np.bincount(pairs[0]) + turned, _PER_POSE)
    coefficients = fit.size
    frames = int(fit.common.terms(seen).free.sum()) if fit.common.frames_estimated else 0
    if components.sum() >= coefficients + frames:
        return []
    of_frames = f" and {frames} of base and targets" if frames else ""
    return [
        suspicion(
            "few_poses",
            f"{len(components)} different poses give {components.sum():.0f} independent numbers "
            f"for the {coefficients} coefficients of the VEC model of order {fit.order}"
            f"{of_frames}: its prior decides most of them, not the measurements",
            (),
            "measure more poses, lower calibration.vec.order, or let it be chosen (order: auto)",
            poses=len(components),
            coefficients=coefficients,
        ).held_to(())
    ]

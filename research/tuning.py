"""From a random arm to one like the paper's: four factors and a geometry, by one rule for all.

The factors are those at which, row by row of Tables I and III, the largest ratio to the paper's
numbers and the smallest one are equally far from 1 (the true accuracy counts to Table III's
position row). The geometry is Table II less the part of the errors a DH model can represent.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kinacc.distributions import gamma99
from kinacc.geometry import log_so3
from kinacc.kinematics import dh
from kinacc.kinematics.dh import DHModel
from kinacc.synthetic.accepted import AcceptedDraw
from kinacc.synthetic.draw import TABLE_II, Scales, physical_robot
from kinacc.synthetic.plan import Run, measured
from research.response import Answer, Response, answer

ROWS = (
    ("table1", "position"),
    ("table1", "orientation"),
    ("table3", "position"),
    ("table3", "orientation"),
)
STATISTICS = ("mean", "max", "gamma99")
_SCALE_DIGITS, _GEOMETRY_DIGITS = 4, 7
_LOG_LIMIT = 3.0


@dataclass(frozen=True)
class Targets:
    """The paper's numbers: ``tables`` (4, 3), rows and statistics as above; ``accuracy_mm``."""

    tables: np.ndarray
    accuracy_mm: float

    def noise_mm(self, rotation_weight_mm_per_rad: float) -> float:
        """Whitened residual per axis that Table I leaves, if it were normal."""
        position, orientation = self.tables[:2, 0] * np.sqrt(np.pi / 8.0)
        return np.hypot(position, 1e-3 * orientation * rotation_weight_mm_per_rad) / np.sqrt(2.0)


def tuned(
    seed: int, run: Run, response: Response, targets: Targets, tracker_noise_mm: float
) -> tuple[AcceptedDraw, float]:
    """The arm of draw ``seed``, scaled and on its geometry; accepted or not is not asked here.

    The number is what the response predicts of it: the largest share by which a number of Tables I
    and III, or the accuracy, misses the paper's.
    """
    answers = answer(response, error_patterns(seed, run, tracker_noise_mm))
    scales = solve_scales(answers, targets)
    taken = np.tensordot([*scales, 1.0], answers.dh, axes=1)
    table = np.stack([TABLE_II.theta_offset_rad, TABLE_II.d_mm, TABLE_II.a_mm, TABLE_II.alpha_rad])
    values = np.round(table - taken.T, _GEOMETRY_DIGITS)
    miss = np.nanmax(np.abs(predicted(answers, np.array(scales)) / _wanted(targets) - 1.0))
    return AcceptedDraw(seed, scales, DHModel(*values, np.zeros(6))), float(miss)


def error_patterns(seed: int, run: Run, tracker_noise_mm: float) -> np.ndarray:
    """Pose errors (5, n, 6) in mm and rad: each group of effects alone at factor 1, the tracker."""
    base = dh.forward(TABLE_II, run.visits.q_rad)
    patterns = []
    for factors in np.vstack([np.eye(4), np.zeros(4)]):
        arm = physical_robot(seed, Scales(*factors))
        seen = measured(arm, run, 0.0 if factors.any() else tracker_noise_mm)
        turn = log_so3(seen.rotation @ np.swapaxes(base.rotation, 1, 2))
        patterns.append(np.concatenate([seen.position_mm - base.position_mm, turn], axis=1))
    return np.array(patterns)


def solve_scales(answers: Answer, targets: Targets) -> Scales:
    """The four factors at which every row's ratios to the paper spread evenly about 1."""
    from scipy.optimize import least_squares

    def imbalance(logs: np.ndarray) -> np.ndarray:
        ratios = np.log(predicted(answers, np.exp(logs)) / _wanted(targets))
        return 0.5 * (np.nanmax(ratios, axis=1) + np.nanmin(ratios, axis=1))

    found = least_squares(
        imbalance, np.zeros(4), bounds=(-_LOG_LIMIT, _LOG_LIMIT), diff_step=1e-4, max_nfev=40
    )
    return Scales(*np.round(np.exp(found.x), _SCALE_DIGITS).tolist())


def predicted(answers: Answer, factors: np.ndarray) -> np.ndarray:
    """Rows (4, 4): mean, max, gamma99 of each table row; the accuracy in Table III's first row."""
    weights = [*factors, 1.0]
    rows = np.full((4, 4), np.nan)
    for table, residuals in enumerate((answers.vec_vs_measured, answers.dh_vs_vec)):
        total = np.tensordot(weights, residuals, axes=1)
        rows[2 * table, :3] = statistics(total[:, :3])
        rows[2 * table + 1, :3] = statistics(1e3 * total[:, 3:])
    at_points = np.tensordot(weights, answers.at_points_mm, axes=1)
    rows[2, 3] = np.linalg.norm(at_points, axis=1).max()
    return rows


def statistics(vectors: np.ndarray) -> tuple[float, float, float]:
    """Mean, maximum and 99 % gamma quantile of the magnitudes of vectors (n, 3)."""
    magnitude = np.linalg.norm(vectors, axis=1)
    return magnitude.mean(), magnitude.max(), gamma99(magnitude)


def targets_of(numbers: Mapping[str, float]) -> Targets:
    """Targets from the paper's numbers by claim id."""
    tables = [[numbers[f"{table}_{row}_{name}"] for name in STATISTICS] for table, row in ROWS]
    return Targets(np.array(tables), numbers["true_accuracy"])


def _wanted(targets: Targets) -> np.ndarray:
    wanted = np.full((4, 4), np.nan)
    wanted[:, :3] = targets.tables
    wanted[2, 3] = targets.accuracy_mm
    return wanted

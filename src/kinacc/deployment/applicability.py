"""Whether a pose lies where the calibration was measured: it is known as well as fitted poses are.

Ranges of single joints do not tell: where the flange always pointed the same way, nearly all of
the box they span was never measured. The covariance of the fit tells. Seen on UR10, UR5 and FANUC
data, DH and VEC models fitted without a part of the poses: the rms of the rest is 0.9 to 1.2 times
the usual held-out one inside (1.7 for the 24 poses of the FANUC), 1.0 to 7.7 times outside.
Distances to measured poses alone call FANUC poses inside that are off by 4.7 times that.

Gaps between clusters of poses need no measure of their own. On a made-up UR10 measured in two
clusters no pose between them counts as measured. Measured at both ends of joint 2 alone, the rms in
the gap is 1.2 to 1.3 times the usual one of a DH model, which takes it for measured; of VEC models,
which take none of it so (with order 2 three quarters of a narrow gap), it is 1.5 to 7 times. By the
distance to the nearest measured pose 65 to 83 % of those gaps are as near as others. Of held-out
UR10 and UR5 poses the 1 to 2 % that it calls far are off by 0.9 to 1.2 times as much as the rest,
those that the covariance does by 1.0 to 1.6 times.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinacc.deployment.record import Calibration
from kinacc.deployment.sensitivity import deviations
from kinacc.kinematics.model import JointState
from kinacc.kinematics.region import points

LIKE_FITTED = 0.99  # of the fitted poses are known as well as the limit
_MOST_FITTED = 500  # that the limit is taken from
_DRAWN = 1000  # poses that a share is counted of


def position_std_mm(
    calibration: Calibration, at: JointState, point: str | None = None
) -> np.ndarray:
    """Standard deviations (n,) of predicted positions in the instrument's frame, axes together.

    Undetermined directions count with one unit each: 1 mm or 1 mrad.
    """
    std, undetermined = deviations(calibration, at, "instrument", point)
    return np.sqrt(np.sum(std[:, :3] ** 2, axis=1) + undetermined[:, 0] ** 2)


def limit_mm(calibration: Calibration, point: str | None = None) -> float:
    """Standard deviation that 99 % of the fitted poses keep; inf where nothing is known of them."""
    if calibration.known is None or calibration.fitted is None:
        return np.inf
    rows = np.linspace(0, len(calibration.fitted) - 1, _MOST_FITTED).astype(int)
    fitted = calibration.fitted.select(np.unique(rows))
    return float(np.quantile(position_std_mm(calibration, fitted, point), LIKE_FITTED))


def is_measured_there(
    calibration: Calibration, at: JointState, point: str | None = None
) -> np.ndarray:
    """Whether configurations are near measured ones.

    Parameters
    ----------
    at
        n configurations in DH joints.
    point
        A target by name or ``flange``; the tool where not given.

    Returns
    -------
    numpy.ndarray
        True (n,) where every joint is in its fitted range, and the position within ``limit_mm``.
        Without a covariance the ranges decide alone.
    """
    inside = np.all(~calibration.outside_range(at.q_rad), axis=1)
    most_mm = limit_mm(calibration, point)
    if np.isfinite(most_mm) and inside.any():
        rows = np.flatnonzero(inside)
        inside[rows] = position_std_mm(calibration, at.select(rows), point) <= most_mm
    return inside


def measured_by_all(calibrations: Sequence[Calibration], q_rad: np.ndarray) -> np.ndarray:
    """True (n,) where every calibration was measured, over reported joints (n, k)."""
    result = [
        is_measured_there(item, JointState(item.robot.dh_joints(q_rad))) for item in calibrations
    ]
    return np.all(result, axis=0)


def share_of_box(calibration: Calibration, low: np.ndarray, high: np.ndarray) -> float:
    """Share of the box of reported joints (k,), (k,) where the calibration was measured."""
    drawn = low + points("sobol", _DRAWN, len(low)) * (high - low)
    state = JointState(calibration.robot.dh_joints(drawn))
    return float(np.mean(is_measured_there(calibration, state)))

"""Candidates where the calibration was not measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinacc.campaign.plan import Points
from kinacc.deployment.applicability import LIKE_FITTED, is_measured_there, position_std_mm
from kinacc.deployment.record import Calibration
from kinacc.errors import Problem
from kinacc.kinematics.model import JointState

_MANY = 0.1  # of the candidates


@dataclass(frozen=True)
class Unsure:
    """Number of ``candidates``, and of those where the calibration was not measured.

    ``largest_std_mm``: largest standard deviation of a predicted position.
    """

    candidates: int
    not_measured: int
    largest_std_mm: float

    def in_words(self) -> str:
        """The finding in a sentence; empty where every candidate lies near measured poses."""
        if not self.not_measured:
            return ""
        return (
            f"{self.not_measured} of {self.candidates} candidates lie where the calibration was "
            "not measured, and its errors may be larger: they are outside its joint ranges, or "
            f"known less well than {LIKE_FITTED:.0%} of the poses of the fit (standard deviations "
            f"up to {self.largest_std_mm:.3g} mm)"
        )

    def asked(self) -> list[Problem]:
        """The problem where more than a tenth of the candidates lie there."""
        if self.not_measured <= _MANY * self.candidates:
            return []
        allowed, fix = (
            f"at most {_MANY:.0%} of them",
            "--region measured draws them between measured poses; --sure takes them as they are",
        )
        return [Problem("candidates", self.in_words(), allowed, fix)]


def unsure(arm: Calibration, points: Points, point: str | None) -> Unsure | None:
    """How many candidates lie where the calibration was not measured; None without covariance."""
    if arm.known is None or arm.residual is None or not np.isfinite(arm.residual.position_mm):
        return None
    at = JointState(arm.robot.dh_joints(points.joints), points.directions)
    measured = is_measured_there(arm, at, point)
    largest = float(np.max(position_std_mm(arm, at, point)))
    return Unsure(len(points), int(np.sum(~measured)), largest)

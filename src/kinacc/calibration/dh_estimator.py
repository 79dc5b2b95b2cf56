"""How DH models are fitted: to the VEC model at the measured joints, or to the measurements."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from kinacc.calibration import identified, tables
from kinacc.calibration.constraints import ArmTerms, arm_terms, free_parameters, parallel_joints
from kinacc.calibration.fitting import MORE_POSES, ModelFit, distinct
from kinacc.calibration.frames import Frames, component_names
from kinacc.calibration.models import Common, Estimator, Fit
from kinacc.calibration.observations import Observations, full_poses
from kinacc.calibration.uncertainty import Uncertainty
from kinacc.config import parameter_rules
from kinacc.config.parameter_rules import Rule
from kinacc.geometry import IDENTITY
from kinacc.kinematics.robot import Robot
from kinacc.tables.columns import Columns

_AUTO = "auto"
FEW = 3  # numbers a parameter; with fewer, priors of usual size hold what these do not show
LEAST = 9  # numbers beside base and tool below which the nominal arm predicts better


@dataclass(frozen=True)
class DHEstimator(Estimator):
    """How DH models are fitted: settings of ``calibration.dh``.

    Attributes
    ----------
    follows_vec : bool
        The DH model follows the VEC at the measured joints instead of the measurements.
    hayati_joints : tuple of int
        Joints (1-based) with a free beta (Hayati, Proc. CDC 1983).
    hayati_instead : bool
        Beta in place of d, else beside it.
    rules : tuple of Rule
        Parameters that are fixed or known beforehand.
    loss : str
        squares, huber or tukey.
    threshold : float
        Share of the largest singular value below which directions stay nominal.
    """

    follows_vec: bool
    hayati_joints: tuple[int, ...]
    hayati_instead: bool
    rules: tuple[Rule, ...]
    loss: str
    threshold: float

    kind: ClassVar[str] = "dh"
    name: ClassVar[str] = "DH fit"
    fix: ClassVar[str] = MORE_POSES

    @classmethod
    def of(cls, calibration: Mapping, arm: Robot, every: Observations) -> Self:
        """By the ``calibration`` settings."""
        section = calibration["dh"]
        return cls(
            Common.of(calibration, arm),
            section["fit_to"] == "vec",
            hayati_joints(section, arm),
            section["hayati_joints"] == _AUTO,
            tuple(parameter_rules.rules(section["parameters"])),
            section["loss"],
            float(section["truncation"]),
        )

    @property
    def arm(self) -> ArmTerms:
        """What the fit takes for granted of the arm."""
        nominal = self.common.nominal
        free = free_parameters(nominal.joints, self.hayati_joints, self.hayati_instead)
        return arm_terms(nominal, free, self.rules)

    @property
    def size(self) -> int:
        """Number of free parameters."""
        return int(self.arm.free.sum())

    @property
    def required(self) -> int:
        """Numbers that a fit needs beside those for base and targets: of few, priors make up."""
        return self.size if self.follows_vec else 0

    def fit(self, observations: Observations, others: Mapping[str, Fit]) -> ModelFit:
        """The DH model; base and targets are those of the VEC model where it follows that."""
        arm, settings = self.arm, {}
        free, std, held = arm.free, arm.std, False
        followed = others["vec"] if self.follows_vec else None
        if followed:
            frames = Frames(IDENTITY, followed.frames.targets)
            one_base = replace(observations, session=np.zeros(len(observations), dtype=np.int64))
            poses = full_poses(observations.q_rad, frames.seen(followed.model, one_base))
            observations = poses.with_targets_of(observations)
            settings = {"frames": frames, "frame_terms": None}
        else:
            count = distinct(observations).components
            estimated = len(component_names(observations)) if self.common.frames_estimated else 0
            held = count < FEW * (estimated + self.size)
            std = np.minimum(std, arm.nominal.prior_std.reshape(free.shape)) if held else std
            free = free & (count >= estimated + LEAST)
        fitted = self.common.fit(
            observations,
            arm.nominal,
            free=free,
            std=std,
            held=held and bool(free.any()),
            threshold=self.threshold,
            loss=self.loss,
            **settings,
        )
        return replace(fitted, frames=followed.frames) if followed else fitted

    def tables(
        self, fitted: ModelFit, known: Uncertainty, observations: Observations
    ) -> dict[str, Columns]:
        """How the fit went, and which parameters the observations determine."""
        return {
            "dh_fit": tables.fit_columns("dh_fit", fitted, known),
            "dh_identified": identified.table(fitted, known, observations),
        }


def hayati_joints(section: Mapping, arm: Robot) -> tuple[int, ...]:
    """Joints with a Hayati angle.

    Parameters
    ----------
    section : mapping
        ``calibration.dh`` settings.
    arm : Robot
        The arm, whose nearly parallel joints ``auto`` chooses.

    Returns
    -------
    tuple of int
        Numbers of joints, 1-based.
    """
    if section["hayati_joints"] == _AUTO:
        return parallel_joints(arm.dh)
    return tuple(int(joint) for joint in section["hayati_joints"])

"""How DH models are fitted: to the VEC model at the measured joints, or to the measurements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from kinacc.calibration.fitting import Fit, ModelFit, distinct
from kinacc.calibration.frames import FrameParameters, ruled, stacked
from kinacc.calibration.models import Common, Estimator
from kinacc.calibration.observations import Observations
from kinacc.config import parameter_rules
from kinacc.config.parameter_rules import Rule
from kinacc.config.records import Settings
from kinacc.geometry import IDENTITY, Pose
from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.kinematics.robot import Robot
from kinacc.kinematics.robot.axes import NEARLY_PARALLEL

_BETA, _D = PARAMETERS.index("beta_rad"), PARAMETERS.index("d_mm")


def parallel_joints(model: DHModel) -> tuple[int, ...]:
    """Joints (1-based) whose axis is nearly parallel to the next one's.

    There the common normal, and with it d and theta, is ill defined (Hayati, Proc. CDC 1983).

    Parameters
    ----------
    model : DHModel
        An arm.

    Returns
    -------
    tuple of int
        Joints where the sine of the angle between both axes is below
        ``robot.axes.NEARLY_PARALLEL``.
    """
    # The next axis, seen from a joint's own: Rx(alpha) Ry(beta) z.
    x = np.sin(model.beta_rad)
    y = np.sin(model.alpha_rad) * np.cos(model.beta_rad)
    near = np.hypot(x, y) < NEARLY_PARALLEL
    return tuple(int(joint) for joint in np.flatnonzero(near[:-1]) + 1)


def free_parameters(
    joints: int, hayati_joints: Sequence[int] = (), instead: bool = False
) -> np.ndarray:
    """Mask of the DH parameters a fit estimates: four per joint, and beta where the axis is
    parallel.

    Parameters
    ----------
    joints : int
        Number of joints k.
    hayati_joints : sequence of int
        Joints (1-based) with a free beta (Hayati, Proc. CDC 1983).
    instead : bool
        Beta in place of d, else beside it.

    Returns
    -------
    numpy.ndarray
        True where estimated, shape (k, 5) in the order of ``dh.PARAMETERS``.
    """
    free = np.ones((joints, 5), dtype=bool)
    free[:, _BETA] = False
    parallel = np.array(hayati_joints, dtype=int) - 1
    free[parallel, _BETA], free[parallel, _D] = True, not instead
    return free


def arm_terms(
    nominal: DHModel, free: np.ndarray, rules: Sequence[Rule] = ()
) -> tuple[DHModel, np.ndarray, np.ndarray]:
    """What a fit takes for granted of an arm, by default or by rules.

    Parameters
    ----------
    nominal : DHModel
        The arm with k joints before a fit.
    free : numpy.ndarray
        Parameters that are free by default, shape (k, 5).
    rules : sequence of Rule
        What the configuration fixes or knows; one for a whole joint speaks of those free by
        default.

    Returns
    -------
    nominal : DHModel
        Where parameters that are not free stay and what priors expect.
    free : numpy.ndarray
        True where estimated, shape (k, 5).
    std : numpy.ndarray
        Of priors, shape (k, 5) in mm and rad, inf for none.
    """
    about = [(name, joint, None) for joint in range(1, len(free) + 1) for name in PARAMETERS]
    chosen, values, std = ruled(rules, about, free.ravel(), nominal.start)
    return nominal.with_parameters(values), chosen.reshape(free.shape), std.reshape(free.shape)


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
    nominal, free, std
        See ``arm_terms``.
    loss : str
        squares, huber or tukey.
    threshold : float
        Share of the largest singular value below which directions stay nominal.
    """

    follows_vec: bool
    nominal: DHModel
    free: np.ndarray
    std: np.ndarray
    loss: str
    threshold: float

    kind: ClassVar[str] = "dh"

    @classmethod
    def of(cls, calibration: Settings, arm: Robot, every: Observations) -> Self:
        """By the ``calibration`` settings."""
        section = calibration["dh"]
        instead = section["hayati_joints"] == _AUTO
        free = free_parameters(arm.dh.joints, hayati_joints(section, arm), instead)
        return cls(
            Common.of(calibration, arm),
            section["fit_to"] == "vec",
            *arm_terms(arm.dh, free, parameter_rules.rules(section["parameters"])),
            section["loss"],
            section["truncation"],
        )

    def fit(self, observations: Observations, others: Mapping[str, Fit]) -> ModelFit:
        """The DH model; base and targets are those of the VEC model where it follows that."""
        settings, free, std, held = {}, self.free, self.std, False
        followed = others["vec"] if self.follows_vec else None
        if followed:
            bases, targets = [IDENTITY] * followed.frames.sessions, followed.frames.targets
            frames = replace(followed.frames, poses=stacked([*bases, *map(Pose, *targets)]))
            at = frames.seen(followed.model, observations)
            observations = replace(observations, position_mm=at.position_mm, rotation=at.rotation)
            settings = {"frames": FrameParameters.none(frames)}
        else:
            count = distinct(observations).components
            estimated = self.common.frames(observations).size
            held = count < FEW * (estimated + int(free.sum()))
            std = np.minimum(std, self.nominal.prior_std.reshape(free.shape)) if held else std
            free = free & (count >= estimated + LEAST)
        fitted = self.common.fit(
            observations,
            self.nominal,
            free=free,
            std=std,
            held=held and bool(free.any()),
            threshold=self.threshold,
            loss=self.loss,
            **settings,
        )
        return replace(fitted, frames=followed.frames) if followed else fitted


def hayati_joints(section: Settings, arm: Robot) -> tuple[int, ...]:
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
    return tuple(section["hayati_joints"])

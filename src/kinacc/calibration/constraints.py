"""Which parameters of an arm a fit estimates, and what is known of them, from rules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinacc.config import parameter_rules
from kinacc.config.parameter_rules import Rule
from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.kinematics.robot.axes import NEARLY_PARALLEL

_BETA, _D = PARAMETERS.index("beta_rad"), PARAMETERS.index("d_mm")


@dataclass(frozen=True)
class ArmTerms:
    """``free`` (k, 5) parameters of an arm and what is known of all beforehand.

    ``nominal``: where the others stay and what priors expect; ``std`` (k, 5) of the priors in mm
    and rad, inf for none.
    """

    nominal: DHModel
    free: np.ndarray
    std: np.ndarray


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
    for joint in hayati_joints:
        free[joint - 1, _BETA] = True
        free[joint - 1, _D] = not instead
    return free


def arm_terms(nominal: DHModel, free: np.ndarray, rules: Sequence[Rule] = ()) -> ArmTerms:
    """Terms of an arm: free by default or by rules.

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
    ArmTerms
        Mask, nominal values and standard deviations of priors, in mm and rad.
    """
    values = nominal.start.reshape(free.shape).copy()
    chosen, std = free.copy(), np.full(free.shape, np.inf)
    for joint, column in np.ndindex(free.shape):
        name = PARAMETERS[column]
        rule = parameter_rules.rule_for(rules, name, joint=joint + 1)
        if rule is None or (rule.parameter is None and not free[joint, column]):
            continue
        chosen[joint, column] = rule.free
        values[joint, column] = rule.value.get(parameter_rules.unit(name), values[joint, column])
        std[joint, column] = rule.std.get(parameter_rules.unit(name), np.inf)
    return ArmTerms(nominal.with_parameters(values.ravel()), chosen, std)

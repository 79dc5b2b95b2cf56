"""What a fit takes for granted: parameters of the arm and of its frames, from rules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinacc.calibration.constrained import FrameTerms
from kinacc.calibration.frames import Frames, coordinates, known
from kinacc.calibration.observations import Observations
from kinacc.config import parameter_rules
from kinacc.config.parameter_rules import Rule
from kinacc.errors import Problem, refuse
from kinacc.kinematics import dh
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

    The sine of the angle between both axes is below ``robot.axes.NEARLY_PARALLEL``: there the
    common normal, and with it d and theta, is ill defined (Hayati, Proc. CDC 1983).
    """
    # The next axis, seen from a joint's own: Rx(alpha) Ry(beta) z.
    x = np.sin(model.beta_rad)
    y = np.sin(model.alpha_rad) * np.cos(model.beta_rad)
    near = np.hypot(x, y) < NEARLY_PARALLEL
    return tuple(int(joint) for joint in np.flatnonzero(near[:-1]) + 1)


def free_parameters(
    joints: int, hayati_joints: Sequence[int] = (), instead: bool = False
) -> np.ndarray:
    """Mask (k, 5): four DH parameters per joint, and beta on ``hayati_joints`` (1-based).

    ``instead``: beta in place of d, else beside it.
    """
    free = np.ones((joints, 5), dtype=bool)
    free[:, _BETA] = False
    for joint in hayati_joints:
        free[joint - 1, _BETA] = True
        free[joint - 1, _D] = not instead
    return free


def arm_terms(nominal: DHModel, free: np.ndarray, rules: Sequence[Rule] = ()) -> ArmTerms:
    """Terms of an arm: ``free`` (k, 5) by default, changed by ``rules``.

    A rule for a whole joint speaks of the parameters that are free by default.
    """
    values = dh.to_vector(nominal).reshape(free.shape).copy()
    chosen, std = free.copy(), np.full(free.shape, np.inf)
    for joint, column in np.ndindex(free.shape):
        name = PARAMETERS[column]
        rule = parameter_rules.rule_for(rules, name, joint=joint + 1)
        if rule is None or (rule.parameter is None and not free[joint, column]):
            continue
        chosen[joint, column] = rule.free
        values[joint, column] = rule.value.get(parameter_rules.unit(name), values[joint, column])
        std[joint, column] = rule.std.get(parameter_rules.unit(name), np.inf)
    return ArmTerms(dh.with_vector(nominal, values.ravel()), chosen, std)


def frame_terms(
    observations: Observations, stated: Frames, rules: Sequence[Rule] = ()
) -> FrameTerms:
    """Terms of base and targets, all free but for ``rules``; ``stated``: where a fixed one is."""
    require_known(rules, observations)
    coords = coordinates(observations, stated, base_free=True, targets_free=True)
    names = tuple(coords.motion_names(observations.target_names))
    at = [*stated.bases.position_mm, *stated.targets.position_mm]
    frames = list(dict.fromkeys(name.rpartition(".")[0] for name in names))
    free, value = np.ones(len(names), dtype=bool), np.zeros(len(names))
    std = np.full(len(names), np.inf)
    for number, name in enumerate(names):
        frame, _, component = name.rpartition(".")
        if component[1:] == "_mm":
            value[number] = at[frames.index(frame)]["xyz".index(component[0])]
        rule = parameter_rules.rule_for(rules, component, frame=frame)
        if rule is None:
            continue
        free[number] = rule.free
        value[number] = rule.value.get(parameter_rules.unit(component), value[number])
        std[number] = rule.std.get(parameter_rules.unit(component), np.inf)
    return FrameTerms(names, free, value, std, stated)


def require_known(rules: Sequence[Rule], observations: Observations) -> None:
    """Raise InputError naming every rule about a frame ``observations`` do not let estimate."""
    if not rules:
        return
    sessions, targets = len(observations.session_names), len(observations.target_names)
    start = known(sessions=sessions, targets=targets)
    coords = coordinates(observations, start, base_free=True, targets_free=True)
    frames: dict[str, list[str]] = {}
    for name in coords.motion_names(observations.target_names):
        frame, _, component = name.rpartition(".")
        frames.setdefault(frame, []).append(component)
    problems = [
        Problem(f"{parameter_rules.KEYS[parameter_rules.FRAMES]}, {rule.name!r}", what, allowed)
        for rule, what, allowed in parameter_rules.strangers(rules, observations.joints, frames)
    ]
    refuse(problems)

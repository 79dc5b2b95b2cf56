"""What one measured pose tells of the parameters of a calibration, and what no pose tells.

The arm is linearised at its nominal parameters. Displacements count in mm and mrad, a rotation of
one radian weighs as much as ``rotation_weight_mm_per_rad`` in position.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kinacc.calibration import frames
from kinacc.calibration.blind_groups import LeftOpen, groups, of_arm
from kinacc.calibration.dh_fit import joints_anywhere
from kinacc.calibration.frames import BASE, MOTIONS
from kinacc.calibration.identified import STRUCTURAL
from kinacc.calibration.uncertainty import Uncertainty
from kinacc.deployment.predict import sensitivity
from kinacc.deployment.record import TOOL, Calibration, nominal
from kinacc.geometry import Pose
from kinacc.kinematics.model import JointState
from kinacc.kinematics.robot import Robot

_BLOCK = 512


@dataclass(frozen=True)
class Experiment:
    """What will be measured and fitted.

    ``tool`` is the measured point or frame in the last DH frame; ``orientation``: a full pose is
    measured, not a position alone; ``frames_estimated``: base and tool are unknown as well;
    ``hayati_joints`` (1-based) have a beta. ``threshold``: a direction seen with less than this
    share of the best-seen one counts as undetermined.
    """

    tool: Pose
    orientation: bool
    frames_estimated: bool
    hayati_joints: tuple[int, ...]
    rotation_weight_mm_per_rad: float
    threshold: float


@dataclass(frozen=True)
class Information:
    """Rows (n, m, r) that n candidate poses add to the normal equations of r directions.

    The r directions are those at least one candidate shows; the others are ``left_open``.
    ``values`` are the singular values of all candidates together, falling, of ``names`` parameters
    (P,), and ``rank`` how many of them count.
    """

    rows: np.ndarray
    names: tuple[str, ...]
    values: np.ndarray
    rank: int
    left_open: LeftOpen


def information(robot: Robot, q_rad: np.ndarray, experiment: Experiment) -> Information:
    """Information of poses at reported joints (n, k), rad and mm."""
    names = parameter_names(robot, experiment)
    count = len(names)
    blank = Uncertainty(names, np.eye(count), np.zeros((0, count)))
    arm = replace(nominal(robot), targets={TOOL: experiment.tool}, known=blank)
    slopes = _slopes(arm, robot.dh_joints(np.atleast_2d(q_rad)), experiment)
    _, values, right = np.linalg.svd(slopes.reshape(-1, count), full_matrices=False)
    rank = int(np.sum(values > experiment.threshold * values[0]))
    lost = right[rank:] if len(right) == count else _complement(right[:rank])
    left_open = _left_open(arm, experiment, lost)
    return Information(slopes @ right[:rank].T, names, values, rank, left_open)


def _slopes(arm: Calibration, q_dh: np.ndarray, experiment: Experiment) -> np.ndarray:
    """Movement (n, m, P) of what is measured at DH joints (n, k), per mm or mrad."""
    weight = np.ones(6)
    weight[3:] = experiment.rotation_weight_mm_per_rad
    seen = 6 if experiment.orientation else 3
    slopes = np.empty((len(q_dh), seen, len(arm.known.names)))
    for begin in range(0, len(q_dh), _BLOCK):
        block = slice(begin, begin + _BLOCK)
        part = sensitivity(arm, JointState(q_dh[block]), "instrument", TOOL)
        slopes[block] = (part * weight[:, None])[:, :seen] * arm.units
    return slopes


def _left_open(arm: Calibration, experiment: Experiment, lost: np.ndarray) -> LeftOpen:
    """What the directions ``lost`` (u, P) leave open."""
    names, fitted = arm.known.names, frames.known(arm.base, experiment.tool)
    if not len(lost):
        return LeftOpen((), names, fitted)
    anywhere = _slopes(arm, joints_anywhere(arm.robot.dh), experiment).reshape(-1, len(names))
    _, values, right = np.linalg.svd(anywhere)
    hidden = right[int(np.sum(values > STRUCTURAL * values[0])) :]
    return LeftOpen(groups(hidden, lost, of_arm(names)), names, fitted)


def parameter_names(robot: Robot, experiment: Experiment) -> tuple[str, ...]:
    """Names (P,) of what is fitted, base and tool first."""
    free = [
        name
        for name in robot.dh.parameter_names
        if not name.endswith("beta_rad") or int(name[1]) in experiment.hayati_joints
    ]
    if not experiment.frames_estimated:
        return tuple(free)
    motions = MOTIONS if experiment.orientation else MOTIONS[:3]
    base = [f"{BASE}.{motion}" for motion in MOTIONS]
    return (*base, *(f"{TOOL}.{motion}" for motion in motions), *free)


def _complement(kept: np.ndarray) -> np.ndarray:
    """Orthonormal rows that complete ``kept`` (r, P)."""
    return np.linalg.svd(kept)[2][len(kept) :]

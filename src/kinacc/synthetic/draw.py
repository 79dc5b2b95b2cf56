"""Random arms: what is drawn, how large it is, and the geometry of the paper's Table II.

The sizes say which effects a machining arm of this class has, and in what proportion: turns of the
first three joints and tilts of joint 4 act on more than a metre and are small, the roll of joint 4
and the turns of joints 5 and 6 act on the 225 mm behind the wrist. Four factors (``Scales``) and
the geometry are all that is adapted to the paper's tables, per draw and by one rule (``tuning``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinacc.kinematics.dh import DHModel
from kinacc.synthetic.physical import Beyond, PhysicalRobot, Smooth

# Table II, with 3.141 for the misprinted 3.114 of joint 5.
TABLE_II = DHModel(
    theta_offset_rad=np.array([0.001, -1.568, 0.001, -3.142, -3.141, 0.002]),
    d_mm=np.array([-1.157, -0.898, 0.066, -1226.154, -0.104, -224.698]),
    a_mm=np.array([323.453, 1151.356, 299.501, 0.029, 0.026, 0.028]),
    alpha_rad=np.array([-1.573, 3.140, -1.571, -1.571, -1.571, 3.142]),
    beta_rad=np.zeros(6),
)

# Working ranges of the calibration plan, over which the smooth errors are waves.
RANGE_DEG = np.array([[-12, 72], [-30, 54], [-74, 18], [-180, 180], [-122, 122], [-180, 180]])

# Waves of 1 to 8 half periods: a Chebyshev polynomial of order 5 follows the first four or so.
HALF_PERIODS = 8
# Amplitudes of one half period, falling as its number to the power 1, up to half as much again
# or less: shifts of every joint frame (mm), tilts and turns (mrad).
_SHIFT_MM, _ARM_MRAD, _WRIST_MRAD = 0.08, 0.03, 0.85

# Beyond any VEC, joints 1-3 and 4-6. Amplitudes and half gaps are uniform within 30 % of these.
_RIPPLE_MRAD = np.repeat([0.35, 1.05], 3)  # once per motor turn; twice per turn 0.4 of it
_SECOND_HARMONIC = 0.4
_GEAR_RATIO = np.array([201.6, 183.4, 192.7, 120.9, 131.3, 81.7])
_BACKLASH_MRAD = np.repeat([0.06, 0.14], 3)
_REPEATABILITY_MRAD = np.repeat([0.085, 0.2], 3)
_COMPLIANCE_MRAD_PER_KNM = np.array([0.1, 0.1, 0.13, 0.35, 0.35, 0.35])
_COUPLING_MRAD_PER_KNM = 0.06  # of joints 2 and 3, through the bending of the upper arm
# Standard deviations of what warming up adds: the column leans and grows, both arms grow.
_DRIFT_MM, _DRIFT_MRAD = 0.17, 0.08


class Scales(NamedTuple):
    """Factors on the smooth errors and on what a VEC cannot represent, of arm and wrist."""

    smooth_arm: float
    smooth_wrist: float
    beyond_arm: float
    beyond_wrist: float


class Roughness(NamedTuple):
    """How rough the errors are over a joint.

    ``wave_decay``: power by which the waves of a smooth error fall with their number; whatever it
    is, they are of the same size together. ``ripple``: factor on the errors of the gears.
    """

    wave_decay: float
    ripple: float


AS_TUNED = Roughness(1.0, 1.0)


def physical_robot(
    seed: int, scales: Scales, geometry: DHModel = TABLE_II, roughness: Roughness = AS_TUNED
) -> PhysicalRobot:
    """The arm of draw ``seed`` with its effects scaled by ``scales`` on ``geometry``."""
    rng = np.random.default_rng([seed, 1])
    smooth = _smooth(rng, scales, roughness.wave_decay)
    return PhysicalRobot(geometry, smooth, _beyond(rng, scales, roughness.ripple))


def _smooth(rng: np.random.Generator, scales: Scales, decay: float) -> Smooth:
    size = np.empty((6, 6))
    size[:, :3] = _SHIFT_MM * scales.smooth_arm
    size[:, 3:] = _ARM_MRAD * 1e-3 * scales.smooth_arm
    size[3, 5] = size[4:, 3:] = _WRIST_MRAD * 1e-3 * scales.smooth_wrist
    shape = (6, 6, HALF_PERIODS)
    number = np.arange(1.0, HALF_PERIODS + 1)
    fallen = number**decay
    same_size = np.linalg.norm(1.0 / number) / np.linalg.norm(1.0 / fallen)
    amplitude = size[..., None] * same_size / fallen * rng.uniform(0.5, 1.5, shape)
    low, high = np.deg2rad(RANGE_DEG).T
    return Smooth(low, high, amplitude, rng.uniform(0.0, 2.0 * np.pi, shape))


def _beyond(rng: np.random.Generator, scales: Scales, gears: float) -> Beyond:
    factor = np.repeat([scales.beyond_arm, scales.beyond_wrist], 3)
    ripple = np.outer(gears * _RIPPLE_MRAD * factor, [1.0, _SECOND_HARMONIC])
    compliance = np.diag(_COMPLIANCE_MRAD_PER_KNM * rng.uniform(0.7, 1.3, 6))
    compliance[1, 2] = compliance[2, 1] = _COUPLING_MRAD_PER_KNM * rng.uniform(0.7, 1.3)
    drift = np.zeros((6, 6))
    drift[1:4, :3] = _DRIFT_MM * rng.standard_normal((3, 3))
    drift[:2, 3:] = _DRIFT_MRAD * 1e-3 * rng.standard_normal((2, 3))
    return Beyond(
        compliance=compliance * factor[:, None],
        ripple_rad=1e-3 * ripple * rng.uniform(0.7, 1.3, (6, 2)),
        ripple_phase_rad=rng.uniform(0.0, 2.0 * np.pi, (6, 2)),
        gear_ratio=_GEAR_RATIO,
        backlash_rad=1e-3 * _BACKLASH_MRAD * factor * rng.uniform(0.7, 1.3, 6),
        drift=drift * factor[:, None],
        repeatability_rad=1e-3 * _REPEATABILITY_MRAD * factor,
    )

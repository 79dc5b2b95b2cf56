"""The synthetic arm itself: geometry, smooth joint errors, and what no VEC model can represent.

Every effect is an error of one joint frame, in front of that joint's motion as in eq. 5, but with
true rotations: (delta_x, delta_y, delta_z, eps_x, eps_y, eps_z) in mm and rad.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinacc.geometry import Pose, exp_so3
from kinacc.kinematics import chain as frames_of
from kinacc.kinematics import dh
from kinacc.kinematics.dh import DHModel

# Masses of a machining arm of this class: (frame the mass hangs on, share of the way to it from
# the frame before, kg). The last one is the spindle, beyond the flange.
_MASSES = ((2, 0.5, 250.0), (4, 0.4, 260.0), (6, 0.5, 70.0), (6, 2.0, 120.0))
_GRAVITY = np.array([0.0, 0.0, -9.81])
_UP_TO_SPEED_H = 1.5  # time constant of warming up


@dataclass(frozen=True)
class Smooth:
    """Errors that depend on their own joint alone: waves over its working range.

    ``amplitude`` and ``phase_rad`` (6, 6, K): joint, error (mm and rad), number k of half periods
    over ``q_min_rad``..``q_max_rad`` (6,) less one. Beyond the range an error keeps its end value.
    """

    q_min_rad: np.ndarray
    q_max_rad: np.ndarray
    amplitude: np.ndarray
    phase_rad: np.ndarray


@dataclass(frozen=True)
class Beyond:
    """What a VEC model cannot represent, joint by joint.

    ``compliance`` (6, 6): turns of the joints (mrad) per gravity torque (kN m), coupling 2 and 3;
    ``ripple_rad`` (6, 2): once and twice per motor turn, with ``ripple_phase_rad`` (6, 2) and
    ``gear_ratio`` (6,); ``backlash_rad`` (6,): half gaps, closing under gravity torque;
    ``drift`` (6, 6): errors after warming up (mm and rad); ``repeatability_rad`` (6,): standard
    deviations from visit to visit.
    """

    compliance: np.ndarray
    ripple_rad: np.ndarray
    ripple_phase_rad: np.ndarray
    gear_ratio: np.ndarray
    backlash_rad: np.ndarray
    drift: np.ndarray
    repeatability_rad: np.ndarray


@dataclass(frozen=True)
class PhysicalRobot:
    """The arm that is measured in place of a real one."""

    dh: DHModel
    smooth: Smooth
    beyond: Beyond


@dataclass(frozen=True)
class Visits:
    """How the arm came to n poses: ``q_rad`` (n, 6), travel directions ``s`` (n, 6) of -1 or +1,
    ``time_h`` (n,) since the cold start, ``jitter`` (n, 6) standard normal, per joint and visit.
    """

    q_rad: np.ndarray
    s: np.ndarray
    time_h: np.ndarray
    jitter: np.ndarray


def pose(robot: PhysicalRobot, visits: Visits) -> Pose:
    """True flange poses (n, ...) in the robot base."""
    joint_errors = smooth_errors(robot.smooth, visits.q_rad)
    joint_errors = joint_errors + beyond_errors(robot.beyond, robot.dh, visits)
    return chain(robot.dh, visits.q_rad, joint_errors)


def chain(geometry: DHModel, q_rad: np.ndarray, joint_errors: np.ndarray) -> Pose:
    """Flange poses (n, ...) of the arm with errors (n, 6, 6) in front of its joints."""
    turns = exp_so3(joint_errors[..., 3:])
    frames = frames_of.start(len(q_rad))
    for joint in range(q_rad.shape[1]):
        turn = turns[:, joint]
        x, y, z = (
            frames.x * turn[:, 0, i] + frames.y * turn[:, 1, i] + frames.z * turn[:, 2, i]
            for i in range(3)
        )
        dx, dy, dz = joint_errors[:, joint, :3].T
        p_mm = frames.p_mm + dx * frames.x + dy * frames.y + dz * frames.z
        moved = frames_of.Columns(x, y, z, p_mm)
        *_, frames = frames_of.across(geometry, joint, moved, q_rad[:, joint])
    return frames_of.to_pose(frames)


def smooth_errors(smooth: Smooth, q_rad: np.ndarray) -> np.ndarray:
    """Smooth errors (n, 6, 6) in mm and rad."""
    share = (q_rad - smooth.q_min_rad) / (smooth.q_max_rad - smooth.q_min_rad)
    halves = np.arange(1, smooth.amplitude.shape[-1] + 1)
    angle = np.pi * np.clip(share, 0.0, 1.0)[:, :, None, None] * halves + smooth.phase_rad
    return np.sum(smooth.amplitude * np.cos(angle), axis=-1)


def beyond_errors(beyond: Beyond, geometry: DHModel, visits: Visits) -> np.ndarray:
    """Errors (n, 6, 6) in mm and rad that no VEC model can represent."""
    torque = gravity_torque_knm(geometry, visits.q_rad)
    motor = visits.q_rad * beyond.gear_ratio
    turn = torque @ beyond.compliance.T * 1e-3
    for harmonic in range(2):
        phase = beyond.ripple_phase_rad[:, harmonic]
        turn += beyond.ripple_rad[:, harmonic] * np.sin((harmonic + 1) * motor + phase)
    # Load presses the teeth together: little play is left under the torque of a stretched arm.
    turn += visits.s * beyond.backlash_rad / (1.0 + np.abs(torque))
    turn += beyond.repeatability_rad * visits.jitter
    warmth = 1.0 - np.exp(-visits.time_h / _UP_TO_SPEED_H)
    found = warmth[:, None, None] * beyond.drift
    found[:, :, 5] += turn
    return found


def gravity_torque_knm(geometry: DHModel, q_rad: np.ndarray) -> np.ndarray:
    """Torques of gravity (n, 6) about the joint axes in kN m."""
    frames = dh.chain(geometry, q_rad)
    axes, origins = frames.rotation[:, :6, :, 2], frames.position_mm[:, :6] * 1e-3
    torque = np.zeros(axes.shape[:2])
    for frame, share, mass_kg in _MASSES:
        start, end = frames.position_mm[:, frame - 1], frames.position_mm[:, frame]
        if frame == 6:
            start = frames.position_mm[:, 4]  # the wrist centre
        centre = (start + share * (end - start)) * 1e-3
        arms = centre[:, None, :] - origins
        moments = np.cross(arms, mass_kg * _GRAVITY) * 1e-3
        carried = np.arange(6) < frame
        torque += np.einsum("nki,nki->nk", moments, axes) * carried
    return torque

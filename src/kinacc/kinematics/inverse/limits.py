"""Which turn of a joint is taken, and which joints an arm can reach.

Joints are DH joints in rad, mm where they slide, unless they are called reported joints.
"""

from __future__ import annotations

import numpy as np

from kinacc.kinematics.robot import Robot

_TWO_PI = 2.0 * np.pi
_ROUND_OFF_RAD = 1e-12
_TIE_RAD = 1e-9
_OUTSIDE = 100.0  # more than any angle in rad that is compared


def reported_joints(robot: Robot, q_rad: np.ndarray) -> np.ndarray:
    """Convert DH joints to joints as the controller reports them.

    Parameters
    ----------
    robot : Robot
        Arm of k joints.
    q_rad : numpy.ndarray
        DH joints, shape (..., k), rad (mm where a joint slides).

    Returns
    -------
    numpy.ndarray
        Reported joints, shape (..., k).
    """
    return q_rad @ np.linalg.inv(robot.joint_map).T


def dh_limits(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Limits of the DH joints.

    Parameters
    ----------
    robot : Robot
        Arm of k joints.

    Returns
    -------
    tuple of numpy.ndarray
        Ends (k,), (k,), rad (mm where a joint slides); infinite where a joint is coupled to others.
    """
    free, ends = uncoupled(robot), np.stack([robot.q_min_rad, robot.q_max_rad])
    low, high = np.sort(np.diagonal(robot.joint_map) * ends, axis=0)
    return np.where(free, low, -np.inf), np.where(free, high, np.inf)


def cut_to_range(
    robot: Robot,
    low: np.ndarray,
    high: np.ndarray,
    range_rad: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """A box of reported joints cut to a range of DH joints where these are uncoupled.

    Parameters
    ----------
    robot : Robot
        Arm of k joints.
    low, high : numpy.ndarray
        Ends of the box of reported joints, shape (k,).
    range_rad : tuple of numpy.ndarray
        Ends (k,), (k,) of the range of DH joints.

    Returns
    -------
    tuple of numpy.ndarray
        Ends (k,), (k,) of the smaller box.
    """
    free = uncoupled(robot)
    least, most = np.sort(range_rad / np.where(free, np.diagonal(robot.joint_map), 1.0), axis=0)
    return np.where(free, np.maximum(low, least), low), np.where(free, np.minimum(high, most), high)


def uncoupled(robot: Robot) -> np.ndarray:
    """Test whether a reported joint moves the DH joint of its number and no other joint does.

    Parameters
    ----------
    robot : Robot
        Arm of k joints.

    Returns
    -------
    numpy.ndarray
        Booleans, shape (k,).
    """
    present = robot.joint_map != 0.0
    return np.diagonal(present) & (present.sum(axis=0) == 1) & (present.sum(axis=1) == 1)


def within_limits(robot: Robot, q_rad: np.ndarray) -> np.ndarray:
    """Test whether DH joints respect the limits of the reported joints.

    Parameters
    ----------
    robot : Robot
        Arm of k joints.
    q_rad : numpy.ndarray
        DH joints, shape (..., k), rad (mm where a joint slides).

    Returns
    -------
    numpy.ndarray
        Booleans, shape (...).
    """
    return within(reported_joints(robot, q_rad), robot.q_min_rad, robot.q_max_rad)


def within(q_rad: np.ndarray, lower_rad: np.ndarray, upper_rad: np.ndarray) -> np.ndarray:
    """Test whether joints lie in a box, its faces included.

    Parameters
    ----------
    q_rad : numpy.ndarray
        Joints, shape (..., k), rad (mm where a joint slides).
    lower_rad, upper_rad : numpy.ndarray
        Ends of the box, each (k,).

    Returns
    -------
    numpy.ndarray
        Booleans, shape (...).
    """
    return ~np.any(outside(q_rad, (lower_rad, upper_rad), _ROUND_OFF_RAD), axis=-1)


def outside(
    q_rad: np.ndarray,
    box: tuple[np.ndarray, np.ndarray] | None,
    slack: np.ndarray | float = 1e-9,
) -> np.ndarray:
    """Test joint by joint whether joints lie outside a box, as NaN does.

    Parameters
    ----------
    q_rad : numpy.ndarray
        Joints, shape (..., k), rad (mm where a joint slides).
    box : tuple of numpy.ndarray or None
        Ends (k,), (k,); None: no joint is outside.
    slack : numpy.ndarray or float
        Distance beyond the ends that is allowed, rad (mm).

    Returns
    -------
    numpy.ndarray
        Booleans, shape (..., k).
    """
    if box is None:
        return np.zeros(q_rad.shape, dtype=bool)
    low, high = box
    return ~((q_rad >= low - slack) & (q_rad <= high + slack))


def take_turns(
    robot: Robot,
    q_rad: np.ndarray,
    preferred_rad: tuple[np.ndarray, np.ndarray] | None = None,
    near_rad: np.ndarray | float = 0.0,
    slack: float = _ROUND_OFF_RAD,
) -> np.ndarray:
    """Joints moved by whole turns: inside the limits, inside the preferred box, near others.

    Of all turns within the limits the one within ``preferred_rad`` that is nearest to ``near_rad``
    is taken; where none lies within both, the one within the limits that is nearest; where none
    does, the one at most half a turn away. Joints that slide stay.

    Parameters
    ----------
    robot : Robot
        Arm of k joints, whose limits hold; those of coupled joints hold as reported.
    q_rad : numpy.ndarray
        DH joints, shape (..., k).
    preferred_rad : tuple of numpy.ndarray, optional
        Ends (k,), (k,) of the DH joints a model was fitted over: a Chebyshev error differs between
        q and q + 2 pi.
    near_rad : numpy.ndarray or float
        DH joints, shape (..., k).
    slack : float
        Distance beyond limits and box that is allowed.

    Returns
    -------
    numpy.ndarray
        DH joints, shape (..., k).
    """
    # Half a turn is a tie that round-off must not decide: it counts as +pi.
    apart = q_rad - near_rad
    apart = apart - _TWO_PI * np.rint(apart / _TWO_PI)
    apart = np.where(apart < -np.pi + _TIE_RAD, apart + _TWO_PI, apart)
    # These reach every turn a +-720 degree joint has.
    angle = near_rad + np.stack([apart + turns * _TWO_PI for turns in (0, -1, 1, -2, 2)])
    cost = np.abs(angle - near_rad)
    cost += 2.0 * _OUTSIDE * outside(angle, dh_limits(robot), slack)
    cost += _OUTSIDE * outside(angle, preferred_rad, slack)
    best = np.take_along_axis(angle, cost.argmin(axis=0)[None], axis=0)[0]
    best = np.where(robot.dh.prismatic, q_rad, best)
    # Turns of coupled joints, where a whole turn of a reported joint is one of DH joints too.
    whole, coupled = np.rint(robot.joint_map), ~uncoupled(robot)
    if not coupled.any() or not np.array_equal(whole, robot.joint_map):
        return best
    reported = reported_joints(robot, best)
    low, high = robot.q_min_rad - _ROUND_OFF_RAD, robot.q_max_rad + _ROUND_OFF_RAD
    turns = np.ceil(np.maximum(low - reported, 0.0) / _TWO_PI)
    turns -= np.ceil(np.maximum(reported - high, 0.0) / _TWO_PI)
    moved = reported + _TWO_PI * turns
    fits = coupled & (moved >= low) & (moved <= high)
    return best + _TWO_PI * (np.where(fits, turns, 0.0) @ whole.T)

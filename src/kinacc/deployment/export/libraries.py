"""The calibrated DH model as objects of Pinocchio and pybotics, where these are installed."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from kinacc.deployment.export.formats import urdf
from kinacc.deployment.export.source import Source
from kinacc.geometry import Pose, compose

_PARALLEL = 1e-12  # sine of the angle between two axes


def to_pinocchio(source: Source) -> Any:
    """A ``pinocchio.Model`` of the calibrated arm (m, rad), with frames ``flange`` and ``tool``.

    Joints are those that the controller reports. Raises InputError where these are coupled.
    """
    import pinocchio

    return pinocchio.buildModelFromXML(urdf.generated(source))


def to_pybotics(source: Source, point: str | None) -> Any:
    """A ``pybotics.robot.Robot`` of the calibrated arm (mm, rad) with ``point`` as its tool.

    Joints are those of the DH table, ``robot.dh_joints(q_rad)``.
    """
    from pybotics.kinematic_chain import MDHKinematicChain
    from pybotics.link import PrismaticMDHLink, RevoluteMDHLink
    from pybotics.robot import Robot
    from pybotics.tool import Tool

    base, parameters, end = modified_dh(source, point)
    slides = source.dh.prismatic
    links = [
        (PrismaticMDHLink if slide else RevoluteMDHLink)(*row)
        for slide, row in zip(slides, parameters, strict=True)
    ]
    chain = MDHKinematicChain(links)
    return Robot(chain, tool=Tool(_matrix(end)), world_frame=_matrix(base))


def modified_dh(source: Source, point: str | None) -> tuple[Pose, np.ndarray, Pose]:
    """The arm with modified DH parameters, after Craig: Rx(alpha) Tx(a) Rz(theta) Tz(d) a joint.

    Returns
    -------
    Base of the first axis, rows alpha (rad), a (mm), theta (rad), d (mm) of all k joints, and the
    pose of ``point`` in the last joint's frame.
    """
    calibration = source.calibration
    (first, *between), end = urdf.origins(source.dh)
    parameters = np.zeros((calibration.model.joints, 4))
    for joint, step in enumerate(between, start=1):
        around, alpha, theta = _about_z_x_z(step)
        a, across, up = Rotation.from_euler("z", -around).apply(step.position_mm)
        d = -across / np.sin(alpha) if abs(np.sin(alpha)) > _PARALLEL else 0.0
        parameters[joint] = alpha, a, theta, d
        parameters[joint - 1, 2:] += around, up - d * np.cos(alpha)
    base = compose(calibration.robot.base, first)
    return base, parameters, compose(end, calibration.point(point))


def _about_z_x_z(step: Pose) -> tuple[float, float, float]:
    """Angles about z, x and z from an axis to the next; parallel ones: first towards the next."""
    turn = Rotation.from_matrix(step.rotation)
    if np.hypot(*step.rotation[:2, 2]) > _PARALLEL:
        return tuple(turn.as_euler("ZXZ"))
    around = np.arctan2(step.position_mm[1], step.position_mm[0])
    alpha = 0.0 if step.rotation[2, 2] > 0.0 else np.pi
    rest = Rotation.from_euler("ZX", [around, alpha]).inv() * turn
    return around, alpha, rest.as_rotvec()[2]


def _matrix(pose: Pose) -> np.ndarray:
    """A pose as (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = pose.rotation, pose.position_mm
    return matrix

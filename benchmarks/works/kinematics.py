"""Kinematics

Many poses at once beside pinocchio, py-opw-kinematics and robotics-toolbox.

The inverse gives all postures of a *calibrated* arm, each verified to 1e-6 mm; py-opw-kinematics
gives those of the nominal arm, which has a closed form (``reach`` all of a pose, ``batch_inverse``
one a pose), robotics-toolbox's ``ik_LM`` one posture of the calibrated arm. Poses at which the
Jacobian of a posture has a condition above ``WORST_CONDITION`` (a radian as a metre) are left out
on all sides. Arms without a closed form are searched by a table of postures and are not measured.

Kinematics are written in numpy, a pose beside the other: some 3 million poses a second and core.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import import_module
from importlib.metadata import version

import numpy as np
from harness import Contender, Work

from kinacc.geometry import Pose, rotation_x, rotation_y, rotation_z
from kinacc.kinematics import dh, inverse, robot
from kinacc.kinematics.inverse import closed_form
from kinacc.kinematics.model import JointState

POSES, GOALS, FEW_GOALS = 200_000, 20_000, 60
WORST_CONDITION = 100.0
ARM = robot.load("mh180")
Run = Callable[[], object]


def works(smoke: bool) -> list[Work]:
    """Forward kinematics and Jacobians of the calibrated MH180, and its inverse."""
    model, q_rad = problem(smoke)
    poses = len(q_rad)
    goal, found = goals(smoke)
    few = 2 if smoke else FEW_GOALS

    def joint_jacobian() -> object:
        return *dh.forward(model, q_rad), model.joint_jacobian(JointState(q_rad))

    return [
        _work("forward kinematics", "pose", poses, lambda: tuple(dh.forward(model, q_rad)),
              _with("pinocchio", "pin", _pinocchio, q_rad, False), _agree, {"pinocchio": 2.0}),
        _work("forward kinematics and joint Jacobian", "pose", poses, joint_jacobian,
              _with("pinocchio", "pin", _pinocchio, q_rad, True), _agree, {"pinocchio": 1.0}),
        _work("inverse, all branches", "solution", int(found.sum()), _inverse(smoke),
              _with("py_opw_kinematics", "py-opw-kinematics", _opw, goal, found),
              _verified(goal, found)),
        _work("inverse, all branches, few poses", "solution", int(found[:few].sum()),
              _inverse(smoke, slice(few)),
              _with("roboticstoolbox", "roboticstoolbox-python", _toolbox, goal, found, few),
              _verified(goal, found, few), {"robotics-toolbox, ik_LM": 10.0}),
    ]  # fmt: skip


def _work(name, unit, count, own: Run, others: Sequence[Contender], agree, wanted=None) -> Work:
    own = Contender("kinacc", version("kinacc"), own)
    return Work(name, unit, count, (own, *others), agree, wanted or {})


def _with(module: str, package: str, made: Callable, *given) -> list[Contender]:
    """What a library runs, by name; nothing where it is not installed."""
    try:
        library = import_module(module)
    except ImportError:
        return []
    runs = made(library, *given)
    return [Contender(name, version(package), run) for name, run in runs.items()]


@functools.cache
def problem(smoke: bool):
    """The calibrated arm, a DH model off its table in every parameter, and joints (n, 6)."""
    rng = np.random.default_rng(0)
    sizes = dict(zip(dh.PARAMETERS, (1e-3, 0.3, 0.3, 5e-4, 5e-4), strict=True))
    changed = {
        name: getattr(ARM.dh, name) + size * rng.normal(size=6) for name, size in sizes.items()
    }
    share = rng.uniform(0.05, 0.95, (200 if smoke else POSES, 6))
    joints = ARM.q_min_rad + share * (ARM.q_max_rad - ARM.q_min_rad)
    return replace(ARM.dh, **changed), ARM.dh_joints(joints)


def _agree(outputs: Sequence[object]) -> None:
    """Positions and levers to 1e-9 mm, axes to 1e-12."""
    for other in outputs[1:]:
        for one, two in zip(outputs[0], other, strict=True):
            np.testing.assert_allclose(two, one, rtol=1e-12, atol=1e-9 if one.ndim != 3 else 1e-8)


def _pinocchio(pin, q_rad: np.ndarray, slopes_too: bool) -> dict[str, Run]:
    """The same arm, joint by joint with the fixed rest of its row, and its loop over poses."""
    model, _ = problem(True)
    arm, place, parent = pin.Model(), pin.SE3.Identity(), 0
    for i in range(6):
        parent = arm.addJoint(parent, pin.JointModelRZ(), place, f"j{i + 1}")
        turn = rotation_z(model.theta_offset_rad[i])
        rest = rotation_x(model.alpha_rad[i]) @ rotation_y(model.beta_rad[i])
        shift = turn @ np.array([model.a_mm[i], 0.0, model.d_mm[i]])
        place = pin.SE3(turn @ rest, shift)
    frame = arm.addFrame(pin.Frame("flange", parent, 0, place, pin.FrameType.OP_FRAME))
    data, seen = arm.createData(), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    found = [np.zeros((len(q_rad), *shape)) for shape in ((3, 3), (3,), (6, 6))[: 2 + slopes_too]]

    def run() -> object:
        for i, q in enumerate(q_rad):
            if slopes_too:
                found[2][i] = pin.computeFrameJacobian(arm, data, q, frame, seen)
            else:
                pin.forwardKinematics(arm, data, q)
            at = pin.updateFramePlacement(arm, data, frame)
            found[0][i], found[1][i] = at.rotation, at.translation
        return tuple(found)

    return {"pinocchio": run}


@functools.cache
def goals(smoke: bool):
    """Rotations and positions to reach, and which branches (n, 8) the nominal arm has there."""
    model, q_rad = problem(smoke)
    pose = dh.forward(model, q_rad[: 50 if smoke else GOALS])
    start, found = closed_form.recognise(ARM.dh).solve(pose, closed_form.Start())
    slopes = model.joint_jacobian(JointState(np.nan_to_num(start).reshape(-1, 6)))
    slopes[:, 3:] *= 1000.0
    condition = np.linalg.cond(slopes).reshape(found.shape)
    keep = np.where(found, condition, 0.0).max(axis=1) < WORST_CONDITION
    return (pose.rotation[keep], pose.position_mm[keep]), found[keep]


def _inverse(smoke: bool, part: slice = slice(None)) -> Run:
    model, _ = problem(smoke)
    goal = Pose(*(each[part] for each in goals(smoke)[0]))
    return lambda: (inverse.solve(ARM, model, goal).q_rad,)


def _verified(goal, found: np.ndarray, few: int | None = None) -> Callable:
    def agree(outputs: Sequence[object]) -> None:
        """kinacc's joints lead back to the poses, all of them; others say where theirs lead."""
        model, _ = problem(True)
        turn, at = (each[:few] for each in goal)
        for output in outputs:
            if len(output) == 1:  # joints of kinacc
                [q_rad] = output
                row, branch = np.nonzero(np.isfinite(q_rad).all(axis=2))
                back = dh.forward(model, q_rad[row, branch])
                np.testing.assert_allclose(back.position_mm, at[row], rtol=0, atol=1e-6)
                np.testing.assert_allclose(back.rotation, turn[row], rtol=0, atol=1e-8)
            else:
                row, back_mm = output
                np.testing.assert_allclose(back_mm(), at[row], rtol=0, atol=1e-4)
            assert len(row) == found[:few].sum()

    return agree


def _opw(opw, goal, found: np.ndarray) -> dict[str, Run]:
    from scipy.spatial.transform import RigidTransform

    arm = opw.Robot(  # the table of the MH180 in metres; base and flange have the same frames
        opw.KinematicModel(a1=0.325, a2=-0.3, b=0.0, c1=0.0, c2=1.15, c3=1.225, c4=0.225),
        degrees=False,
    )
    matrices = np.tile(np.eye(4), (len(found), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = goal[0], goal[1] / 1000.0
    pose, row = RigidTransform.from_matrix(matrices), np.nonzero(found)[0]
    each = RigidTransform.from_matrix(matrices[row])

    def back_mm(q_rad: np.ndarray) -> np.ndarray:
        return arm.batch_forward(q_rad).as_matrix()[:, :3, 3] * 1000.0

    def all_of_a_pose() -> object:
        q_rad = arm.reach(pose).joints
        at = np.nonzero(np.isfinite(q_rad).all(axis=2))
        return at[0], lambda: back_mm(np.ascontiguousarray(q_rad[at]))

    def one_of_a_pose() -> object:
        q_rad = arm.batch_inverse(each)
        return row, lambda: back_mm(q_rad)

    names = ("py-opw-kinematics, batch_inverse", "py-opw-kinematics, reach")
    return dict(zip(names, (one_of_a_pose, all_of_a_pose), strict=True))


def _toolbox(toolbox, goal, found: np.ndarray, few: int) -> dict[str, Run]:
    model, _ = problem(True)
    make, arm = toolbox.ET, toolbox.ETS()
    for i in range(6):  # a list of turns and shifts: not for *=
        arm = arm * make.Rz() * make.Rz(model.theta_offset_rad[i]) * make.tz(model.d_mm[i] / 1e3)
        arm = arm * make.tx(model.a_mm[i] / 1e3) * make.Rx(model.alpha_rad[i])
        arm = arm * make.Ry(model.beta_rad[i])
    row = np.nonzero(found[:few])[0]
    matrices = np.tile(np.eye(4), (len(row), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = goal[0][row], goal[1][row] / 1000.0

    def run() -> object:
        q_rad = [arm.ik_LM(matrix, tol=1e-16).q for matrix in matrices]  # 1e-8 m
        return row, lambda: np.array([np.asarray(arm.fkine(q))[:3, 3] for q in q_rad]) * 1e3

    return {"robotics-toolbox, ik_LM": run}

"""Kinematics

Many poses at once beside pinocchio, py-opw-kinematics and robotics-toolbox.

The inverse gives all postures of a *calibrated* arm, each verified to 1e-6 mm; py-opw-kinematics
gives those of the nominal arm, which has a closed form (``reach`` all of a pose, ``batch_inverse``
one a pose), robotics-toolbox's ``ik_LM`` one posture of the calibrated arm. Poses at which the
Jacobian of a posture has a condition above ``WORST_CONDITION`` (a radian as a metre) are left out
on all sides. Arms without a closed form are searched by a table of postures and are not measured.

Limits. *Memory*: a pose of six joints is read as 48 bytes and written as 96; its Jacobian in the
joints has 288 bytes, in the parameters 1,440. At 10 GB/s these take 10, 29 and 144 ns. Kinematics
are written in numpy, a pose beside the other: some 3 million poses a second and core.
"""

from __future__ import annotations

import functools
import importlib.metadata
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from harness import Contender, Work

POSES = 200_000
GOALS, FEW_GOALS = 20_000, 60
WORST_CONDITION = 100.0


def works(smoke: bool) -> list[Work]:
    """Forward kinematics and Jacobians of the calibrated MH180, and its inverse."""
    count = 200 if smoke else POSES
    _, q_rad = problem(smoke)
    each_ns = _write_ns(1 << 20 if smoke else 1 << 28)
    goal, found = goals(smoke)
    few = 2 if smoke else FEW_GOALS
    return [
        Work(
            "forward kinematics", "pose", count,
            (_kinacc(_forward(smoke)), *_pinocchio(q_rad, _pinocchio_forward)),
            _agree, {"pinocchio": 2.0},
            96 * each_ns, "96 bytes a pose at the write bandwidth",
        ),
        Work(
            "forward kinematics and joint Jacobian", "pose", count,
            (
                _kinacc(_joint_jacobian(smoke)),
                *_pinocchio(q_rad, _pinocchio_slopes),
            ),
            _agree, {"pinocchio": 1.0}, 384 * each_ns, "384 bytes a pose at the write bandwidth",
        ),
        Work(
            "forward kinematics and parameter Jacobian", "pose", count // 2,
            (_kinacc(_parameter_jacobian(smoke, count // 2)),), _agree,
            {}, 1536 * each_ns, "1,536 bytes a pose at the write bandwidth",
        ),
        Work(
            "inverse, all branches", "solution", int(found.sum()),
            (_kinacc(_inverse(smoke)), *_opw(goal, found)), _verified(goal, found),
            {},
        ),
        Work(
            "inverse, all branches, few poses", "solution", int(found[:few].sum()),
            (_kinacc(_inverse(smoke, slice(few))), *_toolbox(goal, found, few)),
            _verified(goal, found, few), {"robotics-toolbox, ik_LM": 10.0},
        ),
    ]  # fmt: skip


def _kinacc(run: Callable[[], object], name: str = "kinacc") -> Contender:
    return Contender(name, _version("kinacc"), run)


def _write_ns(size_bytes: int) -> float:
    """CPU time in which a thread writes a byte into memory that is there; least of seven."""
    array, taken_s = np.zeros(size_bytes // 8), []
    for value in range(7):
        begin = time.process_time()
        array.fill(value)
        taken_s.append(time.process_time() - begin)
    return 1e9 * min(taken_s) / size_bytes


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return ""


@functools.cache
def problem(smoke: bool):
    """The calibrated arm, a DH model off its table in every parameter, and joints (n, 6)."""
    from kinacc.kinematics import robot

    rng = np.random.default_rng(0)
    arm = robot.load("mh180")
    table = arm.dh
    model = replace(
        table,
        theta_offset_rad=table.theta_offset_rad + 1e-3 * rng.normal(size=6),
        d_mm=table.d_mm + 0.3 * rng.normal(size=6),
        a_mm=table.a_mm + 0.3 * rng.normal(size=6),
        alpha_rad=table.alpha_rad + 5e-4 * rng.normal(size=6),
        beta_rad=5e-4 * rng.normal(size=6),
    )
    share = rng.uniform(0.05, 0.95, (200 if smoke else POSES, 6))
    return model, arm.dh_joints(arm.q_min_rad + share * (arm.q_max_rad - arm.q_min_rad))


def _forward(smoke: bool) -> Callable[[], object]:
    from kinacc.kinematics import dh

    model, q_rad = problem(smoke)
    return lambda: tuple(dh.forward(model, q_rad))


def _joint_jacobian(smoke: bool) -> Callable[[], object]:
    from kinacc.kinematics import dh

    model, q_rad = problem(smoke)
    return lambda: (*dh.forward(model, q_rad), dh.joint_jacobian(model, q_rad))


def _parameter_jacobian(smoke: bool, count: int) -> Callable[[], object]:
    from kinacc.kinematics import dh

    model, q_rad = problem(smoke)
    return lambda: dh.pose_and_parameter_jacobian(model, q_rad[:count])


def _agree(outputs: Sequence[object]) -> None:
    """Positions and levers to 1e-9 mm, axes to 1e-12."""
    first = outputs[0]
    for other in outputs[1:]:
        for one, two in zip(first, other, strict=True):
            np.testing.assert_allclose(two, one, rtol=1e-12, atol=1e-9 if one.ndim != 3 else 1e-8)


def _pinocchio(q_rad: np.ndarray, made: Callable) -> tuple[Contender, ...]:
    try:
        import pinocchio
    except ImportError:
        return ()
    return (Contender("pinocchio", pinocchio.__version__, made(pinocchio, q_rad)),)


def _pinocchio_model(pin):
    """The same arm: joint, then the fixed rest of its row."""
    from kinacc.geometry import rotation_x, rotation_y, rotation_z

    model, _ = problem(True)
    arm, place, parent = pin.Model(), pin.SE3.Identity(), 0
    for i in range(6):
        parent = arm.addJoint(parent, pin.JointModelRZ(), place, f"j{i + 1}")
        turn = rotation_z(model.theta_offset_rad[i])
        rest = rotation_x(model.alpha_rad[i]) @ rotation_y(model.beta_rad[i])
        shift = turn @ np.array([model.a_mm[i], 0.0, model.d_mm[i]])
        place = pin.SE3(turn @ rest, shift)
    frame = arm.addFrame(pin.Frame("flange", parent, 0, place, pin.FrameType.OP_FRAME))
    return arm, arm.createData(), frame


def _pinocchio_forward(pin, q_rad: np.ndarray) -> Callable[[], object]:
    arm, data, frame = _pinocchio_model(pin)
    turn, at = np.zeros((len(q_rad), 3, 3)), np.zeros((len(q_rad), 3))

    def run() -> object:
        for i, q in enumerate(q_rad):
            pin.forwardKinematics(arm, data, q)
            place = pin.updateFramePlacement(arm, data, frame)
            turn[i], at[i] = place.rotation, place.translation
        return turn, at

    return run


def _pinocchio_slopes(pin, q_rad: np.ndarray) -> Callable[[], object]:
    arm, data, frame = _pinocchio_model(pin)
    turn, at = np.zeros((len(q_rad), 3, 3)), np.zeros((len(q_rad), 3))
    slopes, seen = np.zeros((len(q_rad), 6, 6)), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

    def run() -> object:
        for i, q in enumerate(q_rad):
            slopes[i] = pin.computeFrameJacobian(arm, data, q, frame, seen)
            place = pin.updateFramePlacement(arm, data, frame)
            turn[i], at[i] = place.rotation, place.translation
        return turn, at, slopes

    return run


@functools.cache
def goals(smoke: bool):
    """Rotations and positions to reach, and which branches (n, 8) the nominal arm has there."""
    from kinacc.kinematics import dh, robot
    from kinacc.kinematics.inverse import closed_form

    model, q_rad = problem(smoke)
    pose = dh.forward(model, q_rad[: 50 if smoke else GOALS])
    arm = robot.load("mh180")
    start, found = closed_form.recognise(arm.dh).solve(pose, closed_form.Start())
    slopes = dh.joint_jacobian(model, np.nan_to_num(start).reshape(-1, 6))
    slopes[:, 3:] *= 1000.0
    condition = np.linalg.cond(slopes).reshape(found.shape)
    keep = np.where(found, condition, 0.0).max(axis=1) < WORST_CONDITION
    return (pose.rotation[keep], pose.position_mm[keep]), found[keep]


def _inverse(smoke: bool, part: slice = slice(None)) -> Callable[[], object]:
    from kinacc.geometry import Pose
    from kinacc.kinematics import inverse, robot

    arm, (model, _) = robot.load("mh180"), problem(smoke)
    goal = Pose(*(each[part] for each in goals(smoke)[0]))
    return lambda: (inverse.solve(arm, model, goal).q_rad,)


def _verified(goal, found: np.ndarray, few: int | None = None) -> Callable:
    def agree(outputs: Sequence[object]) -> None:
        """kinacc's joints lead back to the poses, all of them; others say where theirs lead."""
        from kinacc.kinematics import dh

        model, _ = problem(True)
        turn, at = (each[:few] for each in goal)
        for output in outputs:
            if len(output) == 1:  # joints of kinacc
                [q_rad] = output
                row, branch = np.nonzero(np.isfinite(q_rad).all(axis=2))
                assert len(row) == found[:few].sum()
                back = dh.forward(model, q_rad[row, branch])
                np.testing.assert_allclose(back.position_mm, at[row], rtol=0, atol=1e-6)
                np.testing.assert_allclose(back.rotation, turn[row], rtol=0, atol=1e-8)
            else:
                row, _, back_mm = output
                assert len(row) == found[:few].sum()
                np.testing.assert_allclose(back_mm(), at[row], rtol=0, atol=1e-4)

    return agree


def _opw(goal, found: np.ndarray) -> tuple[Contender, ...]:
    try:
        import py_opw_kinematics as opw
        from scipy.spatial.transform import RigidTransform
    except ImportError:
        return ()
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
        return at[0], q_rad, lambda: back_mm(np.ascontiguousarray(q_rad[at]))

    def one_of_a_pose() -> object:
        q_rad = arm.batch_inverse(each)
        return row, q_rad, lambda: back_mm(q_rad)

    version = _version("py-opw-kinematics")
    return (
        Contender("py-opw-kinematics, batch_inverse", version, one_of_a_pose),
        Contender("py-opw-kinematics, reach", version, all_of_a_pose),
    )


def _toolbox(goal, found: np.ndarray, few: int) -> tuple[Contender, ...]:
    try:
        import roboticstoolbox as toolbox
    except ImportError:
        return ()
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
        return row, q_rad, lambda: np.array([np.asarray(arm.fkine(q))[:3, 3] for q in q_rad]) * 1e3

    return (Contender("robotics-toolbox, ik_LM", _version("roboticstoolbox-python"), run),)

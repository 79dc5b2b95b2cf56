"""Kinematics

Many poses at once beside pinocchio, C, py-opw-kinematics and robotics-toolbox.

The inverse gives all postures of a *calibrated* arm, each verified to 1e-9 mm; py-opw-kinematics
gives those of the nominal arm, which has a closed form (``reach`` all of a pose, ``batch_inverse``
one a pose), robotics-toolbox's ``ik_LM`` one posture of the calibrated arm. Poses at which the
Jacobian of a posture has a condition above ``WORST_CONDITION`` (a radian as a metre) are left out
on all sides. Arms without a closed form are searched by a table of postures and are not measured.

Limits. *Memory*: a pose of six joints is read as 48 bytes and written as 96; its Jacobian in the
joints has 288 bytes, in the parameters 1,440. At 10 GB/s these take 10, 29 and 144 ns.
*Arithmetic*: a joint costs one sine and cosine (about 50 operations, 41 of them sums and products)
and 51 sums and products of the frame: 600 a pose. Four at once (AVX2) with two units at 3 GHz:
25 ns, half where products and sums are fused, which kinacc does not do, so that its bits are those
of its plain code. The C kernel fuses. *Gram matrix* of the Jacobian in 30 parameters: 12 columns
have no rotation, so 3 x 465 + 3 x 171 = 1,908 products and sums, 80 ns four at once: three times
the rate of 60 % of the write bandwidth (57 ns a pose at 14 GB/s) is beyond one core with AVX2.
*Inverse*: from 1 mm off three Newton steps: four poses, three Jacobians and normal equations of
about 430 products and sums; 4,800 operations, 200 ns, and some 20 divisions and roots a step.
"""

from __future__ import annotations

import ctypes
import functools
import importlib.metadata
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from harness import Contender, Work

C_KERNEL = r"""
#include <stddef.h>
typedef double v __attribute__((vector_size(64)));
typedef long long w __attribute__((vector_size(64)));
static inline v either(w which, v one, v other) {
    return (v)(((w)one & which) | ((w)other & ~which));
}
static inline void sincos8(v x, v *s, v *c) {
    v shifted = x * 0.6366197723675814 + 0x1.8p52, k = shifted - 0x1.8p52;
    w number = (w)shifted;
    v y = ((x - k * 1.57079632673412561417) - k * 6.07710050630396597660e-11)
          - k * 2.02226624879595063154e-21;
    v z = y * y;
    v odd = y + y * z * (-1.66666666666666324348e-01 + z * (8.33333333332248946124e-03
        + z * (-1.98412698298579493134e-04 + z * (2.75573137070700676789e-06
        + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))));
    v even = 1.0 - 0.5 * z + z * z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03
        + z * (2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07
        + z * (2.08757232129817482790e-09 - z * 1.13596475577881948265e-11)))));
    w swapped = -(number & 1);
    *s = (v)((w)either(swapped, even, odd) ^ ((number & 2) << 62));
    *c = (v)((w)either(swapped, odd, even) ^ (((number + 1) & 2) << 62));
}
void forward(
    ptrdiff_t n, ptrdiff_t k, const double *rows, const double *q, double *turn, double *at) {
    for (ptrdiff_t begin = 0; begin < n; begin += 8) {
        ptrdiff_t many = n - begin < 8 ? n - begin : 8;
        v f[4][3] = {0};
        for (int r = 0; r < 3; r++) f[r][r] += 1.0;
        for (ptrdiff_t j = 0; j < k; j++) {
            const double *row = rows + 8 * j;
            v angle = {0}, s, c;
            for (ptrdiff_t i = 0; i < many; i++) angle[i] = q[(begin + i) * k + j];
            sincos8(angle + row[0], &s, &c);
            for (int r = 0; r < 3; r++) {
                v x = c * f[0][r] + s * f[1][r], y = c * f[1][r] - s * f[0][r], z = f[2][r];
                f[3][r] += row[1] * z + row[2] * x;
                f[1][r] = row[3] * y + row[4] * z;
                z = row[3] * z - row[4] * y;
                f[0][r] = row[5] * x - row[6] * z;
                f[2][r] = row[5] * z + row[6] * x;
            }
        }
        for (ptrdiff_t i = 0; i < many; i++)
            for (int r = 0; r < 3; r++) {
                for (int c = 0; c < 3; c++) turn[9 * (begin + i) + 3 * r + c] = f[c][r][i];
                at[3 * (begin + i) + r] = f[3][r][i];
            }
    }
}
"""
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
            (_kinacc(_forward(smoke)), *_pinocchio(q_rad, _pinocchio_forward), *_in_c(smoke)),
            _agree, {"pinocchio": 8.0, "C kernel, gcc": 1 / 3},
            96 * each_ns, "96 bytes a pose at the write bandwidth",
        ),
        Work(
            "forward kinematics, two threads", "pose", 4 * count,
            (_kinacc(_forward(smoke, 2, 4)), _kinacc(_forward(smoke, 1, 4), "kinacc, one thread")),
            _agree, {"kinacc, one thread": 1.8}, wall=True,
        ),
        Work(
            "forward kinematics and joint Jacobian", "pose", count,
            (
                _kinacc(_jacobian(smoke, "joint_jacobian", (6, 6))),
                *_pinocchio(q_rad, _pinocchio_slopes),
            ),
            _agree, {"pinocchio": 4.0}, 384 * each_ns, "384 bytes a pose at the write bandwidth",
        ),
        Work(
            "forward kinematics and parameter Jacobian", "pose", count // 2,
            (_kinacc(_jacobian(smoke, "parameter_jacobian", (6, 6, 5), count // 2)),), _agree,
            {"limit": 0.6}, 1536 * each_ns, "1,536 bytes a pose at the write bandwidth",
        ),
        Work(
            "inverse, all branches", "solution", int(found.sum()),
            (_kinacc(_inverse(smoke)), *_opw(goal, found)), _verified(goal, found),
            {"py-opw-kinematics, batch_inverse": 2.0}, 200.0, "4,800 operations a solution",
        ),
        Work(
            "inverse, all branches, few poses", "solution", int(found[:few].sum()),
            (_kinacc(_inverse(smoke, slice(few))), *_toolbox(goal, found, few)),
            _verified(goal, found, few), {"robotics-toolbox, ik_LM": 10.0},
            200.0, "4,800 operations a solution",
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


def _compiled(run: Callable[[], object], smoke: bool) -> Callable[[], object]:
    """A run whose kernels are there: kinacc loads them once they are worth it."""
    for _ in range(0 if smoke else 4):
        run()
    return run


def _forward(smoke: bool, threads: int = 1, times: int = 1) -> Callable[[], object]:
    from kinacc.geometry import Pose
    from kinacc.kinematics import dh

    model, q_rad = problem(smoke)
    q_rad = np.tile(q_rad, (times, 1))
    out = Pose(np.zeros((len(q_rad), 3, 3)), np.zeros((len(q_rad), 3)))
    return _compiled(lambda: tuple(dh.forward(model, q_rad, threads=threads, out=out)), smoke)


def _jacobian(smoke: bool, name: str, shape: tuple[int, ...], count: int | None = None):
    from kinacc.geometry import Pose
    from kinacc.kinematics import dh

    model, q_rad = problem(smoke)
    q_rad = q_rad[:count]
    out = (
        Pose(np.zeros((len(q_rad), 3, 3)), np.zeros((len(q_rad), 3))),
        np.zeros((len(q_rad), *shape)),
    )
    function = getattr(dh, f"pose_and_{name}")

    def run() -> object:
        pose, jacobian = function(model, q_rad, out=out)
        return (*pose, jacobian)

    return _compiled(run, smoke)


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


def _in_c(smoke: bool) -> tuple[Contender, ...]:
    """``C_KERNEL`` as this machine's compiler makes it; nothing without a compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        return ()
    with tempfile.TemporaryDirectory() as folder:
        source, library = Path(folder, "kernel.c"), Path(folder, "kernel.so")
        source.write_text(C_KERNEL)
        options = ["-O3", "-march=native", "-ffp-contract=fast", "-Wno-psabi", "-shared", "-fPIC"]
        subprocess.run([compiler, *options, source, "-o", library], check=True)
        function = ctypes.CDLL(str(library)).forward
    told = subprocess.run([compiler, "-dumpversion"], capture_output=True, text=True, check=True)
    model, q_rad = problem(smoke)
    turn, at = np.zeros((len(q_rad), 3, 3)), np.zeros((len(q_rad), 3))
    rows = np.ascontiguousarray(model.rows)
    q_rad = np.ascontiguousarray(q_rad)
    pointers = [ctypes.c_void_p(each.ctypes.data) for each in (rows, q_rad, turn, at)]
    sizes = ctypes.c_ssize_t(len(q_rad)), ctypes.c_ssize_t(6)

    def run(kept=(rows, q_rad)) -> object:
        function(*sizes, *pointers)
        return turn, at

    return (Contender("C kernel, gcc", told.stdout.strip(), run),)


@functools.cache
def goals(smoke: bool):
    """Rotations and positions to reach, and which branches (n, 8) the nominal arm has there."""
    from kinacc.kinematics import dh, inverse, robot
    from kinacc.kinematics.inverse import closed_form

    model, q_rad = problem(smoke)
    pose = dh.forward(model, q_rad[: 50 if smoke else GOALS])
    arm = robot.load("mh180")
    form = inverse.closed_form_of(arm)
    start, found = form.solve(form.arm, pose, inverse.branches_of(arm), closed_form.Start())
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
    return _compiled(lambda: (inverse.solve(arm, model, goal).q_rad,), smoke)


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
                np.testing.assert_allclose(back.position_mm, at[row], rtol=0, atol=1e-9)
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

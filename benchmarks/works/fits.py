"""Fits

A fit with standard deviations and what it could not determine.

Data sets are simulated: an arm that differs from its description, 0.05 mm and 0.1 mrad of noise.

DH fits have 500 full poses, base and tool known, and 29 free parameters, five directions of which
nothing shows. scipy's ``least_squares`` gets the same whitened residual, and
neither truncates, finds ranks nor judges standard deviations; "2-point" is
its default Jacobian, "analytic" that of kinacc. Its ``lm`` is taken, which is faster here than
``trf``. pybotics fits its parameters to positions alone; to 30 of them, as 500
take it minutes.

VEC fits have 1,000 full poses and 216 coefficients beside base and tool, with the rank report. They
are held to a product of the transposed Jacobian, 6,000 x 216, with itself. No fit takes less than
seven: three such products, and a triangular factor of twice the operations at half the speed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import version

import numpy as np
from harness import Contender, Work

WEIGHT = 500.0  # mm per rad
NOISE_MM, NOISE_RAD = 0.05, 1e-4
GRAM = "one Gram product"


def works(smoke: bool) -> list[Work]:
    """DH fits beside scipy and pybotics, VEC fits and choices of order beside matrix products."""
    poses = 60 if smoke else 500
    own, scipy = version("kinacc"), version("scipy")
    fitted = Work(
        f"DH fit, {poses} full poses", "fit", 1,
        (
            Contender("kinacc", own, _dh(smoke)),
            Contender("scipy 2-point", scipy, _scipy(smoke, analytic=False)),
            Contender("scipy analytic", scipy, _scipy(smoke, analytic=True)),
        ),
        _same_cost, {"scipy 2-point": 4.0},
    )  # fmt: skip
    count, order = (120, 2) if smoke else (1000, 5)
    rows = np.random.default_rng(0).normal(size=(6 * count, 36 * (order + 1)))
    product = Contender(GRAM, np.__version__, lambda: rows.T @ rows)
    return [
        fitted,
        Work(
            "DH fit, 30 positions", "fit", 1,
            (Contender("kinacc", own, dh_positions()), *_pybotics()), _same_rms,
            {"pybotics": 200.0},
        ),
        Work(
            f"VEC fit, {count} poses x {rows.shape[1]}, with rank report", "fit", 1,
            (Contender("kinacc", own, vec_with_rank(count, order)), product),
            lambda outputs: None, {GRAM: 1 / 25},
        ),
    ]  # fmt: skip


def dh_positions() -> Callable[[], float]:
    """A DH fit to positions: the rms of its residuals."""
    from kinacc.calibration import fitting

    nominal, free, seen, frames = _positions()

    def run() -> float:
        found = fitting.fit(
            seen, nominal, free=free, frames=frames, rotation_weight_mm_per_rad=WEIGHT,
            threshold=1e-5,
        )  # fmt: skip
        return float(np.sqrt(found.solution.cost / found.solution.count))

    return run


def vec_with_rank(count: int, order: int) -> Callable[[], tuple[float, int]]:
    """A VEC fit with base and tool, and its rank report: cost and rank."""
    from kinacc.calibration import fitting, vec_fit

    seen, empty = _wavy(count, order)
    frames = fitting.fit_frames(seen, empty.dh, rotation_weight_mm_per_rad=WEIGHT)
    prior = vec_fit.Prior(1.0, 1e-3, 1.0, 1e-3)

    def run() -> tuple[float, int]:
        found = vec_fit.fit(
            seen, empty, prior=prior, rotation_weight_mm_per_rad=WEIGHT, frames=frames,
            frames_free=True,
        )  # fmt: skip
        told = vec_fit.gauge(seen, found.model, found.frames, WEIGHT)
        return found.solution.cost, told.rank

    return run


def _dh(smoke: bool) -> Callable[[], tuple[float, int]]:
    from kinacc.calibration import fitting

    nominal, free, seen, frames = _full_poses(60 if smoke else 500)

    def run() -> tuple[float, int]:
        found = fitting.fit(
            seen, nominal, free=free, frames=frames, rotation_weight_mm_per_rad=WEIGHT,
            threshold=1e-2,
        )  # fmt: skip
        return found.solution.cost, len(found.solution.undetermined)

    return run


def _scipy(smoke: bool, analytic: bool) -> Callable[[], tuple[float, None]]:
    from scipy.optimize import least_squares

    from kinacc.calibration.frames import FrameParameters
    from kinacc.calibration.system import PoseSystem

    nominal, free, seen, frames = _full_poses(60 if smoke else 500)
    system = PoseSystem(seen, nominal, free.ravel(), FrameParameters.none(frames), WEIGHT)
    start, scale = (
        nominal.start[free.ravel()],
        np.tile([1e-3, 1.0, 1.0, 1e-3, 1e-3], len(free))[free.ravel()],
    )

    def jacobian(z: np.ndarray) -> np.ndarray:
        return np.concatenate([each for _, each in system.blocks(start + scale * z)]) * scale

    def run() -> tuple[float, None]:
        found = least_squares(
            lambda z: system.residual(start + scale * z), np.zeros(start.size), method="lm",
            jac=jacobian if analytic else "2-point",
        )  # fmt: skip
        return 2.0 * float(found.cost), None

    return run


def _pybotics() -> tuple[Contender, ...]:
    try:
        from pybotics.optimization import OptimizationHandler, optimize_accuracy
        from pybotics.robot import Robot
    except ImportError:
        return ()
    from scipy.optimize import least_squares

    nominal, _, seen, _ = _positions()
    alpha, a = np.roll(nominal.alpha_rad, 1), np.roll(nominal.a_mm, 1)
    c, s = np.cos(alpha[0]), np.sin(alpha[0])
    tool = np.array([[1, 0, 0, a[0]], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1.0]])
    alpha[0] = a[0] = 0.0
    table = np.stack([alpha, a, nominal.theta_offset_rad, nominal.d_mm], axis=1)

    def run() -> float:
        robot = Robot.from_parameters(table.ravel().copy())
        robot.tool.matrix = tool
        handler = OptimizationHandler(robot, kinematic_chain_mask=True)
        start = handler.generate_optimization_vector()
        given = handler, seen.q_rad, seen.position_mm
        found = least_squares(optimize_accuracy, start, method="lm", args=given)
        return float(np.sqrt(2.0 * found.cost / seen.position_mm.size))

    return (Contender("pybotics", version("pybotics"), run),)


def _full_poses(count: int) -> tuple:
    """Nominal arm, free parameters, full poses, known frames."""
    from kinacc.calibration.constraints import free_parameters
    from kinacc.calibration.frames import known
    from kinacc.calibration.observations import full_poses
    from kinacc.kinematics import dh, robot

    arm, rng = robot.load("mh180"), np.random.default_rng(1)
    free = free_parameters(6, (1, 2, 3, 4, 5))
    q_rad = _joints(arm, count, rng)
    poses = dh.forward(_off(arm.dh, free, rng), q_rad)
    return arm.dh, free, full_poses(q_rad, _noisy(poses, rng)), known()


def _positions() -> tuple:
    """Nominal arm, free parameters, positions alone, known frames."""
    from dataclasses import replace

    from kinacc.calibration.constraints import free_parameters
    from kinacc.calibration.frames import known
    from kinacc.calibration.observations import full_poses
    from kinacc.kinematics import dh, robot

    arm, rng = robot.load("mh180"), np.random.default_rng(2)
    q_rad = _joints(arm, 30, rng)
    free = free_parameters(6)
    free[5, 2:4] = False  # of pybotics' tool, which it is told
    poses = dh.forward(_off(arm.dh, free, rng), q_rad)
    seen = full_poses(q_rad, _noisy(poses, rng))
    return arm.dh, free, replace(seen, rotation=np.full_like(seen.rotation, np.nan)), known()


def _wavy(count: int, order: int) -> tuple:
    """Full poses of an arm with wavy joints somewhere, and its VEC model without errors."""
    from dataclasses import replace

    from kinacc.calibration.observations import full_poses
    from kinacc.geometry import Pose, compose, exp_so3
    from kinacc.kinematics import robot, vec

    arm, rng = robot.load("mh180"), np.random.default_rng(3)
    q_rad = _joints(arm, count, rng)
    span = q_rad.min(axis=0) - 0.02, q_rad.max(axis=0) + 0.02
    true = vec.without_errors(arm.dh, *span, order + 2)
    unit = np.array([1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3])[:, None] / (1.0 + np.arange(order + 3))
    true = replace(true, coefficients=0.3 * unit * rng.normal(size=true.coefficients.shape))
    base, tool = (
        Pose(exp_so3(rng.normal(size=3)), far * rng.normal(size=3)) for far in (1500.0, 80.0)
    )
    poses = compose(base, compose(vec.pose(true, q_rad), tool))
    return full_poses(q_rad, _noisy(poses, rng)), vec.without_errors(arm.dh, *span, order)


def _joints(arm, count: int, rng: np.random.Generator) -> np.ndarray:
    low, high = np.maximum(arm.q_min_rad, -np.pi), np.minimum(arm.q_max_rad, np.pi)
    return rng.uniform(low, high, (count, arm.dh.joints)) @ arm.joint_map.T


def _off(nominal, free: np.ndarray, rng: np.random.Generator):
    """The arm with its ``free`` parameters off as a calibration finds them."""

    unit = np.array([1e-3, 0.5, 0.5, 1e-3, 1e-3])
    off = free * unit * rng.normal(size=free.shape)
    return nominal.with_parameters(nominal.start + off.ravel())


def _noisy(poses, rng: np.random.Generator):
    from kinacc.geometry import Pose, exp_so3

    count = len(poses.position_mm)
    turn = exp_so3(NOISE_RAD * rng.normal(size=(count, 3)))
    return Pose(turn @ poses.rotation, poses.position_mm + NOISE_MM * rng.normal(size=(count, 3)))


def _same_cost(outputs: Sequence[tuple[float, int | None]]) -> None:
    """kinacc's cost is the least one within 1e-9 of it; scipy's within 1e-6."""
    costs = np.array([cost for cost, _ in outputs])
    least = costs.min()
    if costs[0] > least * (1.0 + 1e-9) or np.any(costs > least * (1.0 + 1e-6)):
        raise ValueError(f"costs differ: {costs}")
    undetermined = {count for _, count in outputs if count is not None}
    if undetermined != {5}:
        raise ValueError(f"undetermined directions: {undetermined}")


def _same_rms(outputs: Sequence[float]) -> None:
    """Residuals of both are the noise: base and tool of their arms have other freedoms."""
    if max(outputs) > 1.1 * min(outputs):
        raise ValueError(f"rms differ: {outputs}")

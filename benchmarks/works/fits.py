"""Fits

A fit with standard deviations and what it could not determine.

Data sets are simulated: an arm that differs from its description, 0.05 mm and 0.1 mrad of noise.

DH fits have 500 full poses, base and tool known, and 29 free parameters, five directions of which
nothing shows. scipy's ``least_squares`` gets the same whitened residual, and
neither truncates, finds ranks nor judges standard deviations; "2-point" is
its default Jacobian, "analytic" that of kinacc. Its ``lm`` is taken, which is faster here than
``trf``. pybotics fits its parameters to positions alone; to 30 of them, as 500
take it minutes.

VEC fits have 1,000 full poses and 216 coefficients beside base and tool. They
are held to a product of the transposed Jacobian, 6,000 x 216, with itself. No fit takes less than
three such products. The rank report named below took one more factorisation; it is gone since.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.metadata import version

import numpy as np
from harness import Contender, Work
from scipy.optimize import least_squares

from kinacc.calibration import fitting, vec_fit
from kinacc.calibration.dh_estimator import free_parameters
from kinacc.calibration.fitting import PoseSystem
from kinacc.calibration.frames import FrameParameters, known
from kinacc.calibration.observations import Observations, full_poses
from kinacc.geometry import Pose, compose, exp_so3
from kinacc.kinematics import dh, robot, vec

ARM = robot.load("mh180")
WEIGHT = 500.0  # mm per rad
NOISE_MM, NOISE_RAD = 0.05, 1e-4
ERRORS = np.array([1e-3, 0.5, 0.5, 1e-3, 1e-3])  # of the arm's rows, in mm and rad
GRAM = "one Gram product"


def works(smoke: bool) -> list[Work]:
    """DH fits beside scipy and pybotics, VEC fits beside matrix products."""
    poses = 60 if smoke else 500
    own, scipy = version("kinacc"), version("scipy")
    free = free_parameters(6, (1, 2, 3, 4, 5))
    seen = _observations(poses, free, 1)
    of_tool = free_parameters(6)
    of_tool[5, 2:4] = False  # pybotics' tool has them
    positions = _observations(30, of_tool, 2)
    positions = replace(positions, rotation=np.full_like(positions.rotation, np.nan))
    count, order = (120, 2) if smoke else (1000, 5)
    rows = np.random.default_rng(0).normal(size=(6 * count, 36 * (order + 1)))
    return [
        Work(
            f"DH fit, {poses} full poses", "fit", 1,
            (
                Contender("kinacc", own, lambda: _cost(_fit(seen, free, 1e-2))),
                Contender("scipy 2-point", scipy, _scipy(seen, free, analytic=False)),
                Contender("scipy analytic", scipy, _scipy(seen, free, analytic=True)),
            ),
            _same_cost, {"scipy 2-point": 4.0},
        ),
        Work(
            "DH fit, 30 positions", "fit", 1,
            (
                Contender("kinacc", own, lambda: _rms(_fit(positions, of_tool, 1e-5))),
                *_pybotics(positions),
            ),
            _same_rms, {"pybotics": 200.0},
        ),
        Work(
            f"VEC fit, {count} poses x {rows.shape[1]}", "fit", 1,
            (
                Contender("kinacc", own, _vec(count, order)),
                Contender(GRAM, np.__version__, lambda: rows.T @ rows),
            ),
            lambda outputs: None, {GRAM: 1 / 25},
        ),
    ]  # fmt: skip


def _fit(seen: Observations, free: np.ndarray, threshold: float):
    return fitting.fit(
        seen,
        ARM.dh,
        free=free,
        frames=FrameParameters.none(known()),
        rotation_weight_mm_per_rad=WEIGHT,
        threshold=threshold,
    ).solution


def _cost(solution) -> tuple[float, int]:
    return solution.cost, len(solution.undetermined)


def _rms(solution) -> float:
    return float(np.sqrt(solution.cost / solution.count))


def _vec(count: int, order: int) -> Callable[[], tuple[float, int]]:
    """A VEC fit with base and tool: cost and number of parameters."""
    seen, empty = _wavy(count, order)
    frames = fitting.fit_frames(seen, empty.dh, rotation_weight_mm_per_rad=WEIGHT)
    prior = vec_fit.Prior(1.0, 1e-3, 1.0, 1e-3)

    def run() -> tuple[float, int]:
        found = vec_fit.fit(
            seen, empty, prior=prior, rotation_weight_mm_per_rad=WEIGHT, begin=frames
        )
        return found.solution.cost, len(found.solution.x)

    return run


def _scipy(seen: Observations, free: np.ndarray, analytic: bool) -> Callable:
    system = PoseSystem(seen, ARM.dh, free.ravel(), FrameParameters.none(known()), WEIGHT)
    start = ARM.dh.start[free.ravel()]
    scale = np.tile([1e-3, 1.0, 1.0, 1e-3, 1e-3], len(free))[free.ravel()]

    def jacobian(z: np.ndarray) -> np.ndarray:
        return np.concatenate([each for _, each in system.blocks(start + scale * z)]) * scale

    def run() -> tuple[float, None]:
        found = least_squares(
            lambda z: system.residual(start + scale * z), np.zeros(start.size), method="lm",
            jac=jacobian if analytic else "2-point",
        )  # fmt: skip
        return 2.0 * float(found.cost), None

    return run


def _pybotics(seen: Observations) -> tuple[Contender, ...]:
    try:
        from pybotics.optimization import OptimizationHandler, optimize_accuracy
        from pybotics.robot import Robot
    except ImportError:
        return ()
    alpha, a = np.roll(ARM.dh.alpha_rad, 1), np.roll(ARM.dh.a_mm, 1)
    c, s = np.cos(alpha[0]), np.sin(alpha[0])
    tool = np.array([[1, 0, 0, a[0]], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1.0]])
    alpha[0] = a[0] = 0.0
    table = np.stack([alpha, a, ARM.dh.theta_offset_rad, ARM.dh.d_mm], axis=1)

    def run() -> float:
        arm = Robot.from_parameters(table.ravel().copy())
        arm.tool.matrix = tool
        handler = OptimizationHandler(arm, kinematic_chain_mask=True)
        start = handler.generate_optimization_vector()
        data = handler, seen.q_rad, seen.position_mm
        found = least_squares(optimize_accuracy, start, method="lm", args=data)
        return float(np.sqrt(2.0 * found.cost / seen.position_mm.size))

    return (Contender("pybotics", version("pybotics"), run),)


def _observations(count: int, free: np.ndarray, seed: int) -> Observations:
    """Full poses of an arm with its ``free`` parameters off as a calibration finds them."""
    rng = np.random.default_rng(seed)
    q_rad = _joints(count, rng)
    off = free * ERRORS * rng.normal(size=free.shape)
    true = ARM.dh.with_parameters(ARM.dh.start + off.ravel())
    return _noisy(q_rad, dh.forward(true, q_rad), rng)


def _wavy(count: int, order: int) -> tuple:
    """Full poses of an arm with wavy joints somewhere, and its VEC model without errors."""
    rng = np.random.default_rng(3)
    q_rad = _joints(count, rng)
    span = q_rad.min(axis=0) - 0.02, q_rad.max(axis=0) + 0.02
    true = vec.without_errors(ARM.dh, *span, order + 2)
    unit = np.array([1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3])[:, None] / (1.0 + np.arange(order + 3))
    true = replace(true, coefficients=0.3 * unit * rng.normal(size=true.coefficients.shape))
    base, tool = (
        Pose(exp_so3(rng.normal(size=3)), far * rng.normal(size=3)) for far in (1500.0, 80.0)
    )
    poses = compose(base, compose(vec.pose(true, q_rad), tool))
    return _noisy(q_rad, poses, rng), vec.without_errors(ARM.dh, *span, order)


def _joints(count: int, rng: np.random.Generator) -> np.ndarray:
    low, high = np.maximum(ARM.q_min_rad, -np.pi), np.minimum(ARM.q_max_rad, np.pi)
    return rng.uniform(low, high, (count, ARM.dh.joints)) @ ARM.joint_map.T


def _noisy(q_rad: np.ndarray, poses: Pose, rng: np.random.Generator) -> Observations:
    turn = exp_so3(NOISE_RAD * rng.normal(size=(len(q_rad), 3)))
    off_mm = NOISE_MM * rng.normal(size=(len(q_rad), 3))
    return full_poses(q_rad, Pose(turn @ poses.rotation, poses.position_mm + off_mm))


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

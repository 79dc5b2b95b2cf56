"""Residuals and Jacobians of the calibration: every column against finite differences.

A transposed rotation term still converges to the same optimum; only this catches it.
"""

from __future__ import annotations

import numpy as np
import pytest

from kinacc import geometry
from kinacc.calibration import dh_fit, vec_fit
from kinacc.calibration.frames import Frames, coordinates, left_jacobian
from kinacc.calibration.observations import Observations
from kinacc.calibration.system import FlangeModel, PoseSystem
from kinacc.errors import InputError
from kinacc.geometry import Pose, compose, exp_so3, log_so3
from kinacc.kinematics import dh, robot, vec

WEIGHT = 350.0


def random_pose(rng, count=None, angle=1.0, distance_mm=300.0) -> Pose:
    shape = (3,) if count is None else (count, 3)
    return Pose(exp_so3(angle * rng.normal(size=shape)), distance_mm * rng.normal(size=shape))


def observations(rng, arm, count=7, targets=2, positions_only=2) -> Observations:
    """Targets of an arm somewhere near where nominal frames put them; some without orientation."""
    q = rng.uniform(-1.2, 1.2, (count, 6))
    base, tools = random_pose(rng), random_pose(rng, targets, 1.0, 100.0)
    target = rng.integers(0, targets, count)
    carried = Pose(tools.rotation[target], tools.position_mm[target])
    seen = compose(base, compose(dh.forward(arm.dh, q), carried))
    rotation = exp_so3(rng.normal(size=(count, 3)) * 0.2) @ seen.rotation
    rotation[:positions_only] = np.nan
    zeros = np.zeros(count, dtype=int)
    return Observations(
        q_rad=q,
        s=rng.choice([-1, 0, 1], (count, 6)).astype(np.int8),
        position_mm=seen.position_mm + rng.normal(size=(count, 3)) * 5.0,
        rotation=rotation,
        pose=np.arange(count),
        target=target,
        repeat=zeros,
        fold=zeros - 1,
        target_names=tuple(f"t{i}" for i in range(targets)),
    )


def flange_models() -> dict[str, tuple[FlangeModel, np.ndarray]]:
    arm = robot.load("mh180")
    rng = np.random.default_rng(3)
    free = dh_fit.free_parameters(6, (2, 5))
    by_dh = dh_fit.flange_model(arm.dh, free)
    at_dh = dh.to_vector(arm.dh)[free.ravel()] + rng.normal(size=by_dh.size) * 0.02
    empty = vec.without_errors(arm.dh, np.full(6, -1.4), np.full(6, 1.4), 3)
    chosen, by_vec = vec_fit.flange_model(observations(rng, arm, count=60), empty)
    assert chosen.all()
    at_vec = rng.normal(size=chosen.size) * 2e-3
    return {"dh": (by_dh, at_dh), "vec": (by_vec, at_vec)}


@pytest.mark.parametrize("name", ["dh", "vec"])
@pytest.mark.parametrize("base_free", [True, False])
@pytest.mark.parametrize("targets_free", [True, False])
def test_jacobian_is_the_derivative_of_the_residual(name, base_free, targets_free):
    rng = np.random.default_rng(11)
    arm = robot.load("mh180")
    seen = observations(rng, arm)
    model, at = flange_models()[name]
    anchor = Frames(random_pose(rng), random_pose(rng, 2, 1.0, 100.0))
    coords = coordinates(seen, anchor, base_free, targets_free)
    system = PoseSystem(seen, model, coords, WEIGHT)
    angle = coords.is_angle()
    # Far from the anchor: a Jacobian that is right only at w = 0 must not pass.
    x = np.concatenate([np.where(angle, 0.3, 20.0) * rng.normal(size=coords.size), at])
    assert system.size == x.size
    (residual, jacobian), *more = system.blocks(x)
    assert not more
    np.testing.assert_allclose(residual, system.residual(x), rtol=0, atol=0)
    assert residual.size == seen.components
    for column in range(x.size):
        step = 1e-5
        ahead, behind = x.copy(), x.copy()
        ahead[column] += step
        behind[column] -= step
        slope = (system.residual(ahead) - system.residual(behind)) / (2 * step)
        scale = max(1.0, np.abs(slope).max())
        assert np.abs(jacobian[:, column] - slope).max() < 2e-6 * scale, column


def test_residual_is_model_minus_measurement_in_the_robot_base():
    rng = np.random.default_rng(4)
    arm = robot.load("mh180")
    seen = observations(rng, arm, count=5, targets=1, positions_only=0)
    frames = Frames(random_pose(rng), random_pose(rng, 1))
    model = dh_fit.flange_model(arm.dh, np.zeros((6, 5), dtype=bool))
    system = PoseSystem(seen, model, coordinates(seen, frames, True, True), WEIGHT)
    residual = system.residual(np.zeros(system.size)).reshape(5, 6)
    back = geometry.invert(frames.base)
    for i in range(5):
        tool = Pose(frames.targets.rotation[0], frames.targets.position_mm[0])
        flange = dh.forward(arm.dh, seen.q_rad[i])
        model_pose = compose(Pose(flange.rotation[0], flange.position_mm[0]), tool)
        measured = compose(back, Pose(seen.rotation[i], seen.position_mm[i]))
        position = model_pose.position_mm - measured.position_mm
        turn = log_so3(model_pose.rotation @ measured.rotation.T)
        np.testing.assert_allclose(residual[i], [*position, *(WEIGHT * turn)], atol=1e-8)


def test_blocks_and_residual_agree_whatever_the_block_length(monkeypatch):
    rng = np.random.default_rng(6)
    seen = observations(rng, robot.load("mh180"), count=9)
    model, at = flange_models()["dh"]
    frames = Frames(random_pose(rng), random_pose(rng, 2))
    system = PoseSystem(seen, model, coordinates(seen, frames, True, True), WEIGHT)
    x = np.concatenate([np.zeros(system.coordinates.size), at])
    whole = system.residual(x)
    (_, jacobian), *_ = system.blocks(x)
    monkeypatch.setattr("kinacc.calibration.system.BLOCK_ROWS", 2)
    system = PoseSystem(seen, model, coordinates(seen, frames, True, True), WEIGHT)
    parts = list(system.blocks(x))
    assert len(parts) == 5
    np.testing.assert_allclose(np.concatenate([part[0] for part in parts]), whole, rtol=1e-13)
    np.testing.assert_allclose(np.concatenate([part[1] for part in parts]), jacobian, atol=1e-9)
    assert system.cost(x) == pytest.approx(whole @ whole, rel=1e-12)


@pytest.mark.parametrize("length", [0.0, 1e-9, 9e-4, 1.1e-3, 0.5, 3.0])
def test_the_left_jacobian_is_the_derivative_of_the_rotation_vector(length):
    axis = np.array([0.6, -0.48, 0.64])
    w = length * axis
    forward = left_jacobian(w)
    for column in range(3):
        shift = np.zeros(3)
        shift[column] = 1e-6
        moved = log_so3(exp_so3(w + shift) @ exp_so3(w).T) - log_so3(
            exp_so3(w - shift) @ exp_so3(w).T
        )
        np.testing.assert_allclose(forward[:, column], moved / 2e-6, atol=1e-8)


def test_fewer_residuals_than_parameters_is_said_with_both_numbers():
    rng = np.random.default_rng(8)
    arm = robot.load("mh180")
    seen = observations(rng, arm, count=5, targets=1, positions_only=0)
    with pytest.raises(InputError, match=r"30 residual components .* 36 free parameters"):
        dh_fit.fit(
            seen,
            arm.dh,
            free=dh_fit.free_parameters(6),
            rotation_weight_mm_per_rad=WEIGHT,
            threshold=1e-3,
        )

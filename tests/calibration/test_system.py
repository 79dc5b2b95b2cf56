"""Residuals of every model seen through base and targets, and their derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import simulated
from pose_checks import movement

from kinacc.calibration import fitting, vec_fit
from kinacc.calibration.fitting import PoseSystem
from kinacc.calibration.frames import FrameParameters, frame_terms
from kinacc.kinematics import robot, vec

ARM, WEIGHT = robot.load("mh180"), 350.0


def system_of(name, kind, estimated=True, count=12):
    """A system with a third of the orientations missing, and a point far from the optimum."""
    rng = np.random.default_rng(3)
    seen = simulated.measure(ARM.dh, simulated.joints(ARM, count, rng), kind, rng, 0.05, sessions=2)
    rotation = seen.rotation.copy()
    rotation[::3] = np.nan
    seen = replace(seen, rotation=rotation, s=rng.choice([-1, 0, 1], seen.s.shape).astype(np.int8))
    bases = simulated.anywhere(rng, 900.0, 2)
    targets = simulated.anywhere(rng, 90.0, len(seen.target_names))
    anchor = simulated.frames_of(bases, targets)
    parameters = frame_terms(seen, anchor)
    if not estimated:
        parameters = FrameParameters.none(anchor)
    if name == "dh":
        model, free = ARM.dh, np.ones(30, dtype=bool)
        at, unit = ARM.dh.start, np.tile([1e-2, 1.0, 1.0, 1e-2, 1e-2], 6)
    else:
        model = vec.without_errors(ARM.dh, ARM.q_min_rad, ARM.q_max_rad, 2)
        free = vec_fit.informed(seen, model)
        at, unit = np.zeros(free.sum()), 10.0 * fitting.scales(model)[free]
    turned = np.where(parameters.angle, 0.2, 10.0)
    x = np.concatenate([parameters.begin, at])
    x = x + np.concatenate([turned, unit]) * rng.normal(size=x.size)
    return PoseSystem(seen, model, free, parameters, WEIGHT), x


@pytest.mark.parametrize("name", ["dh", "vec"])
@pytest.mark.parametrize("kind", [simulated.POSE, simulated.THREE])
def test_jacobian_is_the_derivative_of_the_residual(name, kind):
    system, x = system_of(name, kind)
    jacobian = np.concatenate([each for _, each in system.blocks(x)])
    assert jacobian.shape == (system.observations.components, system.size)
    for column in range(x.size):
        step = 1e-6 * np.eye(x.size)[column]
        slope = (system.residual(x + step) - system.residual(x - step)) / 2e-6
        assert np.abs(jacobian[:, column] - slope).max() < 1e-5 * max(1.0, np.abs(slope).max())


@pytest.mark.parametrize("name", ["dh", "vec"])
@pytest.mark.parametrize("estimated", [True, False])
def test_normal_equations_are_those_of_the_written_out_jacobian(name, estimated):
    system, x = system_of(name, simulated.POSE, estimated=estimated, count=1100)  # two blocks
    system = replace(system, root=np.random.default_rng(1).uniform(size=len(system.observations)))
    residual, jacobian = (np.concatenate(part) for part in zip(*system.blocks(x), strict=True))
    np.testing.assert_allclose(residual, system.residual(x), rtol=1e-12)
    both = np.column_stack([jacobian, residual])
    unit = np.append(1.0 / (np.linalg.norm(jacobian, axis=0) + 1e-30), 1.0)
    both = both * unit
    np.testing.assert_allclose(system.normal(x, unit[:-1]), both.T @ both, rtol=1e-12, atol=1e-12)


def test_motions_of_frames_are_their_finite_differences():
    system, x = system_of("dh", simulated.POSE)
    parameters, c = system.frames, x[: system.frames.size]
    motions, step = parameters.motions(c), 1e-6
    for column in range(c.size):
        low, high = (parameters.frames(c + way * np.eye(c.size)[column]) for way in (-step, step))
        moved = [movement(low.bases, high.bases), movement(low.targets, high.targets)]
        wanted = np.concatenate(moved).ravel() / (2 * step)
        np.testing.assert_allclose(motions[:, column], wanted, atol=2e-6)

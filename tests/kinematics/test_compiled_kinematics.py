"""The compiled kinematics give what the plain ones give, bit for bit, whatever the problem."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from kinacc.geometry import Pose
from kinacc.kinematics import dh, inverse, robot
from kinacc.kinematics.chain import sincos
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.inverse import quick

FUNCTIONS = {
    "forward": lambda model, q: tuple(dh.forward(model, q)),
    "joint_jacobian": lambda model, q: (dh.joint_jacobian(model, q),),
    "parameter_jacobian": lambda model, q: (dh.parameter_jacobian(model, q),),
}


def some_arm(joints, seed=0):
    """An arm of random axes, some of which slide, with Hayati terms at some joints."""
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(5, joints)) * np.array([[1.0], [300.0], [300.0], [1.0], [1e-2]])
    columns[4, rng.random(joints) < 0.5] = 0.0
    return DHModel(*columns, prismatic=rng.random(joints) < 0.3)


def both_ways(monkeypatch, function, model, q):
    """What the plain and the compiled code give."""
    results = []
    for worth in (10**12, 0):
        monkeypatch.setattr(dh, "WORTH_NUMBA", worth)
        results.append(FUNCTIONS[function](model, q))
    return results


def same_bits(one, other):
    return all(a.tobytes() == b.tobytes() for a, b in zip(one, other, strict=True))


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("joints", [1, 2, 6, 7, 10])
@pytest.mark.parametrize("count", [0, 1, 31, 32, 33, 1100])
def test_many_poses_and_few_have_the_same_bits(monkeypatch, function, joints, count):
    q = np.random.default_rng(1).uniform(-7.0, 7.0, (count, joints))
    plain, compiled = both_ways(monkeypatch, function, some_arm(joints), q)
    assert same_bits(plain, compiled)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_joints_many_turns_away_and_missing_ones_disturb_no_other_row(monkeypatch, function):
    model = robot.load("mh180").dh
    q = np.random.default_rng(2).uniform(-3.0, 3.0, (200, 6))
    near = FUNCTIONS[function](model, q)
    q[3, 1], q[50, 0], q[120, 5] = 1e9, np.nan, -3e5
    plain, compiled = both_ways(monkeypatch, function, model, q)
    assert same_bits(plain, compiled)
    others = np.setdiff1d(np.arange(200), [3, 50, 120])
    assert all((a[others] == b[others]).all() for a, b in zip(near, compiled, strict=True))
    assert np.isnan(compiled[0][50]).any()
    turned = q[3] - 2.0 * np.pi * np.rint(q[3] / (2.0 * np.pi))
    assert np.allclose(compiled[0][3], FUNCTIONS[function](model, turned)[0][0], atol=1e-3)


def test_threads_and_arrays_of_the_caller_change_no_bit(monkeypatch):
    monkeypatch.setattr(dh, "WORTH_NUMBA", 0)
    model = robot.load("ur10").dh
    q = np.random.default_rng(3).uniform(-3.0, 3.0, (1001, 6))
    q.setflags(write=False)
    alone = dh.pose_and_joint_jacobian(model, q)
    own = Pose(np.empty((1001, 3, 3)), np.empty((1001, 3))), np.empty((1001, 6, 6))
    shared = dh.pose_and_joint_jacobian(model, q, threads=3, out=own)
    assert shared[1] is own[1]
    assert same_bits((*alone[0], alone[1]), (*shared[0], shared[1]))
    assert same_bits(dh.forward(model, q, threads=2), alone[0])
    assert same_bits(dh.forward(model, np.asfortranarray(q)), alone[0])


def test_sines_are_right_to_the_last_place_and_a_right_angle_stays_one():
    rng = np.random.default_rng(4)
    turns = np.arange(-400, 401) * (0.5 * np.pi)
    angles = np.concatenate([rng.uniform(-10.0, 10.0, 20_000), turns, rng.uniform(-1e5, 1e5, 5000)])
    for found, expected in zip(sincos(angles), (np.sin(angles), np.cos(angles)), strict=True):
        assert (np.abs(found - expected) <= np.spacing(np.abs(expected))).all()
    assert sincos(0.5 * np.pi)[1] == np.cos(0.5 * np.pi)


def test_a_short_job_does_not_wait_for_the_compiler():
    lines = (
        "import sys, numpy as np",
        "from kinacc.kinematics import dh, robot",
        "arm = robot.load('mh180').dh",
        "[dh.forward(arm, np.zeros((3000, 6))) for _ in range(10)]",
        "print('numba' in sys.modules)",
        "[dh.forward(arm, np.zeros((800_000, 6)))]",
        "print('numba' in sys.modules)",
    )
    done = subprocess.run([sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True)
    assert done.stdout.split() == ["False", "True"], done.stderr


def test_compiled_code_starts_without_loading_linear_algebra_it_does_not_call():
    program = (
        "import sys, numpy; from kinacc.assess import random_numbers, world\n"
        "world.drawn_world(numpy.ones((2, 3)), 0.1, random_numbers.key_of(1), 3).complete()\n"
        "from numba.np import arraymath\n"
        "print('scipy.linalg' in sys.modules, arraymath._HAVE_BLAS)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["False", "True"]


def test_the_inverse_of_a_calibrated_arm_is_the_same_compiled_and_meets_its_poses(monkeypatch):
    arm = robot.load("mh180")
    rng = np.random.default_rng(5)
    errors = rng.normal(size=(6, 5)) * np.array([1e-3, 0.3, 0.3, 5e-4, 5e-4])
    model = dh.with_vector(arm.dh, dh.to_vector(arm.dh) + errors.ravel())
    share = rng.uniform(0.2, 0.8, (40, 6))
    goal = dh.forward(model, arm.q_min_rad + share * (arm.q_max_rad - arm.q_min_rad))
    solutions = []
    for worth in (10**12, 0):
        monkeypatch.setattr(dh, "WORTH_NUMBA", worth)
        solutions.append(inverse.solve(arm, model, goal))
    assert same_bits(solutions[0][:2], solutions[1][:2])
    pose, branch = np.nonzero(np.isfinite(solutions[1].q_rad).all(axis=2))
    reached = dh.forward(model, solutions[1].q_rad[pose, branch])
    apart = np.abs(reached.position_mm - goal.position_mm[pose]).max(axis=1)
    assert len(pose) > 200
    assert np.mean(apart < 1e-9) > 0.97  # beside singular postures 1e-6 mm is promised
    assert (apart < 1e-6).all()


def test_quick_steps_say_what_they_do_not_reach_in_the_same_bits(monkeypatch):
    model = some_arm(6, seed=7)
    model = DHModel(*(getattr(model, name) for name in dh.PARAMETERS))
    rng = np.random.default_rng(8)
    q = rng.uniform(-3.0, 3.0, (300, 6))
    far = rng.normal(size=(300, 6)) * rng.choice([1e-9, 1e-3, 0.3, 2.0], (300, 1))
    far[7] = np.nan
    results = []
    for worth in (10**12, 0):
        monkeypatch.setattr(dh, "WORTH_NUMBA", worth)
        results.append(quick.refine(model, dh.forward(model, q), q + np.nan_to_num(far)))
        results.append(quick.refine(model, dh.forward(model, q), q + far))
    assert same_bits(results[0], results[2])
    assert same_bits(results[1], results[3])
    met = results[0][1]
    assert met[np.abs(far).max(axis=1) < 1e-8].all()
    assert not met.all()
    back = dh.forward(model, results[0][0][met]).position_mm
    assert np.abs(back - dh.forward(model, q[met]).position_mm).max() < 1e-9


def test_where_nothing_can_be_kept_kernels_are_compiled_anew_and_one_line_says_so():
    lines = (
        "import numpy as np, numba.core.caching as caching",
        "caching.CacheImpl._locator_classes = []  # neither folder can be written",
        "from kinacc.kinematics import dh, kernels, robot",
        "from kinacc.kinematics.inverse import kernels as others",
        "arm, q = robot.load('mh180').dh, np.full((3, 6), 0.5)",
        "plain = dh.forward(arm, q)",
        "dh.WORTH_NUMBA = 0",
        "print(plain.position_mm.tobytes() == dh.forward(arm, q).position_mm.tobytes())",
    )
    done = subprocess.run([sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True)
    assert done.stdout.split() == ["True"], done.stderr
    [line] = done.stderr.splitlines()
    assert "NUMBA_CACHE_DIR" in line

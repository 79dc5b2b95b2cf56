"""The models against a plain 4x4 loop; their slopes are held to them in ``kinematics``."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from oracles import kinematics as oracle

from kinacc.kinematics import chain, dh, robot, vec

EXACT_MM = 1e-9
EXACT = 1e-12  # elements of rotations


def floats(low: float, high: float, shape):
    elements = st.floats(low, high, allow_subnormal=False)
    return arrays(np.float64, shape, elements=elements, fill=st.nothing())


@st.composite
def dh_tables(draw, joints: int = 6):
    angle, length = floats(-math.pi, math.pi, joints), floats(-1500, 1500, joints)
    return np.column_stack([draw(angle), draw(length), draw(length), draw(angle), draw(angle)])


@st.composite
def vec_cases(draw):
    """A whole VEC model of one to seven joints, a pose inside its range and travel directions.

    The errors are up to ten times those of a real arm, so that second-order slips show."""
    k, order = draw(st.integers(1, 7)), draw(st.integers(0, 7))
    table = draw(dh_tables(k))
    low = draw(floats(-4, 0, k))
    high = low + draw(floats(1.5, 8, k))
    series = np.empty((k, 6, order + 1))
    series[:, :3] = draw(floats(-5, 5, (k, 3, order + 1)))
    series[:, 3:] = draw(floats(-0.02, 0.02, (k, 3, order + 1)))
    offsets = draw(floats(-0.01, 0.01, (k, 2)))
    q = low + (high - low) * draw(floats(0, 1, k))
    s = draw(arrays(np.int8, k, elements=st.sampled_from([-1, 0, 1])))
    return table, series, low, high, offsets, q, s


def dh_model(table) -> dh.DHModel:
    return dh.DHModel(*np.asarray(table, float).T)


def vec_model(table, series, low, high, offsets) -> vec.VECModel:
    return vec.VECModel(
        dh=dh_model(table),
        q_min_rad=np.asarray(low, float),
        q_max_rad=np.asarray(high, float),
        coefficients=np.asarray(series, float),
        direction_offsets_rad=np.asarray(offsets, float),
    )


def matrix(pose, index: int = 0) -> np.ndarray:
    result = np.eye(4)
    result[:3, :3] = pose.rotation[index]
    result[:3, 3] = pose.position_mm[index]
    return result


def assert_same_frame(actual, expected) -> None:
    assert np.abs(actual[:3, 3] - expected[:3, 3]).max() <= EXACT_MM
    assert np.abs(actual[:3, :3] - expected[:3, :3]).max() <= EXACT


# --- nominal arms ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "table"), [("mh180", oracle.MH180), ("ur10", oracle.UR10)], ids=["mh180", "ur10"]
)
def test_shipped_robot_is_the_published_table(name, table):
    arm = robot.load(name).dh
    shipped = np.column_stack([arm.theta_offset_rad, arm.d_mm, arm.a_mm, arm.alpha_rad])
    np.testing.assert_allclose(shipped, np.array(table)[:, :4], rtol=0, atol=1e-15)
    assert not arm.beta_rad.any()


# --- DH, eqs. 1-4 ---------------------------------------------------------------------------------


@settings(max_examples=15)
@given(table=dh_tables(5), q=floats(-2 * math.pi, 2 * math.pi, (2, 5)))
def test_dh_chain_equals_the_plain_loop(table, q):
    frames = dh.chain(dh_model(table), q)
    assert frames.position_mm.shape == (2, 6, 3)
    for i in range(2):
        for j, expected in enumerate(oracle.dh_frames(table, q[i])):
            assert_same_frame(
                matrix(type(frames)(frames.rotation[i], frames.position_mm[i]), j), expected
            )


# --- VEC, eqs. 5-6 --------------------------------------------------------------------------------


@settings(max_examples=25)
@given(case=vec_cases())
def test_vec_forward_equals_the_plain_loop(case):
    *parameters, q, s = case
    model = vec_model(*parameters)
    expected = oracle.vec_forward(*case)
    printed = matrix(chain.to_pose(vec.walk(model, q[None], s[None]).end))
    assert_same_frame(printed, expected)
    assert_same_frame(matrix(vec.pose(model, q[None], s[None])), oracle.projected(expected))

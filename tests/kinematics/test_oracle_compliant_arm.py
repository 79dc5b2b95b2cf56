"""The oracle of compliant arms itself: its energy derivative against two other ways.

A planar arm of two links l1, l2 in a vertical plane, joint axes level, gravity along -y, worked out
by hand. With links of mass m1, m2 whose centres lie halfway, and a payload mp at the tip,

    tau_2 = -g (m2 / 2 + mp) l2 cos(q1 + q2)
    tau_1 = -g (m1 / 2 + m2 + mp) l1 cos(q1) + tau_2

(lengths in m), and the tip, joints turned by delta_j = c_j tau_j, stands at
(l1 cos(q1 + delta_1) + l2 cos(q1 + delta_1 + q2 + delta_2), the same with sines).

One link alone, turned by delta = -k cos(q) to first order (k = c m g l), rests where
delta = -k cos(q + delta), which is -k cos(q) (1 + k sin(q)) to second order: the sagging
lever grows.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from oracles import compliant_arm as oracle
from oracles.compliant_arm import Arm, Body

G = 9.80665
L1, L2 = 700.0, 450.0
M1, M2 = 20.0, 11.0
PAYLOAD = Body(6.0)
PLANAR = Arm(
    ((0.0, 0.0, L1, 0.0, 0.0), (0.0, 0.0, L2, 0.0, 0.0)),
    (Body(M1, (-L1 / 2, 0.0, 0.0)), Body(M2, (-L2 / 2, 0.0, 0.0))),
    {1: 2e-5, 2: 7e-5},
    gravity=(0.0, -2.0, 0.0),  # any length
)


def by_hand(q: list[float]) -> tuple[float, float]:
    tau_2 = -G * 1e-3 * (M2 / 2 + PAYLOAD.mass_kg) * L2 * math.cos(q[0] + q[1])
    tau_1 = -G * 1e-3 * (M1 / 2 + M2 + PAYLOAD.mass_kg) * L1 * math.cos(q[0]) + tau_2
    return tau_1, tau_2


@pytest.mark.parametrize("q", [[0.0, 0.0], [0.4, -1.1], [math.pi / 2, 0.0], [2.0, 2.5]])
def test_a_planar_arm_bends_as_worked_out_by_hand(q):
    tau = by_hand(q)
    found = [oracle.moment_nm(PLANAR, q, joint, PAYLOAD) for joint in (1, 2)]
    assert found == pytest.approx(tau, abs=1e-12)
    assert oracle.lever_mm(PLANAR, q, 2) == pytest.approx(-L2 * math.cos(q[0] + q[1]), abs=1e-9)
    first, second = q[0] + 2e-5 * tau[0], q[1] + 7e-5 * tau[1]
    tip = [L1 * f(first) + L2 * f(first + second) for f in (math.cos, math.sin)]
    assert oracle.flange(PLANAR, q, PAYLOAD)[:2, 3] == pytest.approx(tip, abs=1e-9)


@pytest.mark.parametrize("name", ["fanuc_r2000ic_165f", "mh180", "ur10"])
def test_moments_are_those_of_forces_on_levers(name):
    rng = np.random.default_rng(4)
    table = oracle.described(name).table
    links = tuple(Body(float(m), tuple(rng.normal(0.0, 150.0, 3))) for m in rng.uniform(5, 300, 6))
    load = Body(90.0, (20.0, -35.0, 160.0))
    arm = Arm(table, links, gravity=(0.3, -0.5, -1.1))
    down = np.array(arm.gravity) / np.linalg.norm(arm.gravity)
    for q in rng.uniform(-2.0, 2.0, (5, 6)):
        at = [np.eye(4), *(frame.real for frame in oracle.frames(table, q))]
        for joint in range(1, 7):
            axis, origin = at[joint - 1][:3, 2], at[joint - 1][:3, 3]
            hung = [*zip(at[joint:], links[joint - 1 :], strict=True), (at[-1], load)]
            tau = sum(
                np.cross(axis, (frame @ [*body.centre_mm, 1.0])[:3] - origin)
                @ (body.mass_kg * G * 1e-3 * down)
                for frame, body in hung
            )
            assert oracle.moment_nm(arm, q, joint, load) == pytest.approx(tau, rel=1e-11, abs=1e-8)
            lever = np.cross(axis, at[-1][:3, 3] - origin) @ down
            assert oracle.lever_mm(arm, q, joint) == pytest.approx(lever, rel=1e-11, abs=1e-8)


def test_an_arm_at_rest_differs_from_first_order_by_the_second_order_worked_out_by_hand():
    q, k = 0.3, 5e-4
    beam = Arm(((0.0, 0.0, 1000.0, 0.0, 0.0),), (), {1: k / (8.0 * G)}, gravity=(0.0, -1.0, 0.0))
    first = oracle.deflections(beam, [q], Body(8.0))[0]
    assert first == pytest.approx(-k * math.cos(q), rel=1e-12)
    rest = oracle.settled(beam, [q], Body(8.0))[0] - q
    assert rest == pytest.approx(-k * math.cos(q + rest), rel=1e-11)
    assert rest - first == pytest.approx(-(k**2) * math.cos(q) * math.sin(q), rel=1e-2)

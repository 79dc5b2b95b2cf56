"""The oracle of compliant arms itself: its energy derivative against two other ways.

A planar arm of two links l1, l2 in a vertical plane, joint axes level, gravity along -y, worked out
by hand. With links of mass m1, m2 whose centres lie halfway, and a payload mp at the tip,

    tau_2 = -g (m2 / 2 + mp) l2 cos(q1 + q2)
    tau_1 = -g (m1 / 2 + m2 + mp) l1 cos(q1) + tau_2

(lengths in m), and the tip, joints turned by delta_j = c_j tau_j, stands at
(l1 cos(q1 + delta_1) + l2 cos(q1 + delta_1 + q2 + delta_2), the same with sines).
"""

from __future__ import annotations

import math

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

"""Made-up fields: what is hard about them is among the candidates of every campaign."""

from __future__ import annotations

import numpy as np
import pytest

from research.contest import candidates
from research.made_up_fields import ARMS, made_up, synthetic


@pytest.mark.parametrize(("name", "sizes_mm"), [("lone", [1.5]), ("tied2", [1.0] * 2),
                                                ("tied20", [1.0] * 20)])  # fmt: skip
def test_the_far_poses_are_candidates_in_every_campaign(name, sizes_mm):
    field, places = made_up(name), []
    for repetition in range(30):
        chosen = candidates(field, 200, (5, repetition))
        assert len(set(chosen.tolist())) == 200
        large = np.flatnonzero(field.size_mm[chosen] > 0.7)
        assert field.size_mm[chosen][large] == pytest.approx(sizes_mm)
        places += large.tolist()
    assert np.std(places) > 40.0  # anywhere in the order of the visit


def test_a_defect_of_an_arm_makes_a_heavier_tail_than_smooth_errors():
    def tail(name):
        size_mm = synthetic(name, 0, ARMS[name]).size_mm
        return size_mm.max() / np.median(size_mm)

    assert tail("defect") > 1.2 * tail("smooth")

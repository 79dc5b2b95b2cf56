"""Months of a simulated arm that shares no code with kinacc's own, and what its history says."""

from __future__ import annotations

import numpy as np
import pytest
from simulated_months import year_of


@pytest.mark.parametrize(
    ("other_poses", "moved"),
    [(False, False), (True, False)],
)
def test_months_in_which_nothing_happens_raise_no_alarm(other_poses, moved):
    verdicts = list(year_of(0, 3, other_poses, moved)["verdict"])
    assert verdicts[0] == "first"
    assert "recalibrate" not in verdicts


def test_a_knock_far_beyond_chance_is_told_with_its_joint():
    knock_rad = np.array([0.0, 2e-3, 0.0, 0.0, 0.0, 0.0])
    found = year_of(0, 3, knock_rad=knock_rad)
    assert list(found["verdict"]) == ["first", "holds", "recalibrate"]
    assert found["joint"][-1] == 2

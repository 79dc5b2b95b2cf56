"""The shipped draws of the synthetic arm: numbered, repeatable, and for this arm alone."""

from __future__ import annotations

import pytest

from kinacc.errors import InputError
from kinacc.synthetic import accepted, measure


def test_further_draws_leave_the_own_one_out():
    assert accepted.further_draws(0, 3) == [1, 2, 3]
    assert accepted.further_draws(2, 3) == [0, 1, 3]


def test_another_arm_is_refused():
    from kinacc.kinematics import robot

    settings = {"draw": 0, "poses": 10, "tracker_noise_mm": 0.0}
    with pytest.raises(InputError, match="ur10"):
        measure(robot.load("ur10"), settings)

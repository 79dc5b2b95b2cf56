"""The synthetic arm: its parts one by one against plain formulas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pose_checks import assert_same

from kinacc.errors import InputError
from kinacc.kinematics import dh, robot
from kinacc.synthetic import accepted, measure, physical, plan
from kinacc.synthetic.draw import TABLE_II, Roughness, Scales, physical_robot
from kinacc.synthetic.physical import Visits
from kinacc.synthetic.plan import calibration_run, measured

NOTHING = Scales(0.0, 0.0, 0.0, 0.0)
SETTINGS = {"draw": 1, "poses": 10, "tracker_noise_mm": 0.0, "wave_decay": 1.0, "ripple": 1.0}


@pytest.fixture(scope="module")
def arm():
    return robot.load("mh180")


def visits(q_rad: np.ndarray, s: int = 1, time_h: float = 0.0) -> Visits:
    count = len(q_rad)
    return Visits(q_rad, np.full((count, 6), s), np.full(count, time_h), np.zeros((count, 6)))


def test_an_arm_without_errors_is_its_geometry(arm):
    run = calibration_run(arm, 30, seed=3)
    seen = measured(physical_robot(3, NOTHING), run, tracker_noise_mm=0.0)
    assert_same(seen, dh.forward(TABLE_II, run.visits.q_rad), 1e-9, 1e-12)


def test_backlash_follows_travel_and_closes_under_load():
    arm_of = physical_robot(0, Scales(0.0, 0.0, 1.0, 1.0))
    only = _only(arm_of, "backlash_rad")
    q_rad = np.deg2rad([[0.0, 40.0, 0.0, 10.0, 30.0, 0.0]])
    forth = physical.beyond_errors(only, TABLE_II, visits(q_rad, +1))[0, :, 5]
    back = physical.beyond_errors(only, TABLE_II, visits(q_rad, -1))[0, :, 5]
    assert np.allclose(forth, -back)
    assert np.all(forth > 0.0)
    assert forth[0] == pytest.approx(arm_of.beyond.backlash_rad[0])
    assert forth[1] < 0.5 * arm_of.beyond.backlash_rad[1]


def test_waves_that_fall_faster_are_of_the_same_size_together():
    scales = Scales(1.0, 1.0, 0.0, 0.0)
    arms = [physical_robot(0, scales, roughness=Roughness(decay, 1.0)) for decay in (0.5, 1.0, 2.0)]
    sizes = [np.linalg.norm(arm.smooth.amplitude) for arm in arms]
    assert sizes == pytest.approx([sizes[1]] * 3, rel=0.05)


def test_smooth_errors_are_waves_over_the_working_range():
    smooth = physical_robot(0, Scales(1.0, 1.0, 0.0, 0.0)).smooth
    share = 0.3
    q_rad = smooth.q_min_rad + share * (smooth.q_max_rad - smooth.q_min_rad)
    found = physical.smooth_errors(smooth, q_rad[None])[0]
    for joint in range(6):
        for error in range(6):
            wanted = sum(
                smooth.amplitude[joint, error, k - 1]
                * np.cos(np.pi * share * k + smooth.phase_rad[joint, error, k - 1])
                for k in range(1, smooth.amplitude.shape[-1] + 1)
            )
            assert found[joint, error] == pytest.approx(wanted, abs=1e-15)


def test_tracker_noise_has_the_stated_size(arm):
    run = calibration_run(arm, 2000, seed=4)
    still = physical_robot(4, NOTHING)
    true, seen = (measured(still, run, noise) for noise in (0.0, 0.05))
    assert (seen.position_mm - true.position_mm).std() == pytest.approx(0.05, rel=0.05)


def test_plan_is_inside_the_limits_and_both_wrists_are_used(arm):
    q_rad = plan.configurations(arm, 400)
    assert np.all(q_rad >= arm.q_min_rad)
    assert np.all(q_rad <= arm.q_max_rad)
    assert 0.3 < np.mean(q_rad[:, 4] > 0.0) < 0.7
    position = dh.forward(arm.dh, q_rad).position_mm
    radius = np.hypot(position[:, 0], position[:, 1])
    assert radius.min() >= plan.SPACE.inner_radius_mm - 1e-6
    assert radius.max() <= plan.SPACE.outer_radius_mm + 1e-6


def _only(arm, name: str):
    silent = {
        field: np.zeros_like(getattr(arm.beyond, field))
        for field in ("compliance", "ripple_rad", "backlash_rad", "drift", "repeatability_rad")
        if field != name
    }
    return replace(arm.beyond, **silent)


def test_further_draws_leave_the_own_one_out():
    assert accepted.further_draws(0, 3) == [1, 2, 3]
    assert accepted.further_draws(2, 3) == [0, 1, 3]
    with pytest.raises(InputError, match="searches for more"):
        accepted.further_draws(0, len(accepted.rows()))


def test_another_roughness_makes_another_arm_of_a_draw(arm):
    seen, again = (measure(arm, SETTINGS | change)["x_mm"] for change in ({}, {"ripple": 0.0}))
    assert 0.01 < np.abs(again - seen).max() < 1.0


def test_another_arm_is_refused():
    with pytest.raises(InputError, match="ur10"):
        measure(robot.load("ur10"), SETTINGS)

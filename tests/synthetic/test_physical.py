"""The synthetic arm: its parts one by one against plain formulas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinacc.kinematics import dh, robot
from kinacc.synthetic import physical, plan
from kinacc.synthetic.draw import TABLE_II, Roughness, Scales, physical_robot
from kinacc.synthetic.physical import Visits
from kinacc.synthetic.tracker import calibration_run, measured

NOTHING = Scales(0.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def arm():
    return robot.load("mh180")


def visits(q_rad: np.ndarray, s: int = 1, time_h: float = 0.0) -> Visits:
    count = len(q_rad)
    return Visits(q_rad, np.full((count, 6), s), np.full(count, time_h), np.zeros((count, 6)))


def test_an_arm_without_errors_is_its_geometry(arm):
    run = calibration_run(arm, 30, seed=3)
    seen = measured(physical_robot(3, NOTHING), run, tracker_noise_mm=0.0)
    plain = dh.forward(TABLE_II, run.visits.q_rad)
    assert np.abs(seen.position_mm - plain.position_mm).max() < 1e-9
    assert np.abs(seen.rotation - plain.rotation).max() < 1e-12


def test_poses_are_true_rotations(arm):
    run = calibration_run(arm, 30, seed=3)
    rotation = measured(physical_robot(3, Scales(5.0, 5.0, 5.0, 5.0)), run, 0.5).rotation
    assert np.abs(rotation @ np.swapaxes(rotation, 1, 2) - np.eye(3)).max() < 1e-12


def test_chain_equals_products_of_matrices():
    rng = np.random.default_rng(1)
    q_rad, errors = rng.normal(size=(4, 6)), rng.normal(size=(4, 6, 6)) * [1, 1, 1, 0.1, 0.1, 0.1]
    found = physical.chain(TABLE_II, q_rad, errors)
    for row in range(4):
        total = np.eye(4)
        for joint in range(6):
            error = np.eye(4)
            error[:3, :3] = physical.exp_so3(errors[row, joint, 3:])
            error[:3, 3] = errors[row, joint, :3]
            single = dh.DHModel(*(np.array([values[joint]]) for values in _parameters()))
            link = dh.forward(single, q_rad[row, joint].reshape(1, 1))
            motion = np.eye(4)
            motion[:3, :3], motion[:3, 3] = link.rotation[0], link.position_mm[0]
            total = total @ error @ motion
        assert np.abs(total[:3, :3] - found.rotation[row]).max() < 1e-12
        assert np.abs(total[:3, 3] - found.position_mm[row]).max() < 1e-9


def _parameters():
    return (
        TABLE_II.theta_offset_rad,
        TABLE_II.d_mm,
        TABLE_II.a_mm,
        TABLE_II.alpha_rad,
        TABLE_II.beta_rad,
    )


def test_gravity_torque_of_the_stretched_arm():
    # Upright arm, forearm level: joint 2 carries the forearm, wrist and spindle at their radii.
    nominal = robot.load("mh180").dh
    torque = physical.gravity_torque_knm(nominal, np.zeros((1, 6)))[0]
    # The forearm's mass hangs at 0.4 of the line from axis 4's frame to the wrist: x = 300+0.4*1225
    # of the frame behind joint 3, which lies 0 in front of axis 2 plus its own 300 mm upward.
    reach_m = np.array([0.0, 0.4 * 1.225, 1.225 + 0.5 * 0.225, 1.225 + 2.0 * 0.225])
    masses = np.array([250.0, 260.0, 70.0, 120.0])
    wanted = 9.81e-3 * np.sum(masses * reach_m)
    assert abs(torque[1]) == pytest.approx(wanted, rel=1e-9)
    assert torque[0] == pytest.approx(0.0, abs=1e-12)
    # The upper arm is not carried by joint 3, and stands upright: the same torque, opposite sense.
    assert abs(torque[2]) == pytest.approx(wanted, rel=1e-9)
    assert torque[1] * torque[2] < 0.0


def test_gravity_couples_joints_2_and_3():
    arm_of = physical_robot(0, Scales(0.0, 0.0, 1.0, 0.0))
    only = _only(arm_of, "compliance")
    q_rad = np.deg2rad(
        [[0, 0, 0, 0, 40, 0], [0, 0, -40, 0, 40, 0], [0, 30, 0, 0, 40, 0]], dtype=float
    )
    both = np.deg2rad([[0, 30, -40, 0, 40, 0]])
    turn = lambda q: physical.beyond_errors(only, TABLE_II, visits(q))[:, 1, 5]  # noqa: E731
    base, bent, leaned = turn(q_rad)
    # A sum of functions of q2 and of q3 would make this zero.
    assert abs(turn(both)[0] - bent - leaned + base) > 1e-5


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


def test_drift_starts_at_nothing_and_settles():
    only = _only(physical_robot(0, Scales(0.0, 0.0, 1.0, 1.0)), "drift")
    q_rad = np.zeros((1, 6))
    at = lambda hours: physical.beyond_errors(only, TABLE_II, visits(q_rad, 1, hours))[0]  # noqa: E731
    assert np.array_equal(at(0.0), np.zeros((6, 6)))
    assert np.allclose(at(100.0), only.drift)


def test_ripple_turns_with_the_motor():
    only = _only(physical_robot(0, Scales(0.0, 0.0, 1.0, 1.0)), "ripple_rad")
    q_rad = np.full((1, 6), 0.3)
    later = q_rad + 2.0 * np.pi / only.gear_ratio
    first = physical.beyond_errors(only, TABLE_II, visits(q_rad))
    assert np.allclose(first, physical.beyond_errors(only, TABLE_II, visits(later)), atol=1e-15)
    between = physical.beyond_errors(only, TABLE_II, visits(q_rad + np.pi / only.gear_ratio))
    assert np.abs(between - first)[0, :, 5].min() > 1e-6


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


@pytest.mark.parametrize("decay", [0.5, 2.0])
def test_a_rougher_arm_has_larger_fast_waves_and_errors_of_the_same_size(decay):
    scales = Scales(1.0, 1.0, 1.0, 1.0)
    tuned, other = (
        physical_robot(0, scales),
        physical_robot(0, scales, TABLE_II, Roughness(decay, 1.0)),
    )
    waves = other.smooth.amplitude / tuned.smooth.amplitude
    assert np.all((np.diff(waves, axis=-1) > 0) == (decay < 1.0))
    sizes = [np.sqrt(np.sum(1.0 / np.arange(1, 9) ** (2 * power))) for power in (1.0, decay)]
    assert np.allclose(waves[..., 0], sizes[0] / sizes[1])
    assert np.array_equal(other.beyond.ripple_rad, tuned.beyond.ripple_rad)


def test_an_arm_without_gear_errors_differs_from_the_tuned_one_in_them_alone():
    scales = Scales(1.0, 1.0, 1.0, 1.0)
    tuned, without = (
        physical_robot(0, scales, TABLE_II, Roughness(1.0, size)) for size in (1.0, 0.0)
    )
    assert not without.beyond.ripple_rad.any()
    assert np.array_equal(without.smooth.amplitude, tuned.smooth.amplitude)
    assert np.array_equal(without.beyond.drift, tuned.beyond.drift)


def test_angles_that_act_on_a_metre_are_an_order_smaller():
    amplitude = physical_robot(0, Scales(1.0, 1.0, 0.0, 0.0)).smooth.amplitude[..., 0]
    assert amplitude[:3, 3:].max() * 10.0 < amplitude[4:, 3:].min() * 1.2
    assert amplitude[3, 3:5].max() * 10.0 < amplitude[3, 5] * 1.2


def test_draws_repeat_and_differ():
    one, same, other = (physical_robot(seed, Scales(1, 1, 1, 1)) for seed in (7, 7, 8))
    assert np.array_equal(one.smooth.amplitude, same.smooth.amplitude)
    assert np.array_equal(one.beyond.ripple_phase_rad, same.beyond.ripple_phase_rad)
    assert not np.array_equal(one.smooth.phase_rad, other.smooth.phase_rad)


def test_scales_act_on_their_own_group_only():
    full = physical_robot(5, Scales(1.0, 1.0, 1.0, 1.0))
    arm_only = physical_robot(5, Scales(2.0, 1.0, 1.0, 1.0))
    wrist = np.zeros((6, 6), dtype=bool)
    wrist[3, 5] = wrist[4:, 3:] = True
    ratio = arm_only.smooth.amplitude / full.smooth.amplitude
    assert np.allclose(ratio[wrist], 1.0)
    assert np.allclose(ratio[~wrist], 2.0)
    assert np.array_equal(arm_only.beyond.ripple_rad, full.beyond.ripple_rad)


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


def test_longer_plans_begin_with_shorter_ones(arm):
    assert np.array_equal(plan.configurations(arm, 700)[:300], plan.configurations(arm, 300))


def test_travel_directions_are_those_of_the_way_there():
    q_rad = np.array([[0.1] * 6, [0.2] * 6, [-0.3] * 6])
    assert plan.directions(q_rad)[:, 0].tolist() == [1, 1, -1]


def _only(arm, name: str):
    silent = {
        field: np.zeros_like(getattr(arm.beyond, field))
        for field in ("compliance", "ripple_rad", "backlash_rad", "drift", "repeatability_rad")
        if field != name
    }
    return replace(arm.beyond, **silent)

"""Figures that a check states beside its findings, against simulated truth."""

import numpy as np
import pytest
from good_files import simulated
from read_columns import XYZ_MM

from kinacc.checks import digits, repeatability


def test_the_noise_between_two_targets_is_the_noise_of_a_reading(tmp_path):
    file = simulated(poses=300, noise_mm=0.1, targets=("a", "b"), repeats=2, off=0.0)
    facts = file.check(tmp_path).facts
    share = np.ptp(file.columns["q4_deg"]) / 320.0  # joint 4 turns from -160 to 160 deg
    assert facts["joint_coverage"][3]["share"] == pytest.approx(share)
    # A median of 600 absolute values scatters by 1.17 / sqrt(2 * 600) of itself: 3.4 %.
    assert facts["noise"]["between_targets_mm"] == pytest.approx(0.1, rel=0.12)
    (pair,) = facts["target_distances"]
    assert pair["noise_per_target_mm"] == facts["noise"]["between_targets_mm"]
    assert pair["std_mm"] == pytest.approx(0.1 * np.sqrt(2.0), rel=0.12)
    incomplete = file.columns.filter(regex="^b_")[np.arange(600) % 3 > 0]
    (pair,) = file.but(**incomplete).check(tmp_path).facts["target_distances"]
    assert pair["std_mm"] == pytest.approx(0.1 * np.sqrt(2.0), rel=0.15)


def test_equal_readings_are_no_copies_where_the_digits_are_coarse(tmp_path):
    file = simulated(poses=60, noise_mm=0.05, repeats=10)
    assert not file.but(**file.columns[XYZ_MM].round(1)).check(tmp_path).suspicions
    copied = file.rows([*range(51), 50, *range(52, 600)])
    found = copied.check(tmp_path)
    assert [finding.kind for finding in found.suspicions] == ["duplicate_rows"]
    # A copy is no repeated reading.
    without = file.rows([*range(51), *range(52, 600)]).check(tmp_path)
    assert found.facts["noise"] == without.facts["noise"]


def test_a_drift_is_how_far_the_points_went_where_a_turn_of_the_base_carries_them(tmp_path):
    file = simulated(poses=60, noise_mm=0.02)
    at = file.columns[XYZ_MM].to_numpy()
    middle = at.mean(axis=0)
    # By 1 mm in the middle, about an axis through the origin of the readings, metres away.
    turn = np.cross(middle, [0.6, 0.0, 0.8])
    turn /= np.linalg.norm(np.cross(turn, middle))
    moved = at + np.linspace(0.0, 1.0, len(at))[:, None] * np.cross(turn, at)
    columns = {name: moved[:, i] for i, name in enumerate(XYZ_MM)}
    (found,) = file.but(**columns).check(tmp_path).suspicions
    assert found.kind == "drift"
    np.testing.assert_allclose(found.values["drift_mm"], np.cross(turn, middle), atol=0.15)


@pytest.mark.parametrize("freedom", [12, 60])
def test_axes_that_scatter_alike_are_called_different_as_often_as_stated(freedom):
    rng = np.random.default_rng(freedom)
    drawn = rng.normal(size=(3000, freedom, 3))
    covariances = np.swapaxes(drawn, 1, 2) @ drawn / freedom
    chance = [repeatability.differ_by_axis(each, freedom) for each in covariances]
    for level in (0.05, 0.2):  # within four standard deviations
        wide = 4.0 * np.sqrt(level * (1.0 - level) / 3000)
        assert np.mean(np.array(chance) < level) == pytest.approx(level, abs=wide)


def test_the_step_of_a_column_is_the_largest_that_all_its_numbers_share():
    assert digits.step(["0,005", "\u22120,010", "12,345"], 1.0, ",") == pytest.approx(0.005)
    assert digits.step(["1.0", "1.0"], 2.0, ".") == pytest.approx(0.2)
    assert digits.step(["1.5", "x"], 1.0, ".") == 0.0

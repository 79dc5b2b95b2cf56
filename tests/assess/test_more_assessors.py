"""The assessors beyond the first: each against a slow or independent way to the same answer."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, gamma

from kinacc.assess.adaptive import Candidates
from kinacc.assess.conformity import ACCEPT, REJECT, UNDECIDED, decide
from kinacc.assess.error_effects import joint_errors
from kinacc.assess.gamma_quantile import GammaQuantile
from kinacc.assess.invalidation_calibrated import InvalidationCalibrated
from kinacc.assess.invalidation_full import ModelInvalidationFull
from kinacc.assess.limits import BallDistances
from kinacc.assess.model_invalidation import mahalanobis_excess, point_probability
from kinacc.assess.random_numbers import key_of
from kinacc.assess.region_share import RegionShare, largest_rank, smallest_rank
from kinacc.assess.simulate import conduct
from kinacc.assess.statement import CANDIDATES, MEASURED, REGION, Reason, Statement
from kinacc.assess.world import drawn_world
from kinacc.campaign.simulate import width_mm
from kinacc.errors import InputError
from kinacc.kinematics import dh, robot

ARM = robot.load("mh180")


def joints(points: int, seed: int = 2) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-0.9, 0.9, (points, 6))


def smooth_errors(q_rad: np.ndarray, seed: int = 3) -> np.ndarray:
    """Errors (m, 3) of about 0.5 mm by two waves in every error of every joint."""
    rng = np.random.default_rng(seed)
    effects = joint_errors(ARM, q_rad)
    angle = np.repeat(q_rad, 6, axis=1)
    causes = rng.normal(size=36) * np.sin(1.5 * angle) + rng.normal(size=36) * np.cos(2.5 * angle)
    errors = np.einsum("nic,nc->ni", effects, causes)
    return 0.5 * errors / np.sqrt(np.mean(np.sum(errors**2, axis=1)))


def test_effects_are_the_derivatives_of_the_arm():
    """Errors about and along z behind joint j act as theta and d of the next transform do."""
    q_rad = joints(4)
    effects = joint_errors(ARM, q_rad, tool_mm=np.array([10.0, 20.0, 30.0])).reshape(4, 3, 6, 6)
    step = 1e-4
    angles = ARM.dh_joints(q_rad)
    for joint in range(5):
        for name, cause, unit in (("d_mm", 2, 1.0), ("theta_offset_rad", 5, 1e3)):
            moved = []
            for sign in (-1, 1):
                values = getattr(ARM.dh, name).copy()
                values[joint + 1] += sign * step
                pose = dh.forward(replace(ARM.dh, **{name: values}), angles)
                moved.append(pose.position_mm + pose.rotation @ np.array([10.0, 20.0, 30.0]))
            slope = (moved[1] - moved[0]) / (2 * step) / unit
            assert effects[:, :, joint, cause] == pytest.approx(slope, abs=1e-6)


def test_gamma_quantile_is_that_of_the_best_fit():
    sizes = gamma.rvs(5.0, scale=0.1, size=150, random_state=1)
    errors = sizes[:, None] * np.array([0.0, 0.6, 0.8])
    (said,) = conduct(GammaQuantile(150), drawn_world(errors, 1e-6, key_of(1), 1)).statements()
    shape, _, scale = gamma.fit(sizes, floc=0)
    assert said.target == REGION
    assert said.value_mm == pytest.approx(gamma.ppf(0.99, shape, scale=scale), rel=1e-3)
    assert not said.withheld


def test_gamma_quantile_says_when_noise_or_a_lone_error_spoil_it():
    sizes = gamma.rvs(5.0, scale=0.1, size=100, random_state=2)
    errors = sizes[:, None] * np.array([1.0, 0.0, 0.0])
    (noisy,) = conduct(GammaQuantile(100), drawn_world(errors, 0.5, key_of(1), 1)).statements()
    assert noisy.withheld.code == "much_noise"
    errors[7] *= 20.0
    (lone,) = conduct(GammaQuantile(100), drawn_world(errors, 0.01, key_of(1), 1)).statements()
    assert lone.withheld.code == "not_gamma"


@pytest.mark.parametrize(("count", "probability"), [(50, 0.084), (200, 0.05), (20, 0.1)])
def test_ranks_are_the_last_that_the_binomial_allows(count, probability):
    rank = largest_rank(count, probability, 0.05)
    assert binom.cdf(rank - 1, count, probability) <= 0.05 or rank == 0
    assert binom.cdf(rank, count, probability) > 0.05
    rank = smallest_rank(count, probability, 0.05)
    assert binom.sf(rank - 1, count, probability) <= 0.05
    assert binom.sf(rank - 2, count, probability) > 0.05


@pytest.mark.parametrize("sigma", [0.001, 0.1, 0.5])
def test_the_share_of_the_region_keeps_its_confidence(sigma):
    rng = np.random.default_rng(4)
    pool = rng.normal(size=(4000, 3)) * rng.uniform(0.1, 0.5, (4000, 1))
    truth = np.quantile(np.linalg.norm(pool, axis=1), 0.9)
    held = np.zeros(2)
    for draw in range(400):
        errors = pool[rng.integers(0, 4000, 80)]
        (said,) = conduct(RegionShare(80), drawn_world(errors, sigma, key_of(draw), 1)).statements()
        held += said.upper_mm >= truth, said.lower_mm <= truth
    assert held.min() >= 400 * (0.95 - 3.5 * math.sqrt(0.05 * 0.95 / 400))


def test_too_few_points_for_a_share_are_told_how_many_it_takes():
    (said,) = conduct(RegionShare(20), drawn_world(np.eye(3), 0.1, key_of(1), 1)).statements()
    assert said.withheld == Reason("few_points", {"read": 3, "share": 0.9, "needed": 35})


def test_full_invalidation_states_what_the_papers_states_where_noise_is_equal():
    readings = drawn_world(smooth_errors(joints(20)), 0.1, key_of(6), 40)
    full = conduct(ModelInvalidationFull(40, alpha=0.6), readings)
    reads = {row: int(full.ledger.count[row]) for row in full.ledger.visited}
    size_mm = {
        row: np.linalg.norm(np.mean([readings.reading_mm(row, i) for i in range(count)], axis=0))
        for row, count in reads.items()
    }

    def rejection(bound_mm: float) -> float:
        """Eqs. 18 to 20 of the paper, as its own algorithm has them."""
        excess = [mahalanobis_excess(size_mm[row], bound_mm, 0.1, reads[row], "r") for row in reads]
        return 1.0 - math.prod(1.0 - point_probability(each, "squared") for each in excess)

    said_mm = full.statements()[0].value_mm
    assert max(reads.values()) > 1
    assert rejection((1.0 - 1e-5) * said_mm) > 0.6 >= rejection((1.0 + 1e-5) * said_mm)


def rejected_at_the_truth(eq21: bool) -> float:
    """Share of readings of an error on the bound that a 5 % test of the bound rejects."""
    rng = np.random.default_rng(7)
    spread = np.diag([0.2, 0.05, 0.05]) ** 2
    error = np.array([1.0, 1.0, 0.0]) / math.sqrt(2.0)
    readings = error + rng.multivariate_normal(np.zeros(3), spread, 4000)
    if eq21:
        gap = readings - readings / np.maximum(np.linalg.norm(readings, axis=1), 1.0)[:, None]
        square = np.einsum("ni,ij,nj->n", gap, np.linalg.inv(spread), gap)
    else:
        many = np.broadcast_to(spread, (4000, 3, 3))
        square = BallDistances(readings, many).beyond(1.0) ** 2
    return float(np.mean(square > 2.705543))  # one-sided 5 % along one direction


def test_the_nearest_point_keeps_the_error_rate_that_eq_21_breaks():
    assert rejected_at_the_truth(eq21=False) <= 0.06
    assert rejected_at_the_truth(eq21=True) > 0.15


def test_a_reading_with_a_covariance_of_its_own_widens_the_calibrated_bound():
    candidates = Candidates.with_equal_noise(np.full(5, 0.1))
    bounds = []
    for given in (None, 0.01 * np.eye(3)):
        campaign = InvalidationCalibrated(40, alpha=0.6).begin(candidates)
        while (point := campaign.next()) is not None:
            campaign.record(point, np.array([0.5, 0.0, 0.0]), given)
        bounds.append(campaign.statements()[0].upper_mm)
    assert bounds[0] < bounds[1]


@pytest.mark.parametrize(
    ("tolerance", "verdict"), [(1.2, ACCEPT), (1.3, ACCEPT), (1.0, UNDECIDED), (0.7, REJECT)]
)
def test_a_tolerance_is_held_to_both_bounds(tolerance, verdict):
    found = decide(Statement(MEASURED, 0.9, 0.8, 1.2, 0.95), tolerance)
    assert found.verdict == verdict
    assert found.guard_band_mm == pytest.approx(0.3)
    assert found.acceptance_limit_mm == pytest.approx(tolerance - 0.3)
    assert found.risk == pytest.approx(0.05)


@pytest.mark.parametrize(("value", "lower", "upper"), [(1.1, 0.9, 1.0), (0.9, 1.2, 1.0)])
def test_bounds_that_contradict_each_other_or_the_value_decide_nothing(value, lower, upper):
    for tolerance in (0.8, 1.05, 1.3):
        found = decide(Statement(MEASURED, value, lower, upper, 0.95), tolerance)
        assert found.verdict == UNDECIDED
        assert found.reason.code == "contradict"


def test_a_bound_that_leaves_candidates_out_accepts_nothing_and_may_reject():
    said = Statement(CANDIDATES, 0.9, 0.8, 1.0, 0.95, excepted=3)
    assert decide(said, 1.2).verdict == UNDECIDED
    assert decide(said, 1.2).reason.numbers == {"excepted": 3}
    assert decide(said, 0.7).verdict == REJECT
    assert math.isinf(width_mm(said))


def test_no_bound_is_no_decision_and_no_tolerance_an_error():
    found = decide(Statement(CANDIDATES, 0.9, withheld=Reason("suspects")), 1.0)
    assert (found.verdict, found.reason) == (UNDECIDED, Reason("suspects"))
    for wrong in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(InputError, match="tolerance"):
            decide(Statement(MEASURED, 0.9, 0.8, 1.2, 0.95), wrong)


def test_accepting_what_is_beyond_the_tolerance_is_as_rare_as_stated():
    accepted = 0
    for draw in range(400):
        errors = np.vstack([[[1.01, 0.0, 0.0]], np.zeros((9, 3)) + 1e-3])
        campaign = conduct(
            InvalidationCalibrated(30, alpha=0.6), drawn_world(errors, 0.1, key_of(draw), 30)
        )
        accepted += decide(campaign.statements()[0], 1.0).verdict == ACCEPT
    assert accepted <= 400 * (0.05 + 3.5 * math.sqrt(0.05 * 0.95 / 400))

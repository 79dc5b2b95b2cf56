"""Order and prior of the VEC model by evidence: known truth, wrong readings, repeats, few poses."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
import shared_data
import simulated
from measured_arms import measured_arm
from oracles.kinematics import MEASURED_RAD
from scipy.stats import multivariate_normal
from test_few_poses import settings

from kinacc.calibration import models, vec_fit
from kinacc.calibration.fitting import PoseSystem
from kinacc.calibration.frames import FrameParameters, known
from kinacc.calibration.vec_fit import Prior
from kinacc.kinematics import robot, vec

ARM = robot.load("mh180")
LOW, HIGH = MEASURED_RAD
WEIGHT, POSES, NOISE_MM = 500.0, 200, 0.03
FIXED = FrameParameters.none(known())
WAVY = Prior(0.3, 0.3e-3, 1.0, 1e-4)


def observed(order, prior=WAVY):
    """Poses of an arm whose joint errors are polynomials of ``order``."""
    rng = np.random.default_rng(0)
    empty = vec.without_errors(ARM.dh, LOW, HIGH, order)
    spread = prior.std(empty)
    true = empty.with_parameters(spread * rng.normal(size=spread.size))
    q, placed = rng.uniform(LOW, HIGH, (POSES, 6)), (known().bases, known().targets)
    return simulated.measure(
        true, q, simulated.POSE, rng, NOISE_MM, frames=placed, noise_rad=NOISE_MM / WEIGHT
    )


def choose(seen, orders=(1, 2, 3, 4, 6), stated=None):
    empty = vec.without_errors(ARM.dh, LOW, HIGH, 1)
    return vec_fit.choose(seen, empty, FIXED, WEIGHT, orders, stated).query("chosen").iloc[0]


@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("stated", [None, WAVY])
def test_the_order_of_the_errors_is_found(order, stated):
    assert choose(observed(order), stated=stated)["order"] == order


def test_width_and_fall_of_the_errors_are_found():
    best = choose(observed(6, prior=Prior(0.3, 0.3e-3, 0.6, 1e-4)), (6,))
    assert best["prior_std_mm"] == pytest.approx(0.3, rel=0.15)
    assert best["prior_decay"] == pytest.approx(0.6, rel=0.1)


def test_differences_of_evidence_are_those_of_the_marginal_likelihood():
    """Of residuals with what is integrated out projected away, by the dense covariance matrix."""
    seen, empty = observed(2).select(slice(0, 40)), vec.without_errors(ARM.dh, LOW, HIGH, 2)
    free = vec_fit.informed(seen, empty)
    system = PoseSystem(seen, empty, free, FIXED, WEIGHT)
    parts = zip(*system.blocks(np.zeros(free.sum())), strict=True)
    residual, jacobian = (np.concatenate(part) for part in parts)
    order, got = np.tile(np.arange(3), 36), []
    left, values, _ = np.linalg.svd(jacobian[:, order == 0])
    rest = left[:, int(np.sum(values > 1e-9 * values[0])) :]
    linear = vec_fit._Linear(seen, empty, FIXED, WEIGHT)
    linear.root[:] = 1.0
    normal, _ = linear.above_constants(2, 2)
    for prior in (Prior(0.2, 0.2e-3, 0.7, 1e-4), Prior(0.5, 0.5e-3, 1.0, 1e-4)):
        std = prior.std(empty)[: 36 * 3][order > 0]
        spread, noise = rest.T @ (jacobian[:, order > 0] * std), rest.T @ residual
        shape = np.eye(rest.shape[1]) + spread @ spread.T / NOISE_MM**2
        variance = noise @ np.linalg.solve(shape, noise) / noise.size
        wanted = multivariate_normal(cov=variance * shape).logpdf(noise)
        at = np.log([prior.delta_mm / NOISE_MM, prior.decay])
        value = vec_fit._negative(at, normal, noise.size, np.repeat([1, 2], 36))[0]
        got.append(-value - wanted)
    assert got[0] == pytest.approx(got[1], abs=1e-3)


def test_slopes_and_curvature_of_the_evidence_are_its_finite_differences():
    empty = vec.without_errors(ARM.dh, LOW, HIGH, 1)
    normal, count = vec_fit._Linear(observed(3), empty, FIXED, WEIGHT).above_constants(3, 3)
    at, degree = np.array([1.5, -0.2]), np.repeat([1, 2, 3], 36)
    _, slopes, curvature, _ = vec_fit._negative(at, normal, count, degree)
    for i, step in enumerate(1e-4 * np.eye(2)):
        ahead, behind = (
            vec_fit._negative(at + way * step, normal, count, degree) for way in (1, -1)
        )
        assert slopes[i] == pytest.approx((ahead[0] - behind[0]) / 2e-4, rel=1e-5)
        np.testing.assert_allclose(curvature[i], (ahead[1] - behind[1]) / 2e-4, rtol=1e-5)


def orders(arm, calibration, seen):
    """``vec_orders`` of these rows."""
    estimator = models.estimators(calibration, arm, seen)["vec"]
    return pd.DataFrame(estimator.choices(seen)["vec_orders"])


def positions(poses, repeats=1):
    """Positions of an arm as described, each configuration read several times."""
    arm, rng = robot.load("irb120"), np.random.default_rng(3)
    q = np.repeat(rng.uniform(-1.2, 1.2, (poses, 6)), repeats, axis=0)
    return arm, settings(), simulated.measure(arm.dh, q, simulated.POINT, rng)


def test_a_choice_has_seen_nothing_of_what_is_held_out():
    arm, calibration, seen = positions(60)
    shift = np.where(seen.fold == 2, 5.0, 0.0)[:, None] * [1.0, 0.0, 0.0]
    spoilt = replace(seen, position_mm=seen.position_mm + shift)
    before, after = (orders(arm, calibration, rows) for rows in (seen, spoilt))
    assert before["fold"].isna().any()
    for fold in range(5):
        one, other = (t.loc[t["fold"] == fold, "log_evidence"] for t in (before, after))
        assert (len(one) == len(other) and np.allclose(one, other, atol=0.1)) == (fold == 2)


@cache
def chosen_with(shift_mm, row, axis):
    """The order chosen for a measured arm with one number off."""
    arm, calibration, seen = measured_arm("ur10_d")
    calibration = calibration | {"vec": calibration["vec"] | {"order_highest": 12}}
    place = seen.position_mm.copy()
    place[row, axis] += shift_mm
    seen = replace(seen, fold=np.full(len(seen), -1), position_mm=place)
    return orders(arm, calibration, seen).query("chosen == 1")["order"].item()


@shared_data.needed("ur10_tmac/series_D.csv")
@pytest.mark.parametrize(("row", "axis"), [(613, 2), (402, 0)])
def test_one_reading_off_by_5_mm_does_not_change_the_order(row, axis):
    before, after = chosen_with(0.0, 0, 0), chosen_with(5.0, row, axis)
    assert abs(vec_fit.ORDERS.index(after) - vec_fit.ORDERS.index(before)) <= 1


def test_the_search_ends_where_high_orders_gain_nothing():
    table = orders(*positions(600))
    assert set(table.query("chosen == 1")["order"]) <= {1, 2}
    assert table["order"].max() <= 6  # 600 poses can carry 40


@pytest.mark.parametrize("poses", [35, 36, 37, 71, 72, 73])
def test_the_highest_order_has_no_more_parameters_than_residuals(poses):
    arm, rng = robot.load("ur10"), np.random.default_rng(1)
    seen = simulated.measure(arm.dh, simulated.joints(arm, poses, rng), simulated.POINT, rng)
    order = vec_fit.highest_order(seen, 6, frames=9)
    parameters = [9 + 6 * 6 * (highest + 1) for highest in (order, order + 1)]
    assert parameters[0] <= 3 * poses < parameters[1]

"""Fits with parameters that are fixed or known beforehand, and with losses that forgive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.stats import chi2, norm
from simulated import POINT, POSE, THREE, disturbed, fit, joints, measure, predicted

from kinacc.calibration import dh_estimator, frames
from kinacc.calibration.identifiability import identified
from kinacc.calibration.least_squares import HUBER, TUKEY, row_weights
from kinacc.calibration.tables import fit_columns
from kinacc.calibration.uncertainty import of_fit
from kinacc.config.parameter_rules import rules
from kinacc.geometry import log_so3
from kinacc.kinematics import robot

ARM = robot.load("mh180")
FREE = dh_estimator.free_parameters(6)


def observed(kind=POSE, count=60, seed=0, sessions=1):
    rng = np.random.default_rng(seed)
    true = disturbed(ARM.dh, FREE, rng)
    return measure(true, joints(ARM, count, rng), kind, rng, 0.05, sessions)


def fitted(observations, arm_rules=None, frame_rules=None, **settings):
    arm, free, std = dh_estimator.arm_terms(ARM.dh, FREE, rules(arm_rules or {}))
    count = len(observations.session_names), len(observations.target_names)
    stated = frames.known(ARM.base, robot.carried(ARM), *count)
    terms = frames.frame_terms(observations, stated, rules(frame_rules or {}, of_frames=True))
    return fit(observations, arm, free, std=std, frames=terms, **settings)


@pytest.mark.parametrize("kind", [POINT, THREE, POSE])
def test_fixed_frames_stay_and_the_rest_fits_as_well(kind):
    """With every component fixed where the plain fit found it, the same optimum is reached."""
    data = observed(kind, sessions=2)
    plain = fitted(data)
    first = data.target_names[0]
    names = [f"{frame} {axis}" for frame in ("base", first) for axis in "xyz"] + ["base2 y"]
    place = plain.frames.bases.position_mm
    at = [*place[0], *plain.frames.tool.position_mm, place[1, 1]]
    rules = {name: {"value_mm": float(value)} for name, value in zip(names, at, strict=True)}
    found = fitted(data, frame_rules=rules)
    np.testing.assert_allclose(found.frames.base.position_mm, at[:3], atol=1e-9)
    np.testing.assert_allclose(found.frames.tool.position_mm, at[3:6], atol=1e-9)
    assert found.frames.bases.position_mm[1, 1] == pytest.approx(at[6], abs=1e-9)
    assert found.solution.cost == pytest.approx(plain.solution.cost, rel=1e-5)


def test_one_fixed_turn_of_a_frame_is_about_the_stated_orientation():
    found = fitted(observed(), frame_rules={"t0 rz": {"value_mrad": 2.0}})
    turn = log_so3(found.frames.tool.rotation @ robot.carried(ARM).rotation.T)
    assert turn[2] == pytest.approx(2e-3, abs=1e-9)
    assert np.abs(turn[:2]).max() > 0.1


def test_a_prior_weighs_as_its_standard_deviation_says():
    """Posterior of one parameter by the formula for independent Gaussian knowledge."""
    data = observed()
    plain = fitted(data)
    std, at = plain.std[3, 0], plain.model.theta_offset_rad[3]
    value = at + 4 * std
    rule = {"joint 4 theta": {"value_rad": float(value), "prior_std_rad": float(std)}}
    found = fitted(data, rule)
    assert found.model.theta_offset_rad[3] == pytest.approx(0.5 * (at + value), abs=0.1 * std)
    assert found.std[3, 0] == pytest.approx(std / np.sqrt(2), rel=0.05)
    # Of a prior is what is known to no better than half of it: std / sqrt(1 + k^2) of k std.
    for times, status in ((1.6, "prior"), (1.9, "identified")):
        rule["joint 4 theta"]["prior_std_rad"] = float(times * std)
        found = fitted(data, rule)
        table = pd.DataFrame(identified(found, of_fit(found), data)).set_index("parameter")
        row = table.loc["j4.theta_offset_rad"]
        assert (row["status"], row["std"]) == (status, pytest.approx(found.std[3, 0]))


def test_a_prior_determines_what_the_data_leave_open():
    """Axes 2 and 3 are antiparallel: d2 and d3 only show as their difference."""
    data = observed()
    plain = fitted(data)
    assert np.isnan(plain.std[1, 1])
    rules = {"joint 2 d": {"value_mm": 5.0, "prior_std_mm": 0.2}}
    found = fitted(data, rules)
    assert found.model.d_mm[1] == pytest.approx(5.0, abs=0.01)
    assert found.std[1, 1] == pytest.approx(0.2, rel=1e-2)
    difference = plain.model.d_mm[1] - plain.model.d_mm[2]
    assert found.model.d_mm[1] - found.model.d_mm[2] == pytest.approx(difference, abs=0.02)
    assert found.solution.cost == pytest.approx(plain.solution.cost, rel=1e-3)


@pytest.mark.parametrize("loss", [HUBER, TUKEY])
def test_a_robust_loss_forgives_rows_far_off(loss):
    clean = observed(count=150, seed=4)
    position = clean.position_mm.copy()
    position[:12] += np.random.default_rng(1).normal(size=(12, 3)) * 8.0
    spoiled = replace(clean, position_mm=position)
    new = joints(ARM, 200, np.random.default_rng(9))
    wanted = predicted(fitted(clean), new).position_mm

    def off(fit):
        error = predicted(fit, new).position_mm - wanted
        return np.sqrt(np.mean(np.sum(error**2, axis=1)))

    squares, found = fitted(spoiled), fitted(spoiled, loss=loss)
    assert off(squares) > 0.3
    assert off(found) < 0.05
    assert (found.weights.row[:12] < 0.5).all()
    assert found.weights.scale_mm == pytest.approx(0.05, rel=0.2)
    assert found.solution.variance == found.weights.scale_mm**2
    known = np.isfinite(found.solution.std)
    table = fit_columns("dh_fit", found, of_fit(found))
    told = dict(zip(table["quantity"], table["value"], strict=True))
    weight = found.weights.row
    assert told["rows_below_half_weight"] == np.sum(weight < 0.5)
    assert told["rows_without_weight"] == np.sum(weight == 0.0) == 12 * (loss == TUKEY)
    assert told["loss_scale"] == told["residual_std"] == found.weights.scale_mm
    variances = np.diag(found.solution.covariance)[known]
    np.testing.assert_allclose(found.solution.std[known] ** 2, variances)


@pytest.mark.parametrize("kind", [POINT, POSE])
def test_weights_are_those_of_huber_and_tukey(kind):
    """Bends of 1.345 and 4.685 standard deviations of one component (Holland and Welsch 1977)."""
    data, components = observed(kind, count=5), 6 if kind == POSE else 3
    share = np.array([0.0, 0.5, 0.9, 1.5, 4.0])  # of the bend
    bend_huber, bend_tukey = chi2.isf(2 * norm.sf([1.345, 4.685]), components) ** 0.5
    unit = np.full(components, components**-0.5)
    for loss, bend, wanted in (
        (HUBER, bend_huber, [1.0, 1.0, 1.0, 1 / 1.5, 1 / 4.0]),
        (TUKEY, bend_tukey, [1.0, 0.75**2, 0.19**2, 0.0, 0.0]),
    ):
        residual = np.kron(0.2 * bend * share, unit)
        found = row_weights(loss, residual, data, scale_mm=0.2)
        np.testing.assert_allclose(found.row, wanted, atol=1e-3)
        scale = 0.2 * bend * 0.9 / chi2.median(components) ** 0.5
        assert row_weights(loss, residual, data).scale_mm == pytest.approx(scale)

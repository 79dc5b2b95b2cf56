"""Order and prior of the VEC model by evidence: known truth, wrong readings, repeats, few poses."""

from __future__ import annotations

import numpy as np
import pytest
import shared_data
from scipy.stats import multivariate_normal

from kinacc.calibration import delivered, evidence, models, vec_fit
from kinacc.calibration.evidence import ORDERS
from kinacc.calibration.frames import FrameParameters, known
from kinacc.calibration.observations import full_poses
from kinacc.calibration.vec_fit import Prior
from kinacc.checks.contradictions import load
from kinacc.geometry import Pose, exp_so3
from kinacc.kinematics import robot, vec
from kinacc.synthetic import source

SERIES = "ur10_tmac/series_D.csv"
AXES = ("x_mm", "y_mm", "z_mm")
ARM = robot.load("mh180")
LOW, HIGH = np.deg2rad([(-10, 70), (-30, 54), (-74, 18), (-170, 170), (-120, 120), (-170, 170)]).T
WEIGHT, POSES, NOISE_MM = 500.0, 200, 0.03
WAVY = Prior(0.3, 0.3e-3, 1.0, 1e-4)


def observed(order, seed=0, prior=WAVY):
    """Poses of an arm whose joint errors are polynomials of ``order``."""
    rng = np.random.default_rng(seed)
    empty = vec.without_errors(ARM.dh, LOW, HIGH, order)
    spread = prior.std(empty)
    true = empty.with_parameters(spread * rng.normal(size=spread.size))
    q = rng.uniform(LOW, HIGH, (POSES, 6))
    seen = vec.pose(true, q)
    turn = exp_so3(NOISE_MM / WEIGHT * rng.normal(size=(POSES, 3)))
    moved = seen.position_mm + NOISE_MM * rng.normal(size=(POSES, 3))
    return full_poses(q, Pose(turn @ seen.rotation, moved), fold=np.arange(POSES) % 5)


def choose(seen, orders=(1, 2, 3, 4, 6), stated=None):
    empty = vec.without_errors(ARM.dh, LOW, HIGH, 1)
    fixed = FrameParameters.none(known())
    return evidence.choose(seen, empty, fixed, WEIGHT, orders, stated).query("chosen").iloc[0]


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
    seen = observed(2).select(slice(0, 40))
    got = {}
    for prior in (Prior(0.2, 0.2e-3, 0.7, 1e-4), Prior(0.5, 0.5e-3, 1.0, 1e-4)):
        empty = vec.without_errors(ARM.dh, LOW, HIGH, 2)
        free = vec_fit.informed(seen, empty)
        system = vec_fit.PoseSystem(seen, empty, free, FrameParameters.none(known()), WEIGHT)
        rows = [*system.blocks(np.zeros(free.sum()))]
        residual, jacobian = (np.concatenate(each) for each in zip(*rows, strict=True))
        order = np.tile(np.arange(3), 36)
        flat = jacobian[:, order == 0]
        left, values, _ = np.linalg.svd(flat)
        rest = left[:, int(np.sum(values > 1e-9 * values[0])) :]
        spread = jacobian[:, order > 0] * prior.std(empty)[: 36 * 3][order > 0]
        told = rest.T @ spread
        ratio = (prior.delta_mm / NOISE_MM) ** 2
        shape = np.eye(rest.shape[1]) + told @ told.T / NOISE_MM**2
        noise = rest.T @ residual
        variance = noise @ np.linalg.solve(shape, noise) / noise.size
        wanted = multivariate_normal(cov=variance * shape).logpdf(noise)
        linear = evidence._Linear(seen, empty, FrameParameters.none(known()), WEIGHT)
        linear.root[:] = 1.0
        normal, count = linear.above_constants(2, 2)
        at = np.array([0.5 * np.log(ratio), prior.decay])
        got[prior.decay] = -evidence._negative(at, normal, noise.size, np.repeat([1, 2], 36))[0]
        got[prior.decay] -= wanted
        assert count <= noise.size
    assert got[0.7] == pytest.approx(got[1.0], abs=1e-3)


def test_slopes_of_the_evidence_are_its_finite_differences():
    fixed = FrameParameters.none(known())
    empty = vec.without_errors(ARM.dh, LOW, HIGH, 1)
    normal, count = evidence._Linear(observed(3), empty, fixed, WEIGHT).above_constants(3, 3)
    at, degree = np.array([1.5, 0.8]), np.repeat([1, 2, 3], 36)
    slopes = evidence._negative(at, normal, count, degree)[1]
    for i, step in enumerate(1e-5 * np.eye(2)):
        ahead, behind = (
            evidence._negative(at + way * step, normal, count, degree)[0] for way in (1, -1)
        )
        assert slopes[i] == pytest.approx((ahead - behind) / 2e-5, rel=1e-4)


def read(path, arm, highest, orientation, folder):
    """Settings and measured rows of a file, as ``kinacc init`` sets them."""
    (folder / "own.yaml").write_text(
        f"datasets:\n  own:\n    robot: {arm}\n    evaluation: {{space: measured}}\n"
        f"    measurements:\n      source: file\n"
        f"      file: {{path: {path}, orientation: {orientation}}}\n"
        "    calibration:\n      base_and_tool: estimated\n      dh: {fit_to: measurements}\n"
        f"      vec: {{order: auto, prior: chosen, order_highest: {highest}}}\n"
    )
    settings = load([folder / "own.yaml"])["own"]
    return settings, source.run({}, settings)["measurements"]


def orders(settings, rows):
    """``vec_orders`` of these rows."""
    arm = robot.load(settings["robot"])
    every, _ = delivered.observed({"measurements": rows}, arm)
    estimator = models.estimators(settings["calibration"], arm, every)["vec"]
    return estimator.choices(every)["vec_orders"]


def chosen(table):
    return np.asarray(table["order"])[np.asarray(table["chosen"]) == 1].tolist()


def test_a_choice_has_seen_nothing_of_what_is_held_out(tmp_path):
    settings, rows = made_up(tmp_path, poses=60)
    before = orders(settings, rows)
    spoilt = rows | {"x_mm": rows["x_mm"] + 5.0 * (rows["fold"] == 2)}
    after = orders(settings, spoilt)
    assert np.isnan(before["fold"]).any()
    for fold in range(5):
        one, other = (
            np.asarray(each["log_evidence"])[np.asarray(each["fold"]) == fold]
            for each in (before, after)
        )
        assert (len(one) == len(other) and np.allclose(one, other, atol=0.1)) == (fold == 2)


@pytest.mark.parametrize(("row", "axis"), [(613, 2), (402, 0)])
def test_one_reading_off_by_5_mm_does_not_change_the_order(row, axis, tmp_path):
    turn = "{kind: euler, convention: XYZ, unit: deg}"
    settings, rows = read(shared_data.path_of(SERIES), "ur10", 12, turn, tmp_path)
    rows = rows | {"fold": np.full(len(rows["pose"]), np.nan)}
    before = chosen(orders(settings, rows))[0]
    spoilt = rows | {AXES[axis]: rows[AXES[axis]].copy()}
    spoilt[AXES[axis]][row] += 5.0
    after = chosen(orders(settings, spoilt))[0]
    assert abs(ORDERS.index(after) - ORDERS.index(before)) <= 1


def made_up(folder, poses, repeats=1, noise_mm=0.05):
    """A file of positions of an arm whose links are off, each configuration read several times."""
    arm, draw = robot.load("irb120"), np.random.default_rng(3)
    q = np.repeat(draw.uniform(-1.2, 1.2, (poses, 6)), repeats, axis=0)
    place = robot.forward(arm, q).position_mm + draw.normal(0.0, noise_mm, (len(q), 3))
    lines = [",".join([*(f"q{i}_rad" for i in range(1, 7)), "x_mm", "y_mm", "z_mm"])]
    lines += [",".join(f"{value:.9f}" for value in row) for row in np.hstack([q, place])]
    (folder / "own.csv").write_text("\n".join(lines) + "\n")
    return read(folder / "own.csv", "irb120", 40, "{kind: none}", folder)


def test_the_search_ends_where_high_orders_gain_nothing(tmp_path):
    table = orders(*made_up(tmp_path, poses=600))
    assert set(chosen(table)) <= {1, 2}
    assert max(table["order"]) <= 6  # 600 poses can carry 40

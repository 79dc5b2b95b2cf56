"""Few positions: an automatic calibration ends, and predicts no worse than the nominal arm."""

from __future__ import annotations

import numpy as np
import pytest
import simulated

from kinacc.calibration import models
from kinacc.calibration.dh_estimator import free_parameters, parallel_joints
from kinacc.calibration.residuals import errors
from kinacc.checks.coverage import few_poses
from kinacc.config.schema import defaults
from kinacc.kinematics import robot

SUBSETS = {6: 12, 8: 12, 12: 4, 20: 4}  # of 12 and more all leave about the same


def settings():
    made = defaults()["calibration"]
    made["base_and_tool"] = "estimated"
    made["dh"] |= {"fit_to": "measurements", "hayati_joints": "auto"}
    made["vec"] |= {"order": "auto", "prior": "chosen"}
    return made


def positions(name, offset_deg=(0.2, 0.45)):
    """Positions of an arm whose joints are off by ``offset_deg`` either way."""
    arm, rng = robot.load(name), np.random.default_rng(1)
    free = free_parameters(6, parallel_joints(arm.dh), True)
    true = simulated.disturbed(arm.dh, free, rng, 0.5e-3, 0.3)
    turned = np.zeros((6, 5))
    turned[:, 0] = np.deg2rad(rng.uniform(*offset_deg, 6)) * rng.choice([-1.0, 1.0], 6)
    true = true.with_parameters(true.start + turned.ravel())
    return arm, simulated.measure(true, simulated.joints(arm, 300, rng), simulated.POINT, rng)


def mean_errors(arm, train, test, *kinds):
    every = models.estimators(settings(), arm, train)
    fits = models.fit_all(train, [every[kind] for kind in kinds])
    found = errors(fits, test)
    return [
        np.linalg.norm(found[f"{kind}_vs_measured"][:, :3], axis=1).mean()
        for kind in (*kinds, "nominal")
    ]


@pytest.mark.parametrize(
    ("name", "offset_deg"),
    [("mh180", (0.2, 0.45)), ("ur10", (0.2, 0.45)), ("irb120", (0.0, 0.05))],
)
def test_dh_from_few_positions_beats_the_nominal_arm(name, offset_deg):
    arm, seen = positions(name, offset_deg)
    test = seen.select(slice(100, None))
    for size, subsets in SUBSETS.items():
        found = []
        for subset in range(subsets):
            rows = np.random.default_rng(100 * size + subset).permutation(100)[:size]
            found.append(mean_errors(arm, seen.select(rows), test, "dh"))
        by_dh, nominal = np.mean(found, axis=0)
        assert by_dh < nominal, (size, by_dh, nominal)
        if size >= 20:
            assert by_dh < 0.12
            assert by_dh < 0.3 * nominal


def test_very_few_positions_leave_the_arm_nominal():
    arm, seen = positions("ur10")
    by_dh, nominal = mean_errors(arm, seen.select(slice(5)), seen.select(slice(100, None)), "dh")
    assert by_dh == pytest.approx(nominal, rel=1e-9)
    # Priors hold the arm below three numbers a parameter, 24 and 9 of base and tool.
    estimator = models.estimators(settings(), arm, seen)["dh"]
    for count, held in ((32, True), (33, False)):
        found = estimator.fit(seen.select(slice(count)), {})
        assert (found.solution.spectrum is None) == held


@pytest.mark.parametrize("size", [5, 20])
def test_every_model_of_an_automatic_calibration_ends(size):
    arm, seen = positions("mh180", (0.0, 0.05))
    test = seen.select(slice(100, None))
    found = mean_errors(arm, seen.select(slice(size)), test, "vec", "dh")
    assert np.isfinite(found).all()
    assert found[1] <= found[2] * (1.0 + 1e-9)


@pytest.mark.parametrize(("targets", "numbers"), [(1, 3), (2, 6), (3, 6)])
def test_a_pose_gives_six_numbers_at_most_whatever_it_carries(targets, numbers):
    arm, stated = robot.load("ur10"), settings()
    stated["vec"] |= {"order": 2, "prior": "stated"}
    frames, rng = 6 + 3 * targets, np.random.default_rng(2)

    def found(poses):
        seen = simulated.measure(arm.dh, simulated.joints(arm, poses, rng), simulated.THREE, rng)
        return few_poses(simulated.columns_of(seen.select(seen.target < targets)), arm, stated)

    enough = -(-(frames + 6 * 6 * 3) // numbers)  # orders 0, 1 and 2 of six errors of six joints
    assert not found(enough)
    (finding,) = found(enough - 1)
    assert finding.values["numbers"] == numbers * (enough - 1)

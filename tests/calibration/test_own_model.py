"""An error model of one's own: registered in a line, fitted, held out and selected as DH is."""

from __future__ import annotations

import numpy as np
import pytest
import simulated
from simulated import Ripple
from test_few_poses import settings

import kinacc
from kinacc.calibration import models
from kinacc.calibration.own_model import OwnEstimator, register_error_model
from kinacc.calibration.residuals import cross_validated
from kinacc.calibration.stages import selection
from kinacc.config import error_models
from kinacc.kinematics import robot
from kinacc.tables.contract import ARTEFACTS


class Loose(Ripple):
    """The same without priors, under names that say no unit."""

    names = property(lambda self: tuple(f"p{n}" for n in range(42)))
    prior_std = property(lambda self: np.full(42, np.inf))


@pytest.fixture
def registered():
    before = dict(error_models.ERROR_MODELS), dict(ARTEFACTS)
    register_error_model(Ripple)
    yield
    error_models.OWN.clear()
    for now, then in zip((error_models.ERROR_MODELS, ARTEFACTS), before, strict=True):
        now.clear()
        now.update(then)


def test_a_registered_model_is_fitted_held_out_and_selected(registered):
    arm, rng = robot.load("mh180"), np.random.default_rng(0)
    waves, q = 1e-3 * rng.normal(size=(6, 2)), simulated.joints(arm, 80, rng)
    built = simulated.disturbed(arm.dh, np.array([0.0, 1.0, 1.0, 0.0, 0.0]), rng)
    seen = simulated.measure(Ripple(built, waves), q, simulated.POSE, rng, 0.03)
    every = models.estimators(settings(), arm, seen)
    assert next(iter(every)) == "ripple"
    pair = [every["ripple"], every["dh"]]
    found = pair[0].fit(seen, {})
    # Of the first and last joints some is base and tool.
    np.testing.assert_allclose(found.model.waves[1:5], waves[1:5], atol=1e-4)
    loose = type("Of", (OwnEstimator,), {"kind": "loose", "model": Loose})(pair[0].common)
    variance = loose.fit(seen, {}).solution.variance
    assert variance == pytest.approx(found.solution.variance, rel=0.2)
    held_out, _ = cross_validated(
        seen, lambda train, fold: models.fit_all(train, pair), range(2), ("ripple", "dh", "nominal")
    )
    table = selection(seen, held_out).set_index("model")
    assert table.index[table["selected"] == 1].tolist() == ["ripple"]
    assert table["held_out_rms_mm"]["ripple"] < 0.1 < table["held_out_rms_mm"]["dh"]


def test_a_registered_model_is_calibrated_and_saved_as_others_are(registered, tmp_path):
    (tmp_path / "arm.yaml").write_text(
        "datasets: {arm: {robot: mh180}}\n"
        "measurements: {folds: 2, synthetic: {poses: 40}}\ncalibration: {vec: {order: 1}}\n"
    )
    calibration = kinacc.calibrate(kinacc.read_measurements(tmp_path / "arm.yaml"))
    assert "ripple_vs_measured" in set(calibration.residuals["comparison"])
    folder = calibration.save(tmp_path / "arm")
    read = kinacc.load_calibration(folder).table("model_selection")
    assert "ripple" in set(read["model"])
    (path,) = kinacc.load_calibration(folder, "ripple").export(tmp_path)
    assert '"error_model": "ripple"' in path.read_text()
    own = kinacc.read_table(folder / "ripple_model.parquet")
    np.testing.assert_array_equal(own["value"], calibration.table("ripple_model")["value"])

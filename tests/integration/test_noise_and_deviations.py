"""One figure of the noise for one file, and what standard deviations beside it are worth."""

from __future__ import annotations

import json

import numpy as np
import pytest
from calibration.simulated import POINT, Ripple, disturbed, measure
from command_line import answer, call
from measured_files import write_readings
from stages_by_hand import run_stages

from kinacc.calibration.misfit import misfit
from kinacc.kinematics import robot
from kinacc.report.summarise import summarise
from kinacc.tables import store

NOISE_MM = np.array([0.02, 0.03, 0.04])  # along the instrument's axes
POSES, TIMES, AGAIN = 150, 3, 40
GEARS_RAD = 1e-3  # eccentricity


def written(folder):
    """A file of positions and its configuration: 40 poses were gone to three times.

    The arm stops within some thousandths of a degree. Its gears are eccentric.
    """
    rng, arm = np.random.default_rng(5), robot.load("irb120")
    q = np.deg2rad(rng.uniform(-70, 70, (POSES, 6)))
    q = np.concatenate([q, *[q[:AGAIN]] * (TIMES - 1)])
    q = q + np.deg2rad(0.01) * rng.uniform(-0.5, 0.5, q.shape)
    phase = rng.uniform(0, 6, 6)
    waves = GEARS_RAD * np.column_stack([np.cos(phase), np.sin(phase)])
    built = Ripple(disturbed(arm.dh, np.arange(5) < 4, rng, 5e-4, 0.3), waves)
    seen = measure(built, q, POINT, rng, NOISE_MM)
    path = write_readings(folder / "arm.csv", q, seen.position_mm)
    config = path.with_suffix(".yaml")
    config.write_text(
        f"datasets: {{arm: {{robot: irb120, measurements: {{source: file, file: {{path: {path}, "
        "orientation: {kind: none}}}, calibration: {base_and_tool: estimated, vec: {order: 2}, "
        "dh: {fit_to: measurements}}, evaluation: {space: measured}}}\n"
    )
    return config


@pytest.fixture(scope="module")
def eccentric(tmp_path_factory):
    """The configuration and the results folder of such an arm."""
    folder = tmp_path_factory.mktemp("eccentric")
    config = written(folder)
    stages = ("measurements", "vec", "dh", "residuals", "summary")
    return config, run_stages(stages, [config], folder / "results")


def test_check_and_calibration_state_one_noise_of_a_file(eccentric):
    config, results = eccentric
    noise = answer("check-data", config, code=None)["datasets"][0]["facts"]["noise"]
    freedom = AGAIN * (TIMES - 1)
    assert (noise["degrees_of_freedom"], noise["configurations"]) == (freedom, AGAIN)
    off = np.array(noise["std_mm"]) / NOISE_MM - 1.0
    assert np.all(np.abs(off) < 4.0 / np.sqrt(2.0 * freedom))
    assert summarise(results).noise_mm == pytest.approx(noise["per_axis_mm"], rel=1e-9)


def test_standard_deviations_of_an_arm_with_eccentric_gears_are_marked(eccentric, tmp_path):
    _, results = eccentric
    summary, errors = summarise(results), store.read(results / "pose_errors.parquet")
    rows = (errors["comparison"] == "dh_vs_measured") & (errors["estimate"] == "cross_validated")
    error_mm = np.sqrt(np.mean([errors[f"e{axis}_mm"][rows] ** 2 for axis in "xyz"]))
    ratio = summary.held_out_over_noise["dh"]
    assert ratio == pytest.approx(error_mm / summary.noise_mm, rel=1e-6)
    assert ratio > 3.0
    assert f"DH {ratio:.3g}" in " ".join(call("summary", results).output.split())
    call("export", results, "--out", tmp_path, code=0)
    exported = json.loads(next(tmp_path.glob("*.json")).read_text())["standard_deviations"]
    assert exported["held_out_over_noise"] == pytest.approx(ratio)
    compared = answer("compare", results, results)["held_out_over_noise"]
    assert compared == pytest.approx([ratio, ratio])


def test_without_repeated_readings_the_noise_is_unknown(eccentric):
    _, results = eccentric
    tables = {name: store.read(results / f"{name}.parquet")
              for name in ("measurements", "model_selection")}  # fmt: skip
    tables["measurements"] = {key: rows[:POSES] for key, rows in tables["measurements"].items()}
    facts = misfit(tables, robot.load("irb120"), "dh").as_facts()
    assert facts["held_out_over_noise"] is None
    assert facts["noise_per_axis_mm"] is None
    assert facts["noise_freedom"] == 0
    assert facts["held_out_rms_per_axis_mm"] > 0.0

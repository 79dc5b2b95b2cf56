"""The summary of one calibration and the table of many, as ``kinacc summary`` gives them."""

import math
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from command_line import answer, call
from held_out_errors import held_out_mm
from stages_by_hand import run_stages

from kinacc.calibration.summary import TABLES
from kinacc.campaign.campaign import Campaign
from kinacc.deployment import folder
from kinacc.gate.gates import of_gate
from kinacc.gate.outcome import FAILED, PASSED
from kinacc.gate.values import RunTables
from kinacc.report import summarise
from kinacc.report.rendering import size
from kinacc.tables import sums


@pytest.fixture(scope="module")
def study(study, tmp_path_factory):
    """Results of a small synthetic study, up to its summary."""
    base = shutil.copytree(study.parents[1], tmp_path_factory.mktemp("summary") / "study")
    return run_stages(["summary"], [base / "small.yaml"], base / "results")


@pytest.fixture
def fleet(study, tmp_path, monkeypatch):
    """Results of two robots, line_a and line_b, in the current folder."""
    for name in ("line_a", "line_b"):
        shutil.copytree(study, tmp_path / "results" / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path / "results"


def campaign(name, readings=8, noise=0.05, more=()):
    """A campaign of five candidates, so many of its readings taken, a little off."""
    words = ("--model", "dh", "--candidates", 5, "--budget", 8, "--noise-mm", noise, *more)
    call("campaign", "start", f"check_{name}", "--calibration", f"results/{name}", *words, code=0)
    opened = Campaign(f"check_{name}")
    for number in range(readings):
        opened.add_reading(opened.next_pose().expected_mm + 0.01 * number)


def told(*words, code=0):
    return answer("summary", *words, code=code)


def verdicts(*words, code=0):
    found = told(*words, code=code).items()
    return {name: (each["verdict"] or {}).get("verdict") for name, each in found}


def test_errors_are_those_of_the_pose_errors_of_the_selected_model(fleet):
    (known,) = told("results/line_a").values()
    sizes = np.linalg.norm(held_out_mm(fleet / "line_a"), axis=1)
    names = ["model", "reference", "estimate", "quantity"]
    errors = pd.DataFrame(known["errors"]).set_index(names)
    errors = errors.loc[known["selected"], "measured", "held_out", "position"]
    assert errors["n"] == len(sizes)
    assert errors["mean"] == pytest.approx(sizes.mean(), rel=1e-12)
    assert errors["largest"] == pytest.approx(sizes.max(), rel=1e-12)
    assert errors["quantile_99"] == pytest.approx(np.quantile(sizes, 0.99), rel=1e-12)
    assert (known["synthetic"], known["robot"]) == (True, "mh180")
    call("summary", "-o", "fleet.xlsx", code=0)
    many = pd.read_excel("fleet.xlsx")
    assert list(many["data_set"]) == ["line_a", "line_b"]
    assert many["held_out_mean_mm"][0] == pytest.approx(sizes.mean(), rel=1e-11)
    assert many["bound_mm"].isna().all()


def test_a_campaign_bounds_the_robot_it_is_about_and_no_other_by_its_own_tolerance(fleet):
    campaign("line_b", more=("--tolerance-mm", 2))
    found = told()
    status, verdict = found["line_b"]["campaign"], found["line_b"]["verdict"]
    bound = status["bounds"][0]
    assert 0.0 <= bound["lower_mm"] <= bound["upper_mm"]
    assert (bound["confidence"], status["candidates"], status["readings"]) == (0.95, 5, 8)
    assert (verdict["tolerance_mm"], verdict["verdict"]) == (2.0, "accept")
    assert (found["line_a"]["campaign"], found["line_a"]["verdict"]) == (None, None)
    summary = summarise.summarise("results/line_b")
    some = replace(summary.campaign, bounds=[replace(summary.campaign.of_all, excepted=1)])
    assert replace(summary, campaign=some).verdict("bound", 2.0).verdict == "undecided"
    wide_mm = bound["upper_mm"] + 0.01
    for own_mm, tolerance_mm, confidence, wanted in (
        (None, wide_mm, 0.95, PASSED), (wide_mm, 1e-3, None, PASSED), (None, wide_mm, 0.96, FAILED),
        (0.5 * bound["lower_mm"], wide_mm, None, FAILED),
    ):  # fmt: skip
        gate = {"kind": "campaign", "campaign": "check_line_b", "name": "", "on_fail": "fail",
                "tolerance_mm": own_mm, "confidence": confidence}  # fmt: skip
        result = of_gate(gate, RunTables(fleet / "line_b"), tolerance_mm, None)
        assert result.verdict == wanted
        assert result.figures["bound_mm"] == bound["upper_mm"]
        assert result.figures["lower_mm"] == bound["lower_mm"] > 0.0


def test_readings_that_contradict_the_noise_accept_nothing(fleet):
    campaign("line_a", readings=7, noise=1.0)
    assert verdicts("--tolerance-mm", 50, code=1)["line_a"] == "undecided"


def test_held_out_errors_are_judged_by_a_tolerance_that_has_to_be_given(fleet):
    found = summarise.summarise("results/line_a").best
    few = found.n < 100
    above = verdicts("--by", "held-out", "--tolerance-mm", found.quantile_99 + 1, code=int(few))
    assert above["line_a"] == ("undecided" if few else "accept")
    below = verdicts("--by", "held-out", "--tolerance-mm", found.quantile_99 / 2, code=1)
    assert below["line_a"] == "reject"
    call("summary", "--by", "held-out", code=2)


def test_results_without_a_calibration_are_named_and_the_others_summarised(fleet):
    (fleet / "line_c" / "logs").mkdir(parents=True)
    shutil.copytree(fleet / "line_a", fleet / "line_d")
    (fleet / "line_d" / "summary.parquet").write_bytes(b"half of one")
    found = told(code=1)
    assert "line_c" in found["line_c"]["problem"]
    assert "summary.parquet" in found["line_d"]["problem"]
    assert found["line_a"]["selected"]


def test_a_joint_bends_where_either_of_its_coefficients_was_fitted():
    nan = np.nan
    names = ["joint", "compliance_rad_per_nm", "lever_coefficient_rad_per_mm"]
    rows = np.array([[1, nan, nan], [2, 1e-6, nan], [3, nan, 2e-6]])
    table = pd.DataFrame(rows, columns=names)
    for name in names[1:]:
        table[f"std_{name}"] = nan
    found = summarise.compliance(dict(table))
    assert found[names].to_numpy() == pytest.approx(rows[1:], nan_ok=True)
    assert summarise.compliance(None).empty


@pytest.mark.parametrize(
    ("value", "text"), [(0.30734, "0.307"), (12.34, "12.3"), (4680.0, "4680"), (0.0, "0")]
)
def test_three_significant_digits_without_an_exponent(value, text):
    assert size(value) == text


def test_reading_noise_that_a_file_states_is_taken_out_of_the_rms(study, tmp_path):
    tables = folder.read_tables(study, needed=TABLES)
    known = summarise.summarise(study, tables, campaigns=())
    assert math.isnan(known.rms_without_noise_mm)
    rows = len(tables["measurements"]["pose"])
    for std_mm, wanted in ((0.1, math.sqrt(known.best.rms**2 - 0.03)), (9.0, 0.0)):
        stated = {f"std_{axis}_mm": np.full(rows, std_mm) for axis in "xyz"}
        changed = {**tables, "measurements": {**tables["measurements"], **stated}}
        found = summarise.summarise(study, changed, campaigns=())
        assert found.rms_without_noise_mm == pytest.approx(wanted, rel=1e-9)


def test_a_line_of_a_series_has_the_day_of_its_measurement(study, tmp_path):
    line = shutil.copytree(study, tmp_path / "arm-2026-03-01")
    assert summarise.summarise(line).measured == "2026-03-01"
    assert summarise.summarise(study).measured == ""


def test_a_study_of_an_earlier_calibration_is_left_out_whole(study, tmp_path):
    line = shutil.copytree(study, tmp_path / "arm")
    for name in ("assessment_points", "study_summary"):
        (line / f"{name}.parquet").touch()
    earlier = sums.text_of({"assessment_points.parquet": b""}, {"vec_model.parquet": "0" * 64})
    (line / "sums" / "assessment_points.sha256").write_bytes(earlier)
    assert summarise.made_of_others(line) == {"assessment_points", "study_summary"}

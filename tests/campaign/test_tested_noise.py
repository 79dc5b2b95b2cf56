"""The noise that a repeatability test told, as campaigns begin and are planned with it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from campaign_on_disk import refusal
from command_line import call

from kinacc.campaign import folder as campaigns


@pytest.fixture
def tested(tmp_path):
    """The answer of `kinacc repeatability` on visits of poses with these standard deviations."""

    def make(std_mm=(0.05,) * 20, visits=3, name="noise.json"):
        rng = np.random.default_rng(1)
        rows = ["pose,visit,x_mm,y_mm,z_mm"]
        for pose, std in enumerate(std_mm):
            for visit in range(visits):
                at = ",".join(f"{each:.6f}" for each in 100.0 * pose + std * rng.normal(size=3))
                rows.append(f"P{pose},{visit},{at}")
        (tmp_path / "repeats.csv").write_text("\n".join(rows) + "\n")
        call("repeatability", tmp_path / "repeats.csv", "-o", tmp_path / name, "--force", code=0)
        return tmp_path / name

    return make


def test_a_noise_both_tested_and_stated_is_refusal(tested, study, tmp_path):
    file = tested()
    given = ["--repeatability", file, "--noise-mm", 0.1]
    said = refusal("campaign", "start", tmp_path / "check", "--calibration", study, *given)
    assert "--repeatability: is given beside instrument=0.1" in said
    assert "is given beside" in refusal("campaign", "plan", *given)
    assert not (tmp_path / "check").exists()


def test_a_campaign_begins_with_the_noise_that_was_tested_and_its_degrees_of_freedom(tested, begun):
    file = tested()
    noise = json.loads(file.read_text())["noise"]
    plan = campaigns.open_(begun("--repeatability", file)).plan
    settings = plan.assessor
    assert (settings.noise, settings.noise_freedom) == ("estimated", int(noise["freedom"]))
    np.testing.assert_allclose(plan.instruments[0].covariance_mm2, noise["covariance_mm2"])


def test_a_noise_that_differs_by_axis_is_turned_with_the_frame_of_its_readings(tested, begun):
    file = tested(visits=4)
    content = json.loads(file.read_text())
    content["noise"]["covariance_mm2"] = np.diag([0.01, 0.04, 0.09]).tolist()
    file.write_text(json.dumps(content))
    plan = campaigns.open_(begun("--repeatability", file)).plan
    turn = plan.to_base.rotation
    wanted = turn @ np.diag([0.01, 0.04, 0.09]) @ turn.T
    np.testing.assert_allclose(plan.covariance_mm2[3], wanted, rtol=1e-12)


def test_poses_that_scatter_differently_are_asked_about_before_one_noise_is_taken(tested, begun):
    file = tested(std_mm=(0.02,) * 19 + (0.2,), visits=6)
    said = refusal("campaign", "plan", "--repeatability", file)
    assert "pose P19" in said
    assert "--sure takes that of all poses together" in said
    plan = campaigns.open_(begun("--repeatability", file, "--sure")).plan
    assert any("pose P19" in each for each in plan.overruled)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("pose,visit,x_mm\n", "is no answer of kinacc repeatability"),
        ({"noise": None}, "has no noise"),
        ({"noise": {"covariance_mm2": [[1, 0, 0]], "freedom": 40}}, "has no covariance"),
        (
            {"noise": {"covariance_mm2": [[1, 0, 0], [0, 0, 0], [0, 0, 1]], "freedom": 40}},
            "has no covariance",
        ),
        (
            {"noise": {"covariance_mm2": np.eye(3).tolist(), "freedom": 0.2}},
            "0 degrees of freedom; allowed: at least 30",
        ),
    ],
)
def test_a_file_that_tells_no_noise_is_refused_with_how_to_make_one(tested, content, said):
    file = tested()
    if isinstance(content, dict):
        content = json.dumps({**json.loads(file.read_text()), **content})
    file.write_text(content)
    told = refusal("campaign", "plan", "--repeatability", file)
    assert said in told
    assert "kinacc repeatability FILE -o noise.json" in told

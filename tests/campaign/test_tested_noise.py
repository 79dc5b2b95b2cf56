"""The noise that a repeatability test told, as campaigns begin and are planned with it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from campaign_on_disk import Arm
from command_line import call

from kinacc.campaign import folder as campaigns
from kinacc.campaign.campaign import Campaign


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
        done = call("repeatability", tmp_path / "repeats.csv", "-o", tmp_path / name, "--force")
        assert done.exit_code == 0, done.output
        return tmp_path / name

    return make


def refused(*words):
    """The message of a command that has to fail before anything is written."""
    done = call(*words)
    assert done.exit_code == 2, done.output
    assert "Traceback" not in done.output
    return done.output


def test_a_noise_both_tested_and_stated_is_refused(tested, calibration, tmp_path):
    file = tested()
    given = ["--repeatability", file, "--noise-mm", 0.1]
    said = refused("campaign", "start", tmp_path / "check", "--calibration", calibration, *given)
    assert "--repeatability: is given beside instrument=0.1" in said
    assert "is given beside" in refused("campaign", "plan", *given)
    assert not (tmp_path / "check").exists()


def test_an_assessor_that_takes_the_noise_as_known_is_not_handed_a_tested_one(tested):
    said = refused("campaign", "plan", "--repeatability", tested(), "--assessor", "single_shot")
    assert "single_shot takes the noise as known" in said


def test_a_campaign_begins_with_the_noise_that_was_tested_and_its_degrees_of_freedom(tested, begun):
    file = tested()
    noise = json.loads(file.read_text())["noise"]
    plan = campaigns.open_(begun("--repeatability", file)).plan
    settings = plan.assessor
    assert (settings.noise, settings.noise_freedom) == ("estimated", int(noise["freedom"]))
    np.testing.assert_allclose(plan.instruments[0].covariance_mm2, noise["covariance_mm2"])


def test_a_bound_says_that_it_rests_on_a_factor_that_a_test_told(tested, begun, tmp_path):
    folder = begun("--repeatability", tested(), "--frame", "base")
    arm = Arm(folder)
    rows = ["pose,x_mm,y_mm,z_mm"]
    rows += [f"{label},{arm.position(label)}" for label in arm.plan.points.label]
    (tmp_path / "readings.csv").write_text("\n".join(rows) + "\n")
    done = call("campaign", "record", folder, tmp_path / "readings.csv", "--accept-implausible")
    assert done.exit_code == 0, done.output
    freedom = arm.plan.assessor.noise_freedom
    assert f"{freedom} degrees of freedom" in Campaign(folder).status().assumes


def test_a_noise_that_differs_by_axis_is_turned_with_the_frame_of_its_readings(tested, begun):
    file = tested(visits=4)
    content = json.loads(file.read_text())
    content["noise"]["covariance_mm2"] = np.diag([0.01, 0.04, 0.09]).tolist()
    file.write_text(json.dumps(content))
    plan = campaigns.open_(begun("--repeatability", file)).plan
    turn = plan.to_base.rotation
    wanted = turn @ np.diag([0.01, 0.04, 0.09]) @ turn.T
    np.testing.assert_allclose(plan.covariance_mm2[3], wanted, rtol=1e-12)


def test_a_plan_with_a_tested_noise_is_little_wider_than_with_the_same_noise_stated(tested):
    file = tested(std_mm=(0.05,) * 30, visits=4)
    std = json.loads(file.read_text())["std_mm"][0]
    words = (
        "--candidates",
        20,
        "--budget",
        100,
        "--repetitions",
        3,
        "--errors",
        "smooth",
        "--json",
    )
    found = []
    for noise in (["--repeatability", file], ["--noise-mm", std, "--set", "noise_margin=1"]):
        done = call("campaign", "plan", *noise, *words)
        assert done.exit_code == 0, done.output
        found.append(json.loads(done.stdout)["rows"][0]["width_median_mm"])
    assert found[1] < found[0] < 1.1 * found[1]


def test_poses_that_scatter_differently_are_asked_about_before_one_noise_is_taken(tested, begun):
    file = tested(std_mm=(0.02,) * 19 + (0.2,), visits=6)
    said = refused("campaign", "plan", "--repeatability", file)
    assert "pose P19" in said
    assert "--sure takes that of all poses together" in said
    plan = campaigns.open_(begun("--repeatability", file, "--sure")).plan
    assert any("pose P19" in each for each in plan.overruled)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("pose,visit,x_mm\n", "is no answer of kinacc repeatability"),
        ("[1, 2]", "is no answer of kinacc repeatability"),
        ('{"rows": []}', "is no answer of kinacc repeatability"),
        ({"noise": None}, "has no noise"),
        ({"noise": {"covariance_mm2": [[1, 0, 0]], "freedom": 40}}, "is no answer"),
        (
            {"noise": {"covariance_mm2": [[1, 0, 0], [0, 0, 0], [0, 0, 1]], "freedom": 40}},
            "not positive definite",
        ),
        (
            {"noise": {"covariance_mm2": np.eye(3).tolist(), "freedom": 0.2}},
            "0 degrees of freedom; allowed: at least 30",
        ),
        ({"noise": {"covariance_mm2": np.eye(3).tolist(), "freedom": "many"}}, "is no answer"),
    ],
)
def test_a_file_that_tells_no_noise_is_refused_with_how_to_make_one(tested, content, said):
    file = tested()
    if isinstance(content, dict):
        content = json.dumps({**json.loads(file.read_text()), **content})
    file.write_text(content)
    told = refused("campaign", "plan", "--repeatability", file)
    assert said in told
    assert "kinacc repeatability FILE -o noise.json" in told


def test_readings_of_a_workbook_are_taken_into_a_campaign(begun, tmp_path):
    from openpyxl import Workbook

    folder = begun("--noise-mm", 0.05, "--frame", "base")
    point = json.loads(call("campaign", "next", folder, "--json").stdout)["rows"][0]
    book = Workbook()
    book.active.append(["pose", "x_mm", "y_mm", "z_mm"])
    book.active.append([int(point["pose"]), *(point[f"expected_{axis}_mm"] for axis in "xyz")])
    book.save(tmp_path / "readings.xlsx")
    done = call("campaign", "record", folder, tmp_path / "readings.xlsx", "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["numbers"] == [1]

"""Campaign files that were edited or made to do harm, and settings beyond all arms."""

from __future__ import annotations

import json

import pytest
from command_line import call

from kinacc.campaign import folder
from kinacc.errors import InputError


@pytest.fixture
def begun(tmp_path, make_plan):
    """A campaign on disk."""
    folder.start(tmp_path, make_plan(points=8, budget=8))
    return tmp_path


def refusal(path) -> str:
    done = call("campaign", "status", path, "--simulations", 0)
    assert done.exit_code == 2, done.output
    assert isinstance(done.exception, SystemExit), done.exception
    return done.output


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("order", [0, 0, 1, 2, 3, 4, 5, 6]),
        ("order", list(range(7, -1, -2))),
        ("route", [99]),
        ("instruments", []),
        ("to_base", {"rotation": [[1]], "position_mm": [0]}),
        ("points", [[]]),
        ("arm", None),
        ("seed", None),
        ("limits", {"joint_rad": "x", "implausible_mm": 1}),
    ],
    ids=str,
)
def test_an_edited_plan_is_no_campaign(begun, key, value):
    path = begun / "campaign.json"
    content = json.loads(path.read_text())
    path.write_text(json.dumps({**content, key: value}))
    assert "is no campaign" in refusal(begun)


@pytest.mark.parametrize(
    "text", ["[" * 100_000, '{"format": 1, "seed": ' + "9" * 100_000 + "}", "[]", "null", "{}"],
    ids=["nested brackets", "long digits", "a list", "null", "nothing"],
)  # fmt: skip
def test_a_plan_made_to_do_harm_is_refused(begun, text):
    (begun / "campaign.json").write_text(text)
    assert "is no campaign" in refusal(begun)


@pytest.mark.parametrize(
    "line",
    ["[" * 100_000, '{"entry": {"a": ' + "9" * 100_000 + '}, "chain": "x"}', "[]"],
    ids=["nested brackets", "long digits", "a list"],
)
def test_a_journal_made_to_do_harm_is_refused_with_its_line(begun, line):
    (begun / "readings.jsonl").write_text(line + "\n")
    assert "readings.jsonl, line 1: cannot be read" in refusal(begun)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--set", "confidence=[1]"), "setting confidence"),
        (("--set", "measurements=true"), "setting measurements"),
        (("--set", "isolation=" + "[" * 5000), "setting isolation"),
        (("--assessor", "sequential", "--set", "width_mm=wide"), "setting width_mm"),
        (("--assessor", "invalidation_calibrated", "--set", "alpha=1"), "setting alpha"),
        (("--assessor", "invalidation_calibrated", "--set", "alpha=null"), "setting alpha"),
        (("--noise-mm", "1e-320"), "at least 1e-09 mm"),
        (("--largest-mm", "1e308"), "--largest-mm: 1e+308; allowed: above 0, to 1e+06"),
    ],
    ids=lambda given: " ".join(given)[:30] if isinstance(given, tuple) else "",
)
def test_settings_that_are_no_numbers_of_an_arm_are_named(words, said):
    done = call("plan-campaign", "--noise-mm", "0.05", "--poses", 20, "--budget", 20,
                "--errors", "smooth", *words)  # fmt: skip
    assert done.exit_code == 2, done.output
    assert said in done.output


def test_a_tool_beyond_all_arms_is_no_number():
    done = call("plan-poses", "ur10", "--drawn", 50, "--poses", 12, "--tool-mm", "1e308,0,0")
    assert done.exit_code == 2, done.output
    assert "--tool-mm: '1e308,0,0'; allowed: 3 numbers" in done.output


def test_a_campaign_in_order_is_still_read(begun):
    with pytest.raises(InputError):
        folder.open_(begun / "elsewhere")
    assert len(folder.open_(begun).plan.points) == 8

"""Campaign files that were edited or made to do harm, and settings beyond all arms."""

from __future__ import annotations

import json

import pytest
from command_line import call

from kinacc.campaign import folder


@pytest.fixture
def begun(tmp_path, make_plan):
    """A campaign on disk."""
    folder.start(tmp_path, make_plan(points=8, budget=8))
    return tmp_path


def refusal(path) -> str:
    done = call("campaign", "status", path, code=2)
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


def said_of(begun, *entries) -> str:
    """What is said of a journal whose lines follow from one another, made by a stranger."""
    opened = folder.open_(begun)
    for entry in entries:
        known = folder.read_journal(begun / folder.JOURNAL, opened.digest)
        folder.append(begun / folder.JOURNAL, known, entry)
    return refusal(begun)


GOOD = {"point": 0, "position_mm": [0.0, 0.0, 0.0], "instrument": "instrument"}


@pytest.mark.parametrize(
    "wrong",
    [
        {"point": 99}, {"point": "x"}, {"position_mm": [1.0, 2.0]}, {"position_mm": None},
        {"position_mm": [1e308, 0.0, 0.0]}, {"instrument": "other"}, {"joints": [1]},
        {"joints": {}}, {"std": "x"}, {"point": 10**400},
    ],
    ids=str,
)  # fmt: skip
def test_a_reading_that_is_none_of_this_campaign_is_refused_with_its_line(begun, wrong):
    said = said_of(begun, {"kind": "readings", "readings": [{**GOOD, **wrong}]})
    assert "readings.jsonl, line 1: is no entry of this campaign" in said


@pytest.mark.parametrize(
    "entry",
    [
        [], {}, {"kind": "other"}, {"kind": "readings", "readings": [5]},
        {"kind": "readings", "readings": [], "at": "2026-01-01T00:00:00"},
        {"kind": "strike", "reading": 1, "reason": "x"}, {"kind": "leave_out", "point": 8,
        "reason": "x"}, {"kind": "leave_out", "point": 0},
    ],
    ids=str,
)  # fmt: skip
def test_an_entry_that_says_nothing_is_refused_with_its_line(begun, entry):
    assert "readings.jsonl, line 1: is no entry of this campaign" in said_of(begun, entry)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--set", "confidence=[1]"), "setting confidence"),
        (("--set", "noise_margin=" + "[" * 5000), "setting noise_margin"),
        (("--set", "noise_margin=wide"), "setting noise_margin"),
        (("--set", "noise_freedom=40"), "0 where noise is known"),
        (("--noise", "estimate", "--set", "noise_freedom=5"), "at least 30"),
        (("--noise", "estimate", "--wrong-readings", "1%"), "0 where the campaign estimates"),
        (("--arm-mm", "0.1"), "only of visits"),
        (("--references", "20"), "fewer: they take 30 readings"),
        (("--noise-mm", "1e-320"), "at least 1e-09 mm"),
        (("--largest-mm", "1e308"), "1e308; allowed: above 0, to 1e+06"),
    ],
    ids=lambda given: " ".join(given)[:30] if isinstance(given, tuple) else "",
)
def test_settings_that_are_no_numbers_of_an_arm_are_named(words, said):
    done = call("campaign", "plan", "--noise-mm", "0.05", "--candidates", 20, "--budget", 20,
                "--errors", "smooth", *words, code=2)  # fmt: skip
    assert said in done.output

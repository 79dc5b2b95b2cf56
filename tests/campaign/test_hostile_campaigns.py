"""Campaign files that were edited or made to do harm, and settings beyond all arms."""

from __future__ import annotations

import json

import pytest
from campaign_on_disk import make_plan, refusal

from kinacc.campaign import folder


@pytest.fixture
def begun(tmp_path):
    """A campaign on disk."""
    folder.start(tmp_path, make_plan(points=8, budget=8))
    return tmp_path


@pytest.mark.parametrize(
    "changed",
    [
        {"order": [0, 0, 1, 2, 3, 4, 5, 6]}, {"order": list(range(7, -1, -2))}, {"route": [99]},
        {"instruments": []}, {"to_base": {"rotation": [[1]], "position_mm": [0]}},
        {"points": [[]]}, {"arm": None}, {"seed": None},
        {"limits": {"joint_rad": "x", "implausible_mm": 1}}, "[" * 100_000,
        '{"format": 1, "seed": ' + "9" * 100_000 + "}", "[]", "null", "{}",
    ],
    ids=lambda changed: str(changed)[:40],
)  # fmt: skip
def test_a_plan_that_was_edited_or_made_to_do_harm_is_no_campaign(begun, changed):
    path = begun / "campaign.json"
    if isinstance(changed, dict):
        changed = json.dumps(json.loads(path.read_text()) | changed)
    path.write_text(changed)
    assert "is no campaign" in refusal("campaign", "status", begun)


@pytest.mark.parametrize(
    "line",
    ["[" * 100_000, '{"entry": {"a": ' + "9" * 100_000 + '}, "chain": "x"}', "[]"],
    ids=["nested brackets", "long digits", "a list"],
)
def test_a_journal_made_to_do_harm_is_refused_with_its_line(begun, line):
    (begun / "readings.jsonl").write_text(line + "\n")
    assert "readings.jsonl, line 1: cannot be read" in refusal("campaign", "status", begun)


GOOD = {"point": 0, "position_mm": [0.0, 0.0, 0.0], "instrument": "instrument"}


@pytest.mark.parametrize(
    "entry",
    [
        {"point": 99}, {"point": "x"}, {"position_mm": [1.0, 2.0]}, {"position_mm": None},
        {"position_mm": [1e308, 0.0, 0.0]}, {"instrument": "other"}, {"joints": [1]},
        {"joints": {}}, {"std": "x"}, {"point": 10**400},
        [], {"kind": None}, {"kind": "other"}, {"kind": "readings", "readings": [5]},
        {"kind": "readings", "readings": [], "at": "2026-01-01T00:00:00"},
        {"kind": "strike", "reading": 1, "reason": "x"}, {"kind": "leave_out", "point": 8,
        "reason": "x"}, {"kind": "leave_out", "point": 0},
    ],
    ids=lambda entry: str(entry)[:60],
)  # fmt: skip
def test_a_line_that_is_none_of_this_campaign_is_refused(begun, entry):
    """Entries, and readings with one thing wrong, in a journal whose lines follow one another."""
    if isinstance(entry, dict) and "kind" not in entry:
        entry = {"kind": "readings", "readings": [GOOD | entry]}
    opened = folder.open_(begun)
    folder.append(begun / folder.JOURNAL, opened.journal, entry)
    said = refusal("campaign", "status", begun)
    assert "readings.jsonl, line 1: is no entry of this campaign" in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--set", "confidence=[1]"), "setting confidence"),
        (("--set", "noise_margin=" + "[" * 5000), "setting noise_margin"),
        (("--set", "noise_margin=wide"), "setting noise_margin"),
        (("--set", "noise_freedom=40"), "0, or with noise: estimated"),
        (("--noise", "estimate", "--set", "noise_freedom=5"), "at least 30"),
        (("--noise", "estimate", "--wrong-readings", "1%"), "0 where the campaign estimates"),
        (("--arm-mm", "0.1"), "only of visits"),
        (("--references", "20"), "fewer: they take 30 readings"),
        (("--noise-mm", "1e-320"), "at least 1e-09 mm"),
        (("--width-mm", "1e308"), "1e308; allowed: above 0, to 1e+06"),
    ],
    ids=lambda given: " ".join(given)[:30] if isinstance(given, tuple) else "",
)
def test_settings_that_are_no_numbers_of_an_arm_are_named(words, said):
    assert said in refusal("campaign", "plan", "--noise-mm", "0.05", "--candidates", 20,
                           "--budget", 20, "--errors", "smooth", *words)  # fmt: skip

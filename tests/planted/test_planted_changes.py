"""A few of the changes that `tools/planted` plants: each is told and explained rightly."""

from __future__ import annotations

import changes
import judged
import pytest
import unchanged
from planted import Trials

PLANTED = (
    "input: row 33, x_mm by 1e-9",
    "code: kinacc.workflow.stages.claims, reproduced of claims",
    "version: scipy",
    "map.grid_mm: 200.0",
    "repetitions: 3",
    "swapped: own/pose_errors, digests renewed",
    "edited: mh180/accuracy_map",
    "not the same twice: own, gamma99",
)
UNCHANGED = ("chunks in place: 3", "restored 2")


@pytest.fixture(scope="module")
def trials(made) -> Trials:
    return Trials(made)


@pytest.mark.parametrize("name", PLANTED)
def test_a_change_is_told_and_explained_by_what_was_changed_alone(trials, name):
    (case,) = [each for each in changes.everything() if each.name == name]
    assert trials.trial(case)["faults"] == []


@pytest.mark.parametrize("name", UNCHANGED)
def test_nothing_is_told_where_nothing_changed(trials, name):
    (case,) = [each for each in unchanged.everything() if each.name == name]
    assert trials.trial(case)["faults"] == []


def test_there_are_two_hundred_changes_and_one_hundred_reruns():
    assert (len(changes.everything()), len(unchanged.everything())) == (200, 100)


POSE_ERRORS, SUMMARY = ("own", "pose_errors"), ("own", "summary")
BY_INPUT = (("input", "poses"),)


def answer(
    *said: tuple[str, tuple[tuple[str, str], ...]], verdict: str = "failed"
) -> judged.Answer:
    """What a gate would have said of tables of ``own``, by the causes it names."""
    differences = [
        {
            "dataset": "own",
            "artefact": name,
            "causes": [{"kind": kind, "where": where} for kind, where in causes],
        }
        for name, causes in said
    ]
    outcome = {"kind": "accepted", "dataset": "own", "verdict": verdict, "says": "so"}
    return judged.Answer.of({"outcomes": [outcome | {"differences": differences}]})


@pytest.mark.parametrize(
    ("given", "fault"),
    [
        (answer(verdict="passed"), "not told"),
        (answer(("pose_errors", (("input", "poses.csv"),))), ""),
        (answer(("pose_errors", ())), "explained wrongly"),
        (answer(("pose_errors", (("input", "arm.yaml"),))), "explained wrongly"),
        (answer(("pose_errors", (("input", "poses.csv"), ("seed", "seed")))), "explained wrongly"),
        (answer(("summary", (("input", "poses.csv"),))), "not named"),
    ],
)
def test_the_judge_finds_what_a_gate_could_say_wrongly(given, fault):
    truth = {POSE_ERRORS: judged.YES, SUMMARY: judged.NO}
    faults = judged.faults_of(given, truth, BY_INPUT)
    assert (fault in "; ".join(faults)) if fault else faults == []

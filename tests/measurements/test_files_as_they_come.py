"""Measured files as they really come, each through the command line alone."""

from __future__ import annotations

from collections import Counter

import pytest
from measurements.files_as_they_come import FILES
from measurements.scoring import CRASHED, WRONG, Score, score


@pytest.fixture(scope="module")
def scores(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Score]:
    """Score of every file, each in a folder of its own."""
    scored = {}
    for name, write in FILES.items():
        folder = tmp_path_factory.mktemp(name)
        scored[name] = score(write(folder), folder)
    return scored


def test_table_of_all_files(scores: dict[str, Score]) -> None:
    for name, one in scores.items():
        print(f"{name:34s} {one.outcome:8s} {'' if one.holds else '!'} {one.reason}")
    print(dict(Counter(one.outcome for one in scores.values())))
    assert len(scores) >= 34


@pytest.mark.parametrize("name", FILES)
def test_a_file_is_never_read_wrong(name: str, scores: dict[str, Score]) -> None:
    assert scores[name].outcome not in (WRONG, CRASHED), scores[name].reason


@pytest.mark.parametrize("name", FILES)
def test_a_file_is_read_right_or_asked_about_what_it_leaves_open(
    name: str, scores: dict[str, Score]
) -> None:
    assert scores[name].holds, f"{scores[name].outcome}: {scores[name].reason}"

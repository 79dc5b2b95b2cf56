"""Measured files as they really come, each through the command line alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import cache

import pytest
from measurements.files_as_they_come import FILES
from measurements.scoring import CRASHED, WRONG, Score, score

Scored = Callable[[str], Score]


@pytest.fixture(scope="module")
def scored(tmp_path_factory: pytest.TempPathFactory) -> Scored:
    """Score of a file in a folder of its own; each file is written and read once."""

    @cache
    def one(name: str) -> Score:
        folder = tmp_path_factory.mktemp(name)
        return score(FILES[name](folder), folder)

    return one


def test_table_of_all_files(scored: Scored) -> None:
    scores = {name: scored(name) for name in FILES}
    for name, one in scores.items():
        print(f"{name:34s} {one.outcome:8s} {' ' if one.holds else '!'} {one.reason}")
    print(dict(Counter(one.outcome for one in scores.values())))
    assert len(scores) >= 34


@pytest.mark.parametrize("name", FILES)
def test_a_file_is_never_read_wrong(name: str, scored: Scored) -> None:
    one = scored(name)
    assert one.outcome not in (WRONG, CRASHED), one.reason


@pytest.mark.parametrize("name", FILES)
def test_a_file_is_read_right_or_asked_about_what_it_leaves_open(name: str, scored: Scored) -> None:
    one = scored(name)
    assert one.holds, f"{one.outcome}: {one.reason}"

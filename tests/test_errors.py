"""Everything that is wrong is told at once, wherever it was found."""

from __future__ import annotations

import pytest

from kinacc.errors import InputError, Problem, gathered, refuse

ONE, OTHER = Problem("--one", "is odd"), Problem("--other", "is missing")


def test_what_two_steps_find_wrong_is_told_together():
    problems: list[Problem] = []
    for each in (ONE, OTHER):
        with gathered(problems):
            refuse([each])
    with pytest.raises(InputError) as told:
        refuse(problems, "Nothing was done")
    assert told.value.problems == (ONE, OTHER)
    assert str(told.value).startswith("Nothing was done\n")

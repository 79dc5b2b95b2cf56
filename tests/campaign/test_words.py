"""What assessors say in codes, told to people in sentences."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import kinacc
from kinacc.assess.statement import Reason
from kinacc.campaign import reasons, words

_GIVEN = re.compile(r"Reason\(\s*\"(\w+)\"")


def test_every_reason_that_can_be_given_has_words_and_no_words_are_left_over():
    sources = (path.read_text() for path in Path(kinacc.__file__).parent.rglob("*.py"))
    assert set(reasons.REASONS) == {code for text in sources for code in _GIVEN.findall(text)}


@pytest.mark.parametrize(
    ("code", "numbers", "text"),
    [
        ("few_points", {"read": 3, "share": 0.9, "needed": 35},
         "3 points read; 90% of the region needs 35"),
        ("much_noise", {"part": 0.317},
         "noise makes up 32% of the mean square of the readings"),
    ],
)  # fmt: skip
def test_a_reason_is_told_with_its_numbers(code, numbers, text):
    assert words.reason(Reason(code, numbers)) == text

"""Every code of a reason has words, and no words are left over."""

from __future__ import annotations

import re
from pathlib import Path

import kinacc
from kinacc.campaign import reasons

_GIVEN = re.compile(r"Reason\(\s*\"(\w+)\"")


def test_every_reason_that_can_be_given_has_words_and_no_words_are_left_over():
    sources = (path.read_text() for path in Path(kinacc.__file__).parent.rglob("*.py"))
    given = {code for text in sources for code in _GIVEN.findall(text)}
    assert set(reasons.REASONS) == given | {"noise_tested", "noise_estimated"}

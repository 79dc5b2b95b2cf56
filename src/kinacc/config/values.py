"""Values in messages: as they are shown, and the known word nearest to one."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

_LONGEST_WORD = 100  # to compare words takes their lengths multiplied


def shown(value: Any) -> str:
    """A value as it stands in the file, shortened."""
    is_word = value is None or isinstance(value, bool)
    text = {None: "null", True: "true", False: "false"}[value] if is_word else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def nearest(word: object, known: Iterable[str]) -> str:
    """The known word most like ``word``; empty if none is."""
    close = difflib.get_close_matches(str(word)[:_LONGEST_WORD], known, n=1)
    return close[0] if close else ""


def did_you_mean(word: object, known: Iterable[str]) -> str:
    """``did you mean X?`` with the known word most like ``word``; empty if none is."""
    close = nearest(word, known)
    return f"did you mean {close}?" if close else ""

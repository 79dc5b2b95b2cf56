"""Values in messages: as they are shown, and the known word nearest to one."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any


def shown(value: Any) -> str:
    """A value as it stands in the file, shortened."""
    text = repr(value)
    text = {"None": "null", "True": "true", "False": "false"}.get(text, text)
    return text if len(text) <= 60 else f"{text[:57]}..."


def nearest(word: object, known: Iterable[str]) -> str:
    """The known word most like ``word``; empty if none is."""
    # To compare words takes their lengths multiplied.
    return next(iter(difflib.get_close_matches(str(word)[:100], known, n=1)), "")


def did_you_mean(word: object, known: Iterable[str]) -> str:
    """``did you mean X?`` with the known word most like ``word``; empty if none is."""
    close = nearest(word, known)
    return f"did you mean {close}?" if close else ""

"""Values of settings laid over one another, and as messages show them."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
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


def overlay(
    below: Mapping[str, Any], above: Mapping[str, Any], whole: Sequence[str] = ()
) -> dict[str, Any]:
    """Lay values over settings, section by section.

    Parameters
    ----------
    below, above
        Nested settings; a value of ``above`` replaces that of ``below``.
    whole
        Names of mappings that are replaced as other values are.

    Returns
    -------
    dict
        A copy; ``below`` and ``above`` stay as they are.
    """
    merged = dict(below)
    for name, value in above.items():
        old = merged.get(name)
        both = isinstance(old, Mapping) and isinstance(value, Mapping) and name not in whole
        merged[name] = overlay(old, value, whole) if both else value  # type: ignore[arg-type]
    return merged

"""Numbers a person wrote into one word of a command."""

from __future__ import annotations

import numpy as np

_LARGEST = 1e12


def numbers_of(text: str) -> np.ndarray:
    """Numbers (n,) of a text such as "1, 2.5,-3" or "1 2.5 -3".

    None where a word is no number, or one beyond all lengths and angles.
    """
    try:
        values = np.array([float(word) for word in text.replace(",", " ").split()])
    except ValueError:
        return np.zeros(0)
    return values if (np.abs(values) <= _LARGEST).all() else np.zeros(0)

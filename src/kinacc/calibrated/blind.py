"""Directions no pose shows, said so that a person can read them."""

from __future__ import annotations

import numpy as np
from scipy.linalg import qr, solve_triangular

from kinacc.calibration.uncertainty import is_angle

_LEAST = 0.02  # of the largest part of a direction; less is not worth a word


def in_words(directions: np.ndarray, names: tuple[str, ...]) -> list[str]:
    """Each of m ways (m, P) to change parameters (mm, mrad) that changes no pose.

    Any mixture of such ways is one too, so they are first combined to involve few parameters each:
    ``j1.theta_offset +1 mrad with base.rz -1 mrad``.
    """
    words = []
    for direction in _simple(np.atleast_2d(directions)):
        order = np.argsort(-np.abs(direction), kind="stable")
        parts = [_part(names[i], direction[i]) for i in order if abs(direction[i]) >= _LEAST]
        words.append(" with ".join([parts[0], ", ".join(parts[1:])]) if parts[1:] else parts[0])
    return words


def _simple(directions: np.ndarray) -> np.ndarray:
    """The same space by directions that share no pivot, each with a largest part of 1."""
    if not directions.size:
        return directions
    count = len(directions)
    _, upper, pivots = qr(directions, mode="economic", pivoting=True)
    reduced = solve_triangular(upper[:, :count], upper)
    found = np.empty_like(reduced)
    found[:, pivots] = reduced
    largest = np.argmax(np.abs(found), axis=1)
    return found / found[np.arange(count), largest][:, None]


def _part(name: str, value: float) -> str:
    unit = "mrad" if is_angle(name) else "mm"
    stem = name.rpartition("_")[0] if name.endswith(("_mm", "_rad")) else name
    return f"{stem} {value:+.2g} {unit}"

"""Directions of parameters that no pose shows, mixed so that each involves few parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinacc.calibration.frames import MOTIONS, Frames

LEAST = 0.02  # of the largest part of a direction; less is not worth a word
_RANK = 1e-6
_OWN = 0.5  # part of a unit direction beside the structural ones that makes it one of its own


@dataclass(frozen=True, eq=False)
class Group:
    """Parameters that cannot be told from each other: ``directions`` (m, P) that change no pose.

    ``structural``: no pose at all shows them; otherwise only those measured show them too little.
    """

    directions: np.ndarray
    structural: bool

    @property
    def members(self) -> np.ndarray:
        """True (P,) for the parameters it is about."""
        return (np.abs(self.directions) >= LEAST).any(axis=0)


@dataclass(frozen=True)
class LeftOpen:
    """What poses leave open of the parameters ``names`` (P,), base and targets at ``frames``."""

    groups: tuple[Group, ...]
    names: tuple[str, ...]
    frames: Frames


def of_arm(names: Sequence[str]) -> np.ndarray:
    """True (P,) for parameters of the arm; the others are motions of base and targets."""
    return np.array([name.partition(".")[2] not in MOTIONS for name in names])


def groups(hidden: np.ndarray, undetermined: np.ndarray, of_arm: np.ndarray) -> tuple[Group, ...]:
    """Undetermined directions (m, P) by what they share.

    ``hidden`` (h, P) span what no pose shows, ``undetermined`` (u, P) that and what some poses
    would show; ``of_arm`` (P,) marks parameters of the arm, the others are motions of frames.
    Any mixture of directions no pose shows is one too: they are mixed to involve few parameters
    each, scaled to a largest part of 1 (mm and mrad), those of the arm alone gathered where they
    have parameters in common. Directions that some pose would show come last, free of the others.
    """
    hidden_frames, hidden_arm = _apart(hidden, of_arm)
    frames, arm = _apart(undetermined, of_arm)
    found = [Group(each[None], True) for each in _simple(hidden_frames, ~of_arm)]
    found += [Group(each, True) for each in _gathered(_simple(hidden_arm, of_arm), ~of_arm)]
    weak = [*_simple(_beside(frames, hidden_frames, ~of_arm), ~of_arm)]
    weak += [*_simple(_beside(arm, hidden_arm, of_arm), of_arm)]
    return (*found, *(Group(each[None], False) for each in weak))


def _apart(rows: np.ndarray, of_arm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions of frames alone, and the others, which together span what ``rows`` span."""
    moving = np.abs(rows[:, of_arm]).max(axis=1, initial=0.0) > 0.0
    alone, others = rows[~moving], rows[moving]
    if not len(others):
        return alone, others
    left, values, _ = np.linalg.svd(others[:, of_arm])
    count = int(np.sum(values > _RANK * values[0]))
    if count == len(others):
        return alone, others
    mixed = left.T @ others
    return np.concatenate([alone, mixed[count:]]), mixed[:count]


def _beside(rows: np.ndarray, exact: np.ndarray, among: np.ndarray) -> np.ndarray:
    """The directions in the span of ``rows`` that ``exact`` do not explain, by parts ``among``."""
    if not len(rows) or not len(exact):
        return rows
    _, values, right = np.linalg.svd(exact[:, among], full_matrices=False)
    basis = right[values > _RANK * values[0]]
    rows = rows / np.linalg.norm(rows[:, among], axis=1, keepdims=True)
    part = rows[:, among]
    left, values, _ = np.linalg.svd(part - part @ basis.T @ basis, full_matrices=False)
    rest = left[:, values > _OWN].T @ rows
    return rest - rest[:, among] @ np.linalg.pinv(exact[:, among], rcond=_RANK) @ exact


def _simple(rows: np.ndarray, among: np.ndarray) -> np.ndarray:
    """The same space by directions that share no pivot ``among`` (P,), to a largest part of 1."""
    if not len(rows):
        return rows
    import scipy

    left, upper, _ = scipy.linalg.qr(rows[:, among], mode="economic", pivoting=True)
    mixed = scipy.linalg.solve_triangular(upper[:, : len(rows)], left.T @ rows)
    return mixed / np.abs(mixed).max(axis=1, keepdims=True)


def _gathered(rows: np.ndarray, frames: np.ndarray) -> list[np.ndarray]:
    """Directions by what they share; one that moves a frame stays alone."""
    found: list[np.ndarray] = []
    for row in rows:
        moves = np.abs(row) >= LEAST
        shared = [
            number
            for number, group in enumerate(found)
            if not (moves | (np.abs(group) >= LEAST).any(axis=0))[frames].any()
            and (moves & (np.abs(group) >= LEAST).any(axis=0)).any()
        ]
        joined = np.concatenate([*(found[number] for number in shared), row[None]])
        found = [group for number, group in enumerate(found) if number not in shared]
        found.append(joined)
    return found

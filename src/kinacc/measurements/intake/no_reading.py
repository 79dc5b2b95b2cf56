"""Numbers that say that nothing was read: 9999, 9E9, or one number in all of x, y and z."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

import numpy as np

from kinacc.measurements.faults import BEYOND, is_no_coordinate, none_read
from kinacc.measurements.intake.choices import Choice

_FEWEST = 3  # readings beside, to say what is far from them
_FAR = 1.5  # times the extent of the others


@dataclass(frozen=True)
class NoReading:
    """Numbers that were found to say so, and what has to be asked first."""

    numbers: tuple[float, ...] = ()
    choice: Choice | None = None


def found(
    targets: Mapping[str, np.ndarray],
    joints: np.ndarray,
    rows_in_words: Callable[..., str],
    known: Collection[float] = (),
    ask: bool = True,
) -> NoReading:
    """What points by target, each (n, 3), hold in place of a reading; ``joints`` (n, k).

    ``known``: numbers that are known to say so; ``ask``: others may be asked about. A number
    counts where it is in all three coordinates and far from all other points, or in all three
    again and again at other joints. Where it may be a reading it is asked about.
    """
    taken: list[float] = list(known)
    for name, points in targets.items():
        numbers = _candidates(points)
        if not numbers:
            continue
        void = np.any([none_read(points, each) for each in numbers], axis=0)
        others = points[~void & np.isfinite(points).all(axis=1)]
        for number in numbers:
            if number in taken:
                continue
            rows = none_read(points, number)
            if _cannot_be(points[rows], others, joints[rows], number):
                taken.append(number)
            elif ask:
                words = rows_in_words(np.flatnonzero(rows))
                return NoReading(tuple(taken), _choice(name, number, words, known))
    return NoReading(tuple(sorted(taken)))


def _candidates(points: np.ndarray) -> list[float]:
    """Numbers of the points that may stand for nothing: alike in x, y and z, or nothing but 9."""
    alike = points[(points == points[:, :1]).all(axis=1), 0]
    every = points[np.isfinite(points)]
    large = np.unique(every[np.abs(every) >= 999.0])
    marks = [float(each) for each in large if is_no_coordinate(float(each))]
    return list(dict.fromkeys([*np.unique(alike).tolist(), *marks]))


def _cannot_be(points: np.ndarray, others: np.ndarray, joints: np.ndarray, number: float) -> bool:
    if abs(number) >= BEYOND:
        return True
    if not (points == number).all() or len(others) < _FEWEST:
        return False
    centre = np.median(others, axis=0)
    extent = float(np.max(np.linalg.norm(others - centre, axis=1)))
    away = float(np.linalg.norm(points[0] - centre))
    if away > _FAR * extent:
        return True
    # A point of the arm does not stay where it is while the joints move.
    moved = np.unique(np.round(joints, 6), axis=0) if joints.size else joints
    again = len(others) - len(np.unique(others, axis=0))
    return len(moved) >= 3 and 2 * again < len(others)


def _choice(target: str, number: float, rows: str, known: Collection[float]) -> Choice:
    before = "".join(f"{each:.10g}," for each in known)
    several = ", ".join([f"{number:g}"] * 3)
    told = f"{number:.10g} in some of x, y, z" if is_no_coordinate(number) else several
    return Choice(
        "--no-reading",
        f"the point of {target} is {told} in {rows}",
        {
            f"{before}{number:.10g}": "nothing was read there",
            f"{before}none": "it was read so",
        },
    )

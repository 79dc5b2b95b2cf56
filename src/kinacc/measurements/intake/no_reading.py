"""Numbers that say that nothing was read: 9999, 9E9, or one number in all of x, y and z."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

import numpy as np

from kinacc.measurements.faults import BEYOND, is_no_coordinate, none_read
from kinacc.measurements.intake.choices import Choice

_FEWEST = 3  # readings beside, to say what is far from them
_FAR = 1.5  # times the extent of the others


def found(
    targets: Mapping[str, np.ndarray],
    joints: np.ndarray,
    rows_in_words: Callable[..., str],
    known: Collection[float] = (),
    ask: bool = True,
) -> list[float] | Choice:
    """What points by target, each (n, 3), hold in place of a reading; ``joints`` (n, k).

    ``known``: numbers that are known to say so; ``ask``: others may be asked about. A number
    counts where it is in all three coordinates and far from all other points, or in all three
    again and again at other joints. Where it may be a reading it is asked about.
    """
    taken = list(known)
    for name, points in targets.items():
        # Alike in x, y and z, or nothing but 9.
        alike = points[(points == points[:, :1]).all(axis=1), 0]
        large = np.unique(points[np.abs(points) >= 999.0])
        numbers = {*alike.tolist(), *filter(is_no_coordinate, large.tolist())}
        void = np.any([none_read(points, each) for each in numbers], axis=0)
        others = points[~void & np.isfinite(points).all(axis=1)]
        for number in sorted(numbers - {*taken}):
            rows = none_read(points, number)
            if _cannot_be(points[rows], others, joints[rows], number):
                taken.append(number)
            elif ask:
                before = "".join(f"{each:.10g}," for each in known)
                meant = {f"{before}{number:.10g}": "nothing was read there",
                         f"{before}none": "it was read so"}  # fmt: skip
                where = rows_in_words(np.flatnonzero(rows))
                about = f"the point of {name} is {number:.10g} in x, y or z of {where}"
                return Choice("--no-reading", about, meant)
    return sorted(taken)


def _cannot_be(points: np.ndarray, others: np.ndarray, joints: np.ndarray, number: float) -> bool:
    if abs(number) >= BEYOND:
        return True
    if not (points == number).all() or len(others) < _FEWEST:
        return False
    centre = np.median(others, axis=0)
    extent = np.max(np.linalg.norm(others - centre, axis=1))
    if np.linalg.norm(points[0] - centre) > _FAR * extent:
        return True
    # A point of the arm does not stay where it is while the joints move.
    moved = np.unique(np.round(joints, 6), axis=0)
    again = len(others) - len(np.unique(others, axis=0))
    return len(moved) >= 3 and 2 * again < len(others)

"""Limits on every point's size that hold however often and whenever somebody looks.

A point is looked at when it has 1, 2, 4, 8, ... readings. Look number l may err with probability
``SHARES[l]`` of the error allowed to a point, so all its limits hold together whatever decided
when to measure it again, to look or to stop. The upper limits of different points need no
correction for their number: the largest of them is at least the limit of the one point that is
truly largest.
"""

from __future__ import annotations

import math

import numpy as np

from kinacc.assess.adaptive import Ledger, LedgerCampaign
from kinacc.assess.limits import lower_limit_mm, upper_limit_mm

_FIRST_SHARES = (0.60, 0.16, 0.10, 0.06)  # of the looks at 1, 2, 4 and 8 readings; then halving


def share(look: int) -> float:
    """Part of a point's allowed error that a look (0 = first) may spend; all together 1."""
    if look < len(_FIRST_SHARES):
        return _FIRST_SHARES[look]
    return 0.5 ** (look - len(_FIRST_SHARES) + 1) * (1.0 - sum(_FIRST_SHARES))


class Looks:
    """Running limits of all points of a ledger, for one or more allowed errors of a point.

    upper_mm: (errors, m), infinite before the first look; lower_mm: (m,), for ``lower_error``.
    """

    def __init__(self, ledger: Ledger, errors: tuple[float, ...], lower_error: float) -> None:
        points = ledger.candidates.points
        self.ledger = ledger
        self.errors = errors
        self.lower_error = lower_error
        self.upper_mm = np.full((len(errors), points), math.inf)
        self.lower_mm = np.zeros(points)
        self._done = np.zeros(points, dtype=np.int64)

    def update(self, point: int) -> None:
        """Look at a point if its number of readings asks for it."""
        count = int(self.ledger.count[point])
        if count != self.due(point):
            return
        spent = share(int(self._done[point]))
        mean, noise = self.ledger.mean_mm[point], self.ledger.noise(point)
        for row, error in enumerate(self.errors):
            limit = upper_limit_mm(mean, noise, error * spent)
            self.upper_mm[row, point] = min(self.upper_mm[row, point], limit)
        limit = lower_limit_mm(mean, noise, self.lower_error * spent)
        self.lower_mm[point] = max(self.lower_mm[point], limit)
        self._done[point] += 1

    def due(self, point: int) -> int:
        """Number of readings at which the point is looked at next."""
        return 1 << int(self._done[point])

    def missing(self, point: int) -> int:
        """Readings missing until the next look."""
        return self.due(point) - int(self.ledger.count[point])

    def bounding_point(self, left: int) -> int:
        """The visited point with the largest upper limit among those whose next look is affordable.

        With ``left`` readings to go. Where no look is affordable the largest limit decides alone:
        its readings still serve the value.
        """
        visited = np.array(self.ledger.visited)
        order = visited[np.argsort(-self.upper_mm[0, visited], kind="stable")]
        return int(next((point for point in order if self.missing(point) <= left), order[0]))


class LooksCampaign(LedgerCampaign):
    """A campaign that looks at every point as it is read: ``looks`` is the assessor's to set."""

    looks: Looks

    def record(self, point: int, reading_mm, covariance_mm2=None) -> None:
        """Take a reading, and look at the point where that is due."""
        super().record(point, reading_mm, covariance_mm2)
        self.looks.update(point)

    def point_limits(self) -> dict[int, tuple[float, float]]:
        """The limits that hold at every look."""
        lower, upper = self.looks.lower_mm, self.looks.upper_mm[0]
        return {row: (float(lower[row]), float(upper[row])) for row in self.ledger.visited}

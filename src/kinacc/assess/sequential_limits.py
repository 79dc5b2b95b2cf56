"""Limits on every point's size that hold however often and whenever somebody looks.

A point is looked at when it has as many readings as one of the counts fixed beforehand. Its upper
limits at all looks together miss with the probability its boundary was made for
(:mod:`kinacc.assess.boundary`), whatever decided when to measure it again or to stop, for the
decision knows only what was read before. The upper limits of different points need no correction
for their number: the largest of them is at least the limit of the one point that is truly largest.
Lower limits share their error out over points and looks.
"""

from __future__ import annotations

import math

import numpy as np

from kinacc.assess.adaptive import Ledger
from kinacc.assess.boundary import Boundary
from kinacc.assess.limits import lower_limit_mm


class Looks:
    """Limits of all points of a ledger, mm; upper ones are kept as points are looked at.

    ``upper`` says at which counts points are looked at and how wide the upper limits are;
    ``lower_error`` is what the lower limits of one point may miss by, ``shares`` (L,) its parts by
    look. ``factor`` is how much larger than planned the noise is taken where points are chosen.
    upper_mm: (m,), infinite before the first look.
    """

    def __init__(
        self, ledger: Ledger, upper: Boundary, lower_error: float, shares: np.ndarray, factor: float
    ) -> None:
        points, looks = ledger.candidates.points, len(upper.counts)
        self.ledger, self.boundary, self.factor = ledger, upper, factor
        self.lower_error, self.shares = lower_error, shares
        self.upper_mm = np.full(points, math.inf)
        self._counts = [*upper.counts.tolist(), math.inf]
        self._done = [0] * points
        self._size_mm = np.full((points, looks), np.nan)  # of the mean at every look
        self._noise_mm = np.full((points, looks), np.nan)  # its standard deviation where even
        self._even = np.ones((points, looks), dtype=bool)  # all readings so far as planned
        self._unequal: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = {}

    def update(self, point: int) -> None:
        """Look at a point if its number of readings asks for it."""
        count, look = self.ledger.count.item(point), self._done[point]
        if count != self._counts[look]:
            return
        self._done[point] += 1
        mean, noise = self.ledger.mean_mm[point], self.ledger.noise(point)
        if not self.ledger.as_planned(point):
            self._even[point, look] = False
        x, y, z = mean.tolist()
        self._size_mm[point, look] = math.sqrt(x * x + y * y + z * z)
        if isinstance(noise, float):
            self._noise_mm[point, look] = noise
        else:
            self._unequal[point, look] = mean.copy(), noise
        limit = self._limit(point, look, self.boundary, self.factor)
        if limit < self.upper_mm[point]:
            self.upper_mm[point] = limit

    def due(self, point: int) -> float:
        """Number of readings at which the point is looked at next; infinite after the last."""
        return self._counts[self._done[point]]

    def done(self, point: int) -> int:
        """How often the point was looked at."""
        return self._done[point]

    def missing(self, point: int) -> float:
        """Readings missing until the next look."""
        return self.due(point) - self.ledger.count.item(point)

    def limits_mm(self, boundary: Boundary, factor: np.ndarray) -> np.ndarray:
        """Upper limits (m,) of another boundary at the same counts, noise (m,) times as planned.

        Infinite where a point was not looked at.
        """
        if boundary is self.boundary and (factor == self.factor).all():
            return self.upper_mm
        return self._limits_of(boundary, factor)

    def _limits_of(self, boundary: Boundary, factor: np.ndarray) -> np.ndarray:
        width = np.where(self._even, boundary.z, boundary.alone) * factor[:, None]
        at_looks = self._size_mm + width * self._noise_mm
        found = np.where(np.isnan(at_looks), math.inf, at_looks).min(axis=1)
        for point, look in self._unequal:
            found[point] = min(found[point], self._limit(point, look, boundary, factor.item(point)))
        return found

    def largest_lower_mm(self, factor: np.ndarray) -> float:
        """The largest lower limit of any point at any look, noise (m,) times as planned."""
        from scipy.special import ndtri

        # No limit exceeds the size less as many standard deviations as a single axis would take.
        noise = np.nan_to_num(self._noise_mm) * factor[:, None]
        highest = self._size_mm + ndtri(self.lower_error * self.shares) * noise
        best = 0.0
        for place in np.argsort(-np.nan_to_num(highest, nan=-math.inf), axis=None).tolist():
            point, look = divmod(place, highest.shape[1])
            if not highest.item(place) > best:
                break
            best = max(best, self._below(point, look, factor.item(point)))
        return best

    def lower_limits_mm(self, factor: np.ndarray) -> np.ndarray:
        """Lower limits (m,), noise (m,) times as planned; 0 where a point was not looked at."""
        found = np.zeros(len(self._done))
        for point, done in enumerate(self._done):
            looks = (self._below(point, look, factor.item(point)) for look in range(done))
            found[point] = max(looks, default=0.0)
        return found

    def _below(self, point: int, look: int, factor: float) -> float:
        error = self.lower_error * self.shares.item(look)
        if (point, look) in self._unequal:
            mean, spread = self._unequal[point, look]
            return lower_limit_mm(mean, factor**2 * spread, error)
        mean = np.array([self._size_mm.item(point, look), 0.0, 0.0])
        return lower_limit_mm(mean, factor * self._noise_mm.item(point, look), error)

    def _limit(self, point: int, look: int, boundary: Boundary, factor: float) -> float:
        width = boundary.z if self._even[point, look] else boundary.alone
        deviations = factor * width.item(look)
        if (point, look) in self._unequal:
            from kinacc.assess.ellipsoid import largest_size

            return largest_size(*self._unequal[point, look], deviations)
        return self._size_mm.item(point, look) + deviations * self._noise_mm.item(point, look)

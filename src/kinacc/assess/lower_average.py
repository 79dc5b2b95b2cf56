"""A lower bound on the largest error: the average of readings along directions seen before.

Each reading that counts is projected on the direction of its point's earlier mean, and weighed by
its own standard deviation along it. Direction, weight and whether it counts are settled before it
is read, so the sum of the noise in ``T`` such readings is exactly normal with variance T, however
points were chosen; and along any direction a true error is at most its size, so at most the
largest. No share is paid for the number of points.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from kinacc.assess.boundary import boundary

SHARE = 0.6  # of the readings after the visit that count
_STAGES = (0.125, 0.25, 0.5, 1.0)  # of these readings, after which a bound may be stated
LATE = 3.0  # with this power of their share the error is spent: most of it in the end


class LowerAverage:
    """Readings that count, up to ``wanted``, and the bounds of its stages.

    Of every one that counted, in order: its point, what it read along its direction (mm), and the
    standard deviation of that (mm).
    """

    def __init__(self, wanted: int, error: float, freedom: float = math.inf) -> None:
        self.wanted = wanted
        self._z = self._boundary(error, freedom) if wanted else ()
        self._counts = stages(wanted) if wanted else ()
        self._rows: list[int] = []
        self._along_mm: list[float] = []
        self._noise_mm: list[float] = []

    def record(
        self,
        row: int,
        direction: list[float],
        reading_mm: list[float],
        noise_mm: float,
    ) -> None:
        """Take a reading (3,) at a row, of deviation ``noise_mm`` along ``direction`` (3,)."""
        (u, v, w), (x, y, z) = direction, reading_mm
        self._rows.append(row)
        self._along_mm.append(u * x + v * y + w * z)
        self._noise_mm.append(noise_mm)

    @property
    def taken(self) -> int:
        """Readings that counted."""
        return len(self._rows)

    @property
    def at_stage(self) -> bool:
        """Whether the readings that counted are those of a stage."""
        return self.taken in self._counts

    @property
    def has_spoken(self) -> bool:
        """Whether a stage was reached: from then on the lower bound is by the average alone.

        Never the larger of it and of single points: the farthest of many single readings is what a
        heavy tail brings.
        """
        return bool(self._counts) and self.taken >= self._counts[0]

    @property
    def missing(self) -> int:
        """Readings that have still to count."""
        return self.wanted - self.taken

    def bound_mm(self, factor: np.ndarray) -> float:
        """The largest bound of the stages reached, 0 before; noise (m,) times as planned."""
        if not self.has_spoken:
            return 0.0
        weight = 1.0 / np.array(self._noise_mm)
        found = np.cumsum(np.array(self._along_mm) * weight)
        variance, total = np.cumsum(factor[self._rows] ** 2), np.cumsum(weight)
        return max(
            float((found[at] - z * math.sqrt(variance[at])) / total[at])
            for at, z in self._reached()
        )

    def _boundary(self, error: float, freedom: float) -> tuple[float, ...]:
        """Standard deviations of the sum that each stage takes off."""
        return tuple(boundary(stages(self.wanted), error, freedom, 0.0, LATE).z.tolist())

    def _reached(self) -> Iterator[tuple[int, float]]:
        """The last reading, from 0, of every stage reached, and its standard deviations."""
        stages_and_z = zip(self._counts, self._z, strict=True)
        return ((count - 1, z) for count, z in stages_and_z if count <= self.taken)


def stages(wanted: int) -> tuple[int, ...]:
    """Numbers of readings that count after which a bound is stated."""
    return tuple(sorted({max(math.ceil(share * wanted), 1) for share in _STAGES}))


def direction_of(mean_mm: list[float]) -> list[float]:
    """The unit vector (3,) along a mean; the first axis where it is zero."""
    length = math.sqrt(sum(each * each for each in mean_mm))
    return [each / length for each in mean_mm] if length > 0.0 else [1.0, 0.0, 0.0]

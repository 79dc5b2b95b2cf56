"""A lower bound on the largest error: the average of readings along directions seen before.

Each reading that counts is projected on the direction of its point's earlier mean, and weighed by
its own standard deviation along it. Direction, weight and whether it counts are settled before it
is read, so the sum of the noise in ``T`` such readings is exactly normal with variance T, however
points were chosen; and along any direction a true error is at most its size, so at most the
largest. No share is paid for the number of points. Where readings may be wrong, each counts by its
clipped score (:mod:`kinacc.assess.wrong_readings`).
"""

from __future__ import annotations

import math

import numpy as np

from kinacc.assess.looks import boundary
from kinacc.assess.wrong_readings import guarded_lower_mm

SHARE = 0.6  # of the readings after the visit that count
_STAGES = (0.125, 0.25, 0.5, 1.0)  # of these readings, after which a bound may be stated
_LATE = 3.0  # with this power of their share the error is spent: most of it in the end


class LowerAverage:
    """Readings that count, up to ``wanted``, and the bounds of its stages.

    Of every one that counted, in order: its point, what it read along its direction (mm), and the
    standard deviation of that (mm). ``rate``: share of readings that may be wrong.
    """

    def __init__(
        self, wanted: int, error: float, freedom: float = math.inf, rate: float = 0.0
    ) -> None:
        self.wanted, self._rate = wanted, rate
        self._stages: dict[int, float] = {}  # readings that count, and deviations taken off
        if wanted:
            counts = tuple(sorted({max(math.ceil(share * wanted), 1) for share in _STAGES}))
            z = boundary(counts, error, freedom, 0.0, _LATE, rate).z.tolist()
            self._stages = dict(zip(counts, z, strict=True))
        self._rows: list[int] = []
        self._along_mm: list[float] = []
        self._noise_mm: list[float] = []

    def record(
        self, row: int, direction: list[float], reading_mm: list[float], noise_mm: float
    ) -> None:
        """Take a reading (3,) at a row, of deviation ``noise_mm`` along ``direction`` (3,)."""
        (u, v, w), (x, y, z) = direction, reading_mm
        self._rows.append(row)
        self._along_mm.append(u * x + v * y + w * z)
        self._noise_mm.append(noise_mm)

    @property
    def at_stage(self) -> bool:
        """Whether the readings that counted are those of a stage."""
        return len(self._rows) in self._stages

    @property
    def has_spoken(self) -> bool:
        """Whether a stage was reached: from then on the lower bound is by the average alone.

        Never the larger of it and of single points: the farthest of many single readings is what a
        heavy tail brings.
        """
        return bool(self._stages) and len(self._rows) >= min(self._stages)

    @property
    def missing(self) -> int:
        """Readings that have still to count."""
        return self.wanted - len(self._rows)

    def bound_mm(self, factor: np.ndarray) -> float:
        """The largest bound of the stages reached, 0 before; noise (m,) times as planned."""
        along, noise = np.array(self._along_mm), np.array(self._noise_mm)
        own, bounds = factor[self._rows], [0.0] if self._rate else []
        for count, z in self._stages.items():
            if count > len(along):
                break
            if self._rate:
                stated = own[:count] * noise[:count]
                bounds.append(guarded_lower_mm(along[:count], stated, z, self._rate))
                continue
            weight = 1.0 / noise[:count]
            off = z * math.sqrt(float(np.sum(own[:count] ** 2)))
            bounds.append((float(along[:count] @ weight) - off) / float(weight.sum()))
        return max(bounds, default=0.0)


def direction_of(mean_mm: list[float]) -> list[float]:
    """The unit vector (3,) along a mean; the first axis where it is zero."""
    length = math.sqrt(sum(each * each for each in mean_mm))
    return [each / length for each in mean_mm] if length > 0.0 else [1.0, 0.0, 0.0]

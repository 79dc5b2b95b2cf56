"""Error fields for judging, fixed before any assessor met them.

Made up: sizes drawn from what bounds find hard, directions at random, no arm. And families of
synthetic arms beside those that ``kinacc campaign plan`` knows.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from kinacc.study.fields import FAMILIES, POINTS, ErrorField, Family, only
from kinacc.synthetic.physical import PhysicalRobot

_SEED = 1707
_RARE_SHARE, _RARE_MM = 0.01, (1.2, 1.9)


@dataclass(frozen=True)
class MadeUp:
    """Sizes (n,) in mm from a generator; the first ``kept`` are candidates in every campaign."""

    meaning: str
    sizes_mm: Callable[[np.random.Generator, int], np.ndarray]
    kept: int = 0


def _ordinary(rng: np.random.Generator, count: int) -> np.ndarray:
    return rng.uniform(0.1, 0.7, count)


def _above(special_mm: list[float]) -> Callable[[np.random.Generator, int], np.ndarray]:
    """The sizes given, then ordinary ones."""

    def sizes_mm(rng: np.random.Generator, count: int) -> np.ndarray:
        return np.append(special_mm, _ordinary(rng, count - len(special_mm)))

    return sizes_mm


def _clustered(rng: np.random.Generator, count: int) -> np.ndarray:
    """One pose in twenty near the largest, in a worn region."""
    high = rng.random(count) < 0.05
    return np.where(high, rng.uniform(0.85, 1.0, count), _ordinary(rng, count))


MADE_UP: dict[str, MadeUp] = {
    "lone": MadeUp("one pose of 1.5 mm, all others 0.1 to 0.7 mm", _above([1.5]), 1),
    "tied2": MadeUp("two poses of 1 mm, all others 0.1 to 0.7 mm", _above([1.0] * 2), 2),
    "tied20": MadeUp("twenty poses of 1 mm, all others 0.1 to 0.7 mm", _above([1.0] * 20), 20),
    "heavy": MadeUp(
        "heavy-tailed: Pareto of index 3, from 0.2 mm up",
        lambda rng, count: 0.2 * (1.0 + rng.pareto(3.0, count)),
    ),
    "cluster": MadeUp("one pose in twenty from 0.85 to 1 mm, all others 0.1 to 0.7 mm", _clustered),
    "flat": MadeUp("all of 0.5 mm", lambda rng, count: np.full(count, 0.5)),
    "even": MadeUp("evenly from 0 to 1 mm", lambda rng, count: rng.uniform(0.0, 1.0, count)),
    "maxwell": MadeUp(
        "normal in each axis, 0.3 mm",
        lambda rng, count: 0.3 * np.linalg.norm(rng.normal(size=(count, 3)), axis=1),
    ),
    "none": MadeUp("hardly any error: all of 0.01 mm", lambda rng, count: np.full(count, 0.01)),
}


def made_up(name: str) -> ErrorField:
    """The field of that name, one of :data:`MADE_UP`: always the same."""
    what = MADE_UP[name]
    rng = np.random.default_rng([_SEED, zlib.crc32(name.encode())])
    size = what.sizes_mm(rng, POINTS)
    turn = rng.normal(size=(POINTS, 3))
    error_mm = size[:, None] * turn / np.linalg.norm(turn, axis=1)[:, None]
    return ErrorField(name, error_mm)


def _small(arm: PhysicalRobot) -> PhysicalRobot:
    return replace(only()(arm), smooth=replace(arm.smooth, amplitude=0.35 * arm.smooth.amplitude))


def _with_rare(
    error_mm: np.ndarray, q_rad: np.ndarray, arm: PhysicalRobot, rng: np.random.Generator
) -> np.ndarray:
    """Single poses far off, for no reason a model could know."""
    size = np.where(rng.random(len(q_rad)) < _RARE_SHARE, rng.uniform(*_RARE_MM, len(q_rad)), 0.0)
    turn = rng.normal(size=(len(q_rad), 3))
    return error_mm + size[:, None] * turn / np.linalg.norm(turn, axis=1)[:, None]


ARMS = {
    **FAMILIES,
    "gravity": Family(only(compliance=4.0)),
    "ripple": Family(only(ripple_rad=1.0)),
    "thermal": Family(only(drift=3.0)),
    "rare": Family(_small, _with_rare),
}

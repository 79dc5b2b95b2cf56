"""How readings of a simulated campaign come about: as stated, or as in a real workshop.

A reading is a function of its world's key, its row, how often the row was read before, and its
place in the sequence of the campaign: whatever else is read has no part in it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kinacc.assess.world import World

STATED = "stated"
_HEAVY = 4  # degrees of freedom of Student's t
_WRONG_SHARE, _WRONG = 0.01, 10.0  # of the readings; how far off, in standard deviations
_MOVED = 3.0  # standard deviations that a drift comes to, or that a step is
_POSES = 1.5  # largest noise of a pose over the smallest
_TESTED = 60  # degrees of freedom of a repeatability test before

_READING, _POSE, _CAMPAIGN = 1, 2, 3  # what a stream of further random numbers belongs to


@dataclass(frozen=True)
class Sequence:
    """What a condition may know of a campaign: its world, and how many readings are planned."""

    world: World
    planned: int

    def chance(self, kind: int, row: int = 0, visit: int = 0) -> np.random.Generator:
        """Further random numbers of a reading, of a pose or of the campaign, until asked again."""
        generator, begun = self._stream
        begun["state"]["counter"][1:] = row, visit, kind
        generator.bit_generator.state = begun
        return generator

    @cached_property
    def far_mm(self) -> np.ndarray:
        """How far a drift of the frame comes, or a step: (3,), mm."""
        sigma = float(np.sqrt(np.mean(self.world.sigma_mm**2)))
        return _MOVED * sigma * _direction(self.chance(_CAMPAIGN))

    @cached_property
    def _stream(self) -> tuple[np.random.Generator, dict]:
        """One generator, put to the place of what is asked for: a new one takes far longer."""
        stream = np.random.Philox(key=self.world.key)
        return np.random.Generator(stream), dict(stream.state)


@dataclass(frozen=True)
class Condition:
    """What differs from normal readings of the noise stated.

    ``factor``: of the noise on that of the world. ``noise(sequence, row, visit, deviation)``: noise
    (3,) of a reading from a normal one. ``moved(sequence, number)``: how far the frame has moved,
    (3,), mm, at reading ``number`` (0 = first). ``stated(sequence)``: noise stated over that of the
    world.
    """

    meaning: str
    factor: float = 1.0
    noise: Callable[[Sequence, int, int, np.ndarray], np.ndarray] = (
        lambda sequence, row, visit, deviation: deviation
    )
    moved: Callable[[Sequence, int], np.ndarray | float] = lambda sequence, number: 0.0
    stated: Callable[[Sequence], float] = lambda sequence: 1.0


class Course:
    """Readings of one campaign in the order in which they are taken."""

    def __init__(self, condition: Condition, world: World, planned: int) -> None:
        self.condition, self.sequence = condition, Sequence(world, planned)
        self.taken = 0

    def reading_mm(self, row: int, visit: int) -> np.ndarray:
        """The next reading (3,), mm: number ``visit`` (0 = first) at a row."""
        number, self.taken = self.taken, self.taken + 1
        world = self.sequence.world
        error = world.error_mm[row]
        deviation = self.condition.factor * (world.reading_mm(row, visit) - error)
        noise = self.condition.noise(self.sequence, row, visit, deviation)
        return error + noise + self.condition.moved(self.sequence, number)

    def stated_mm(self) -> np.ndarray:
        """The noise (m,) that an assessor is told."""
        return self.sequence.world.sigma_mm * self.condition.stated(self.sequence)


def _direction(rng: np.random.Generator) -> np.ndarray:
    turn = rng.normal(size=3)
    return turn / np.linalg.norm(turn)


def _student(sequence: Sequence, row: int, visit: int, deviation: np.ndarray) -> np.ndarray:
    """Each axis by itself, variance as stated."""
    square = sequence.chance(_READING, row, visit).chisquare(_HEAVY, 3)
    return deviation * np.sqrt((_HEAVY - 2.0) / square)


def _student_whole(sequence: Sequence, row: int, visit: int, deviation: np.ndarray) -> np.ndarray:
    """All axes of a reading alike, variance as stated."""
    square = sequence.chance(_READING, row, visit).chisquare(_HEAVY)
    return deviation * math.sqrt((_HEAVY - 2.0) / square)


def _wrong(sequence: Sequence, row: int, visit: int, deviation: np.ndarray) -> np.ndarray:
    rng = sequence.chance(_READING, row, visit)
    if rng.random() >= _WRONG_SHARE:
        return deviation
    return deviation + _WRONG * sequence.world.sigma_mm[row] * _direction(rng)


def _by_pose(sequence: Sequence, row: int, visit: int, deviation: np.ndarray) -> np.ndarray:
    """Factors evenly from a to 1.5 a, a such that the mean square is as stated."""
    least = math.sqrt(3.0 / (1.0 + _POSES + _POSES**2))
    return deviation * sequence.chance(_POSE, row).uniform(least, _POSES * least)


def _drift(sequence: Sequence, number: int) -> np.ndarray:
    return sequence.far_mm * (number / max(sequence.planned - 1, 1))


def _step(sequence: Sequence, number: int) -> np.ndarray:
    return sequence.far_mm * float(2 * number >= sequence.planned)


def _tested(sequence: Sequence) -> float:
    return math.sqrt(sequence.chance(_CAMPAIGN).chisquare(_TESTED) / _TESTED)


CONDITIONS: dict[str, Condition] = {
    STATED: Condition("normal readings of the noise stated"),
    "noise_1.2": Condition("noise 1.2 times as large as stated", factor=1.2),
    "student_t4": Condition("Student's t with 4 degrees of freedom in each axis", noise=_student),
    "student_t4_whole": Condition("the same, all axes of a reading alike", noise=_student_whole),
    "wrong_1pct": Condition("1 % of readings 10 sigma off, in random directions", noise=_wrong),
    "drift_3": Condition("a linear drift of 3 sigma over the campaign", moved=_drift),
    "step_3": Condition("a step of 3 sigma in the middle", moved=_step),
    "repeatability": Condition(
        "noise that differs from pose to pose up to 1.5 times", noise=_by_pose
    ),
    "tested_60": Condition(
        "noise stated by a test before with 60 degrees of freedom", stated=_tested
    ),
}

"""Which runs are made: every choice alone, every arm, and samples over all at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from kinacc.synthetic.accepted import further_draws
from research.dotted import with_values
from research.open_choices import (
    ALL,
    ALL_AND_ARM,
    ARM,
    DEFAULT,
    FIG_5,
    STATED,
    Choice,
    named,
)

_DRAW = "measurements.synthetic.draw"
# Runs that follow single simulations only take a twentieth of the time of the others.
_FIG_5_RUNS = 3


@dataclass(frozen=True)
class Run:
    """One configuration of the study.

    ``varied`` is what differs from the configuration as it is: nothing (``default``), a choice,
    the arm, or several at once (SAMPLES). ``value`` is the value of a single choice. ``chosen`` are
    the words of the choices that are set, ``values`` the values of the configuration's keys.
    """

    number: int
    varied: str
    value: str | None = None
    chosen: Mapping[str, str] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)

    def configured(self, config: Mapping[str, Any]) -> dict[str, Any]:
        """The complete configuration of the run."""
        return with_values(config, self.values)


def runs(config: Mapping[str, Any]) -> list[Run]:
    """Every run for the configuration of a data set, numbered from 0.

    ``config["choices"]``: ``names`` of the choices (all if empty) and ``runs`` of a sample. The
    samples are scrambled Sobol points by the seed: ``all`` on the arm as configured,
    ``all_and_arm`` the same points on arms drawn beside, ``fig5`` over arm, alpha, noise and seed.
    Raises InputError where fewer arms were accepted than ``robustness.draws``.
    """
    choices, count = named(config["choices"]["names"]), int(config["choices"]["runs"])
    arm = _arm(config)
    made = [(DEFAULT, None, {}, {})]
    for choice in (*choices, arm):
        made += _alone(choice, config)
    seed = int(config["seed"])
    points = _points(count, len(choices) + 1, seed)
    made += [(ALL, None, *_drawn(choices, point)) for point in points[:, 1:]]
    made += [(ALL_AND_ARM, None, *_drawn((arm, *choices), point)) for point in points]
    followed = (arm, *STATED)
    points = _points(_FIG_5_RUNS * count, len(followed), seed)
    made += [(FIG_5, None, *_drawn(followed, point)) for point in points]
    return [Run(number, *each) for number, each in enumerate(made)]


def _arm(config: Mapping[str, Any]) -> Choice:
    own = int(config["measurements"]["synthetic"]["draw"])
    draws = [own, *further_draws(own, int(config["robustness"]["draws"]))]
    about = "which of the arms drawn at random that meet the paper's tables"
    return Choice(ARM, about, (_DRAW,), {str(draw): (draw,) for draw in draws})


def _alone(choice: Choice, config: Mapping[str, Any]) -> Iterator[tuple[str, str, dict, dict]]:
    """Every value but the configured one."""
    configured = choice.word(config)
    for word, values in choice.values.items():
        if word != configured:
            keyed = dict(zip(choice.keys, values, strict=True))
            yield choice.name, word, {choice.name: word}, keyed


def _drawn(choices: Sequence[Choice], point: np.ndarray) -> tuple[dict[str, str], dict[str, Any]]:
    """What a point (choices,) of the unit cube chooses."""
    chosen, values = {}, {}
    for choice, share in zip(choices, point, strict=True):
        words = list(choice.values)
        word = words[int(share * len(words))]
        chosen[choice.name] = word
        values |= dict(zip(choice.keys, choice.values[word], strict=True))
    return chosen, values


def _points(count: int, dimensions: int, seed: int) -> np.ndarray:
    """Scrambled Sobol points (count, dimensions), the first of a power of two."""
    from scipy.stats import qmc

    power = max(count - 1, 1).bit_length()
    return qmc.Sobol(dimensions, rng=np.random.default_rng(seed)).random_base2(power)[:count]

"""The readings of one simulation of the study, from its address alone and numpy's generators.

Reading v (from 1) at operating point j of the simulation (seed, noise, repetition): three normal
deviates from the four words of Philox 4x64 at counter (v - 1, j, 0, 0), keyed by
SeedSequence([seed, noise in nm, repetition]); Box and Muller pairs words (1, 2) and (3, 4), of
which the first pair gives x and y, the second z.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np


def philox_words(key: Sequence[int], visit: int, point: int) -> list[int]:
    """numpy counts up before it generates, so it is set one below."""
    counter = (visit + (point << 64) - 1) % 2**256
    limbs = np.array([(counter >> (64 * i)) & (2**64 - 1) for i in range(4)], np.uint64)
    generator = np.random.Philox(key=np.array(key, np.uint64), counter=limbs)
    return [int(x) for x in generator.random_raw(4)]


def deviates(key: Sequence[int], visit: int, point: int) -> tuple[float, float, float]:
    a, b, c, d = (word >> 11 for word in philox_words(key, visit, point))
    first = math.sqrt(-2 * math.log((a + 1) / 2**53))
    second = math.sqrt(-2 * math.log((c + 1) / 2**53))
    turn, other = 2 * math.pi * b / 2**53, 2 * math.pi * d / 2**53
    return first * math.cos(turn), first * math.sin(turn), second * math.cos(other)


def simulation(
    error_mm: Sequence[Sequence[float]], noise_mm: float, repetition: int, seed: int
) -> Callable[[int, int], list[float]]:
    """Reading function of the world: true error plus noise (eq. 9)."""
    entropy = [seed, round(noise_mm * 1e6), repetition]
    key = [int(x) for x in np.random.SeedSequence(entropy).generate_state(2, np.uint64)]
    known: dict[tuple[int, int], list[float]] = {}

    def reading(j: int, v: int) -> list[float]:
        if (j, v) not in known:
            noise = deviates(key, v - 1, int(j))
            known[j, v] = [e + noise_mm * z for e, z in zip(error_mm[j], noise, strict=True)]
        return known[j, v]

    return reading

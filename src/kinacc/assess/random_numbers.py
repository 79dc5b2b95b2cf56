"""Normal deviates by address: reading v at point j of a simulation is a function of its key alone.

A counter-based generator (Philox 4x64, 10 rounds, as in numpy) is asked at counter (v, j, 0, 0).
No reading depends on which others were taken, on their order, or on how many points there are, so
a simulation is one fixed world and only the readings somebody takes are ever computed.
"""

from __future__ import annotations

import numpy as np

from kinacc.assess.invalidation_kernels import extend, extend_all, normals, philox

__all__ = ["extend", "extend_all", "key_of", "normals", "philox"]


def key_of(*entropy: int) -> np.ndarray:
    """Key (2,) uint64 of the simulation named by non-negative integers (seed first)."""
    return np.random.SeedSequence(list(entropy)).generate_state(2, np.uint64)

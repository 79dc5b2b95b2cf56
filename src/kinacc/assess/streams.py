"""Normal deviates by address: reading v at point j of a simulation is a function of its key alone.

A counter-based generator (Philox 4x64, 10 rounds, as in numpy) is asked at counter (v, j, 0, 0).
No reading depends on which others were taken, on their order, or on how many points there are, so
a simulation is one fixed world and only the readings somebody takes are ever computed.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

_M0 = np.uint64(0xD2E7470EE14C6C93)
_M1 = np.uint64(0xCA5A826395121157)
_W0 = np.uint64(0x9E3779B97F4A7C15)
_W1 = np.uint64(0xBB67AE8584CAA73B)
_LOW = np.uint64(0xFFFFFFFF)
_HALF = np.uint64(32)
_SHIFT = np.uint64(11)
_ZERO = np.uint64(0)
_ONE = np.uint64(1)


@njit(cache=True)
def _high_product(a, b):
    """Upper 64 bits of the 128-bit product of two uint64."""
    a_low, a_high = a & _LOW, a >> _HALF
    b_low, b_high = b & _LOW, b >> _HALF
    middle = a_high * b_low + ((a_low * b_low) >> _HALF)
    other = a_low * b_high + (middle & _LOW)
    return a_high * b_high + (middle >> _HALF) + (other >> _HALF)


@njit(cache=True)
def philox(key0, key1, counter0, counter1):
    """Four uint64 words of Philox 4x64-10 at counter (counter0, counter1, 0, 0)."""
    c0, c1, c2, c3 = counter0, counter1, _ZERO, _ZERO
    for step in range(10):
        if step > 0:
            key0 += _W0
            key1 += _W1
        high0, high1 = _high_product(_M0, c0), _high_product(_M1, c2)
        c0, c1, c2, c3 = high1 ^ c1 ^ key0, _M1 * c2, high0 ^ c3 ^ key1, _M0 * c0
    return c0, c1, c2, c3


@njit(cache=True)
def normals(key0, key1, point, visit):
    """Three standard normal deviates of one reading, by Box and Muller."""
    x0, x1, x2, x3 = philox(key0, key1, np.uint64(visit), np.uint64(point))
    unit = 2.0**-53
    # In (0, 1], so that the logarithm is finite.
    r0 = math.sqrt(-2.0 * math.log(float((x0 >> _SHIFT) + _ONE) * unit))
    r1 = math.sqrt(-2.0 * math.log(float((x2 >> _SHIFT) + _ONE) * unit))
    angle0 = 2.0 * math.pi * (float(x1 >> _SHIFT) * unit)
    angle1 = 2.0 * math.pi * (float(x3 >> _SHIFT) * unit)
    return r0 * math.cos(angle0), r0 * math.sin(angle0), r1 * math.cos(angle1)


@njit(cache=True)
def extend(world, i, wanted):
    """Compute the readings of row i of a world (its ``arrays``) up to number ``wanted``, from 0."""
    readings, known, sigma, error, key, index = world
    for v in range(known[i], wanted + 1):
        z0, z1, z2 = normals(key[0], key[1], index[i], v)
        readings[i, v, 0] = error[i, 0] + sigma[i] * z0
        readings[i, v, 1] = error[i, 1] + sigma[i] * z1
        readings[i, v, 2] = error[i, 2] + sigma[i] * z2
    known[i] = max(known[i], wanted + 1)


@njit(cache=True)
def extend_all(world, wanted):
    """Compute the readings of every row up to number ``wanted``, from 0."""
    for i in range(world[0].shape[0]):
        extend(world, i, wanted)


def key_of(*entropy: int) -> np.ndarray:
    """Key (2,) uint64 of the simulation named by non-negative integers (seed first)."""
    return np.random.SeedSequence(list(entropy)).generate_state(2, np.uint64)

"""A few new poses held to the poses that a calibration was held out at.

A test by permutation, which assumes nothing of how errors are spread: where nothing changed, new
configurations are a random handful of all, new and held out, and their mean error is beyond that of
99 % of such handfuls in ``LEVEL`` of the cases. Where base or tool stands anew it is fitted to the
new poses, which takes up a part of their errors, so it is fitted to every handful as well: a step
of least squares, as errors are small beside the arm. New configurations are taken to lie among
those of the calibration; of one that is read again the first reading counts.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kinacc.geometry import Pose, skew

LEVEL = 0.01  # of weekly checks of an arm that does not change one in two years fails
POWER = 0.8  # four of five
DOUBLED = 2.0  # a handful that would not show errors this many times as large passes nothing
LEAST_HELD_OUT = 20  # configurations: fewer do not say how large errors are
SIZES = (3, 4, 5, 6, 8, 10, 12, 15, 20, 30, 40, 60)  # of handfuls that are looked at
BASE, TOOL = "base", "tool"
_DRAWN, _DRAWN_LARGER, _DRAWN_MOVED = 4000, 2000, 400  # handfuls: of readings, errors, offsets
_DRAWN_READINGS, _LEAST_DRAWN = 2_000_000, 1000  # handfuls of many poses are fewer
_SAMPLES, _STEPS, _TOO_LARGE = 8, 3, 20.0  # of larger errors, and how often the limit follows them
_SMALLEST, _TOO_FAR, _HALVED = 1e-3, 50.0, 8  # mrad, mm, and how finely offsets are sought
_MOST = 4_000_000  # numbers in memory at once
_SINGULAR = 1e-9  # of the largest squared singular value: nothing is seen of such a direction
_MRAD = 1e-3


@dataclass(frozen=True)
class Places:
    """n configurations, each with one reading of every one of K targets.

    ``slopes`` (n, K, c, p): what the p numbers that are fitted anew move there, mm for c = 3
    components of position and, where orientations take part, times the weight for 3 more.
    ``joints`` (n, K, c, k): what 1 mrad of each joint moves (1 mm of one that slides).
    """

    slopes: np.ndarray
    joints: np.ndarray

    def __len__(self) -> int:
        return len(self.slopes)

    @property
    def unknowns(self) -> int:
        """How many numbers a fit to these places would find."""
        return self.slopes.shape[-1] and int(
            np.linalg.matrix_rank(self.slopes.reshape(-1, self.slopes.shape[-1]), tol=1e-6)
        )


@dataclass(frozen=True)
class HeldOut:
    """Errors (N, K, c), in the units of ``slopes``, of readings at ``places``."""

    errors: np.ndarray
    places: Places

    def __len__(self) -> int:
        return len(self.errors)

    def times(self, factor: float) -> HeldOut:
        """Errors as many times as large."""
        return HeldOut(factor * self.errors, self.places)

    def select(self, rows: np.ndarray) -> HeldOut:
        """The configurations ``rows``."""
        places = Places(self.places.slopes[rows], self.places.joints[rows])
        return HeldOut(self.errors[rows], places)

    @property
    def numbers(self) -> int:
        """How many numbers one configuration gives a fit."""
        return int(np.prod(self.errors.shape[1:]))


class Seen(NamedTuple):
    """What ``poses`` show in four of five cases: errors ``factor`` times as large, or an offset of
    a joint by ``joints`` (k,), mrad or mm; inf where the fit of base and tool takes it up."""

    poses: int
    factor: float
    joints: np.ndarray


class Held(NamedTuple):
    """The mean error of a handful beside those of handfuls where nothing changed, mm.

    ``limit_mm`` is passed by all but ``LEVEL`` of them; ``probability``: of a mean of at least
    ``mean_mm``. ``expected_mm`` is their mean.
    """

    mean_mm: float
    expected_mm: float
    limit_mm: float
    probability: float


def places(
    flange: Pose,
    targets: Pose,
    jacobian: np.ndarray,
    moved: tuple[str, ...],
    weight_mm_per_rad: float | None,
) -> Places:
    """Places of n poses ``flange`` and K ``targets`` in it; ``jacobian`` (n, 6, k): the flange's.

    ``moved``: what of ``BASE`` and ``TOOL`` is fitted anew; the weight is None where positions are
    compared alone.
    """
    arm = np.einsum("nij,kj->nki", flange.rotation, targets.position_mm)
    at = flange.position_mm[:, None] + arm
    count, seen = at.shape[:2]
    turned = np.broadcast_to(flange.rotation[:, None], (count, seen, 3, 3))
    lever, swung = -skew(at.reshape(-1, 3)), -skew(arm.reshape(-1, 3))
    unit, nothing = np.broadcast_to(np.eye(3), turned.shape), np.zeros(turned.shape)
    blocks = []
    if BASE in moved:
        blocks.append((unit, nothing))
        blocks.append((_MRAD * lever.reshape(turned.shape), _MRAD * unit))
    for target in range(seen if TOOL in moved else 0):
        own = (np.arange(seen) == target)[:, None, None]
        blocks.append((turned * own, nothing))
        if weight_mm_per_rad is not None:
            blocks.append((nothing, _MRAD * turned * own))
    turning = np.broadcast_to(jacobian[:, None, 3:], (count, seen, *jacobian[:, 3:].shape[1:]))
    moving = jacobian[:, None, :3] + swung.reshape(turned.shape) @ turning
    return Places(
        _both([first for first, _ in blocks], [second for _, second in blocks], weight_mm_per_rad)
        if blocks
        else np.zeros((count, seen, 3 if weight_mm_per_rad is None else 6, 0)),
        _both([moving], [turning], weight_mm_per_rad),
    )


def _both(position: list[np.ndarray], turn: list[np.ndarray], weight: float | None) -> np.ndarray:
    found = np.concatenate(position, axis=-1)
    if weight is None:
        return found
    return np.concatenate([found, weight * np.concatenate(turn, axis=-1)], axis=-2)


def held_to(held_out: HeldOut, new: HeldOut) -> Held:
    """Hold the mean error of ``new`` configurations to that of handfuls of all there are.

    ``new.errors`` are those that the fit of base and tool leaves. Where nothing has changed, the
    new configurations are a handful of all like any other: the level is exact where nothing is
    fitted, for any distribution of errors and any number of them. Where something is, what the fit
    took off the new ones on the whole is put back before they are dealt out.
    """
    mean_mm = float(_sizes(new.errors).mean())
    left = 1.0 - new.places.unknowns / (new.numbers * len(new))
    among = _together(held_out, new.times(1.0 / np.sqrt(left)))
    means = chance(among, len(new))
    beyond = (1 + int(np.sum(means >= mean_mm))) / (1 + len(means))
    return Held(mean_mm, float(means.mean()), _limit(means), beyond)


def chance(among: HeldOut, poses: int, times: int = _DRAWN) -> np.ndarray:
    """Mean errors (m,) of handfuls of ``poses`` configurations, base and tool fitted to each."""
    times = int(np.clip(_DRAWN_READINGS / poses, min(times, _LEAST_DRAWN), times))
    drawn = _drawn(len(among), poses, times)
    return np.concatenate([each.mean(axis=(1, 2)) for each in _left(among, drawn)])


def least(held_out: HeldOut) -> int | None:
    """The smallest of ``SIZES`` that shows errors doubled; None where none does."""
    for poses in SIZES:
        told = poses * held_out.numbers > held_out.places.unknowns
        if told and 2 * poses <= len(held_out) and factor(held_out, poses)[0] <= DOUBLED:
            return poses
    return None


def factor(held_out: HeldOut, poses: int) -> tuple[float, float]:
    """How many times as large errors are seen in four of five, and the limit that they exceed, mm.

    The new configurations are among those that they are held to, so that they raise the limit.
    """
    means = chance(held_out, poses, _DRAWN_LARGER)
    small, limit = float(np.quantile(means, 1.0 - POWER)), _limit(means)
    for _ in range(_STEPS):
        times = limit / small if small > 0.0 else np.inf
        if times > _TOO_LARGE:
            return np.inf, np.inf
        drawn = _drawn(len(held_out), poses, _SAMPLES)
        some = (_together(held_out, held_out.select(each).times(times)) for each in drawn)
        limit = _limit(
            np.concatenate([chance(each, poses, _DRAWN_LARGER // _SAMPLES) for each in some])
        )
    return limit / small, limit


def seen(held_out: HeldOut, poses: int, new: Places | None = None) -> Seen:
    """What ``poses`` show: those at ``new``, or as many spread as those of the calibration are."""
    times, limit = factor(held_out, poses)
    index = _drawn(len(held_out), poses, max(_DRAWN_MOVED // max(poses // 50, 1), 100))
    own = held_out.places
    slopes = own.slopes[index] if new is None else new.slopes[None]
    by = own.joints[index] if new is None else new.joints[None]
    still = _without(held_out.errors[index][..., None], slopes)[..., 0]
    moved = _without(by, slopes)
    offsets = [_offset(still, moved[..., each], limit) for each in range(by.shape[-1])]
    return Seen(poses, times, np.array(offsets))


def _together(one: HeldOut, other: HeldOut) -> HeldOut:
    pairs = ((one.errors, other.errors), (one.places.slopes, other.places.slopes))
    errors, slopes = (np.concatenate(pair) for pair in pairs)
    return HeldOut(errors, Places(slopes, np.zeros((*errors.shape, 0))))


def _sizes(errors: np.ndarray) -> np.ndarray:
    return np.linalg.norm(errors[..., :3], axis=-1)


def _limit(means: np.ndarray) -> float:
    return float(np.quantile(means, 1.0 - LEVEL))


def _offset(still: np.ndarray, moved: np.ndarray, limit: float) -> float:
    """Smallest multiple of ``moved`` (1 or m, n, K, 3) that takes four of five beyond ``limit``.

    ``still`` (m, n, K, 3) are errors without it. inf where none of any arm would.
    """

    def share(times: float) -> float:
        sizes = np.linalg.norm(still + times * moved, axis=-1)
        return float(np.mean(sizes.mean(axis=(1, 2)) > limit))

    high = _SMALLEST
    while share(high) < POWER:
        high *= 2.0
        if high > _TOO_FAR:
            return np.inf
    low = 0.5 * high
    for _ in range(_HALVED):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if share(middle) >= POWER else (middle, high)
    return high


def _drawn(count: int, size: int, times: int) -> np.ndarray:
    """Handfuls (times, size) of ``count`` configurations, each at most once where they suffice."""
    rng = np.random.default_rng(0)
    if size > count:
        return rng.integers(count, size=(times, size))
    if size**2 > 4 * count:
        return np.argsort(rng.random((times, count)), axis=1)[:, :size]
    index = rng.integers(count, size=(times, size))
    while (again := (np.diff(np.sort(index, axis=1), axis=1) == 0).any(axis=1)).any():
        index[again] = rng.integers(count, size=(int(again.sum()), size))
    return index


def _left(held_out: HeldOut, index: np.ndarray) -> Iterator[np.ndarray]:
    """Sizes (m, n, K) of position errors of handfuls ``index`` (M, n) after the fit, by blocks."""
    slopes = held_out.places.slopes
    block = max(_MOST // (max(int(np.prod(slopes.shape[1:])), 1) * index.shape[1]), 1)
    for first in range(0, len(index), block):
        part = index[first : first + block]
        left = _without(held_out.errors[part][..., None], slopes[part])
        yield np.linalg.norm(left[..., 0], axis=-1)


def _without(values: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Positions (m, n, K, 3, r) of ``values`` (m, n, K, c, r) less what ``slopes`` take up.

    ``slopes`` (1 or m, n, K, c, p).
    """
    if not slopes.shape[-1]:
        return values[..., :3, :]
    flat = slopes.reshape(len(slopes), -1, slopes.shape[-1])
    turned = np.swapaxes(flat, 1, 2)
    own, vectors = np.linalg.eigh(turned @ flat)
    kept = own > _SINGULAR * own[:, -1:]
    inverse = np.where(kept, 1.0 / np.where(kept, own, 1.0), 0.0)
    along = turned @ values.reshape(len(values), flat.shape[1], -1)
    found = vectors @ (inverse[..., None] * (np.swapaxes(vectors, 1, 2) @ along))
    return (values - (flat @ found).reshape(values.shape))[..., :3, :]

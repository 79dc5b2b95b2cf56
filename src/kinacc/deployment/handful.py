"""A few new poses held to the poses that a calibration was held out at.

A test by permutation, which assumes nothing of how errors are spread: where nothing changed, new
configurations are a random handful of all, new and held out, and their errors are beyond those of
99 % of such handfuls in ``LEVEL`` of the cases. Two sizes of errors are held to it, each at half of
the level: their mean, and what offsets of the joints would explain of them, which shows a joint
that lost its zero while that is small beside all errors. Where base or tool stands anew it is
fitted to the new poses, which takes up a part of their errors, so it is fitted to every handful as
well: a step of least squares, as errors are small beside the arm. New configurations are taken to
lie among those of the calibration; of one that is read again the first reading counts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
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
_DRAWN_READINGS, _LEAST_DRAWN = 100_000, 1000  # handfuls of many poses are fewer
_SAMPLES, _STEPS, _TOO_LARGE = 8, 3, 20.0  # of larger errors, and how often the limit follows them
_SMALLEST, _TOO_FAR, _HALVED = 1e-3, 50.0, 8  # mrad, mm, and how finely offsets are sought
_MOST = 4_000_000  # numbers in memory at once
_SINGULAR = 1e-9  # of the largest squared singular value: nothing is seen of such a direction
_HARDLY_MM = 0.05  # rms: joints that 1 mrad of moves less, base and tool fitted, are not looked at
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


@dataclass(frozen=True, eq=False)
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
    """New configurations beside handfuls of all, mm: their mean error, and the rms of what offsets
    of the joints would explain of it.

    Both limits are kept by all but half of ``LEVEL`` of handfuls where nothing has changed;
    ``probability``: of either as large there. ``expected_mm`` is the mean of their mean errors,
    ``joint`` (from 1) the one whose ``offset``, mrad or mm, explains most.
    """

    mean_mm: float
    expected_mm: float
    limit_mm: float
    offsets_mm: float
    offsets_limit_mm: float
    probability: float
    joint: int
    offset: float


class Parts(NamedTuple):
    """What is left of m handfuls after the fit of base and tool.

    ``means`` (m,) position errors; ``squares`` (m,) of all errors that offsets of the joints would
    explain; ``along`` (m, k) errors along what an offset by 1 mrad leaves, and ``of`` (m, k, k)
    products of these, all for one reading.
    """

    means: np.ndarray
    squares: np.ndarray
    along: np.ndarray
    of: np.ndarray

    def limits(self) -> tuple[float, float]:
        """Mean and squares that all but half of ``LEVEL`` keep, each."""
        share = 1.0 - 0.5 * LEVEL
        return float(np.quantile(self.means, share)), float(np.quantile(self.squares, share))


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
    """Hold the errors of ``new`` configurations to those of handfuls of all there are.

    ``new.errors`` are those that the fit of base and tool leaves. Where nothing has changed, the
    new configurations are a handful of all like any other: the level is exact where nothing is
    fitted, for any distribution of errors and any number of them. Where something is, what the fit
    took off the new ones on the whole is put back before they are dealt out.
    """
    own = _apart(new.errors[None], new.places.slopes[None], new.places.joints[None])
    left = 1.0 - new.places.unknowns / (new.numbers * len(new))
    dealt = chance(_together(held_out, new.times(1.0 / np.sqrt(left))), len(new))
    mean_limit, squares_limit = dealt.limits()
    beyond = min(np.sum(dealt.means >= own.means), np.sum(dealt.squares >= own.squares))
    products, shown = np.diagonal(own.of[0]), np.diagonal(own.of[0]) > _HARDLY_MM**2
    offsets = np.divide(own.along[0], products, out=np.zeros_like(products), where=shown)
    joint = int(np.argmax(offsets * own.along[0]))
    return Held(
        float(own.means[0]),
        float(dealt.means.mean()),
        mean_limit,
        float(np.sqrt(own.squares[0])),
        float(np.sqrt(squares_limit)),
        float(min(2.0 * (1 + beyond) / (1 + len(dealt.means)), 1.0)),
        joint + 1,
        float(offsets[joint]),
    )


def chance(among: HeldOut, poses: int, times: int = _DRAWN) -> Parts:
    """Handfuls of ``poses`` configurations, base and tool fitted to each."""
    times = int(np.clip(_DRAWN_READINGS / poses, min(times, _LEAST_DRAWN), times))
    return _left(among, _drawn(len(among), poses, times))


def least(held_out: HeldOut) -> int | None:
    """The smallest of ``SIZES`` that shows errors doubled; None where none does."""
    for poses in SIZES:
        told = poses * held_out.numbers > held_out.places.unknowns
        if told and 2 * poses <= len(held_out) and factor(held_out, poses)[0] <= DOUBLED:
            return poses
    return None


@lru_cache(maxsize=32)
def factor(held_out: HeldOut, poses: int) -> tuple[float, tuple[float, float]]:
    """How many times as large errors are seen in four of five, and the limits that they exceed.

    The new configurations are among those that they are held to, so that they raise the limits.
    """
    dealt = chance(held_out, poses, _DRAWN_LARGER)
    limits, times = dealt.limits(), np.inf
    for step in range(_STEPS + 1):
        with np.errstate(divide="ignore"):
            needed = [limits[0] / dealt.means, np.sqrt(limits[1] / dealt.squares)]
        times = float(np.quantile(np.minimum(*needed), POWER))
        if not times <= _TOO_LARGE:
            return np.inf, (np.inf, np.inf)
        if step < _STEPS:
            drawn = _drawn(len(held_out), poses, _SAMPLES)
            some = [_together(held_out, held_out.select(each).times(times)) for each in drawn]
            parts = [chance(each, poses, _DRAWN_LARGER // _SAMPLES) for each in some]
            limits = Parts(*map(np.concatenate, zip(*parts, strict=True))).limits()
    return times, limits


def seen(held_out: HeldOut, poses: int, new: Places | None = None) -> Seen:
    """What ``poses`` show: those at ``new``, or as many spread as those of the calibration are."""
    times, limits = factor(held_out, poses)
    index = _drawn(len(held_out), poses, max(_DRAWN_MOVED // max(poses // 50, 1), 100))
    own = held_out.places
    slopes = own.slopes[index] if new is None else new.slopes[None]
    joints = own.joints[index] if new is None else new.joints[None]
    errors = held_out.errors[index]
    parts = _apart(errors, slopes, joints)
    still = _without(errors[..., None], slopes)[..., :3, 0]
    moved = _without(joints, slopes)[..., :3, :]
    offsets = []
    for joint in range(joints.shape[-1]):
        along, own_square = parts.along[:, joint], parts.of[:, joint, joint]

        def share(
            offset: float,
            moved: np.ndarray = moved[..., joint],
            along: np.ndarray = along,
            own_square: np.ndarray = own_square,
        ) -> float:
            means = np.linalg.norm(still + offset * moved, axis=-1).mean(axis=(1, 2))
            squares = parts.squares + 2.0 * offset * along + offset**2 * own_square
            return float(np.mean((means > limits[0]) | (squares > limits[1])))

        offsets.append(_smallest(share))
    return Seen(poses, times, np.array(offsets))


def _smallest(share: Callable[[float], float]) -> float:
    """The smallest offset, mrad or mm, whose ``share`` of cases seen is four of five; else inf."""
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


def _together(one: HeldOut, other: HeldOut) -> HeldOut:
    pairs = (
        (one.errors, other.errors),
        (one.places.slopes, other.places.slopes),
        (one.places.joints, other.places.joints),
    )
    errors, slopes, joints = (np.concatenate(pair) for pair in pairs)
    return HeldOut(errors, Places(slopes, joints))


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


def _left(held_out: HeldOut, index: np.ndarray) -> Parts:
    """Parts of the handfuls ``index`` (m, n), by blocks."""
    places = held_out.places
    numbers = places.slopes[0].size + places.joints[0].size
    block = max(_MOST // (numbers * index.shape[1]), 1)
    parts = []
    for first in range(0, len(index), block):
        own = index[first : first + block]
        parts.append(_apart(held_out.errors[own], places.slopes[own], places.joints[own]))
    return Parts(*map(np.concatenate, zip(*parts, strict=True)))


def _apart(errors: np.ndarray, slopes: np.ndarray, joints: np.ndarray) -> Parts:
    """Parts of ``errors`` (m, n, K, c), with ``slopes`` and ``joints`` (1 or m, n, K, c, p)."""
    left = _without(errors[..., None], slopes)
    moved = _without(joints, slopes)
    readings = errors.shape[1] * errors.shape[2]
    flat = moved.reshape(len(moved), -1, moved.shape[-1])
    turned = np.swapaxes(flat, 1, 2)
    along = (turned @ left.reshape(len(left), -1, 1))[..., 0] / readings
    of = turned @ flat / readings
    found = (_inverse(of, _HARDLY_MM**2) @ along[..., None])[..., 0]
    means = np.linalg.norm(left[..., :3, 0], axis=-1).mean(axis=(1, 2))
    squares = np.sum(found * along, axis=1)
    return Parts(means, squares, along, np.broadcast_to(of, (len(left), *of.shape[1:])))


def _without(values: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """``values`` (m, n, K, c, r) less what ``slopes`` (1 or m, n, K, c, p) take up of them."""
    if not slopes.shape[-1]:
        return values
    flat = slopes.reshape(len(slopes), -1, slopes.shape[-1])
    turned = np.swapaxes(flat, 1, 2)
    along = turned @ values.reshape(len(values), flat.shape[1], -1)
    return values - (flat @ (_inverse(turned @ flat) @ along)).reshape(values.shape)


def _inverse(gram: np.ndarray, hardly: float = 0.0) -> np.ndarray:
    """Inverses (m, p, p) of symmetric matrices, nothing along what is ``hardly`` or not seen."""
    own, vectors = np.linalg.eigh(gram)
    kept = own > np.maximum(_SINGULAR * own[:, -1:], hardly)
    inverse = np.where(kept, 1.0 / np.where(kept, own, 1.0), 0.0)
    return (vectors * inverse[:, None]) @ np.swapaxes(vectors, 1, 2)

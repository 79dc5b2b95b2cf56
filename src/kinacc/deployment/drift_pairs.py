"""Two series of one arm as one linear model: base and tool, joint errors, and when was measured."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from kinacc.calibration import dh_fit, vec_fit
from kinacc.calibration.constraints import frame_terms
from kinacc.calibration.frames import Frames, coordinates, known
from kinacc.calibration.observations import Observations
from kinacc.calibration.one_thread import one_thread
from kinacc.calibration.system import PoseSystem
from kinacc.deployment.record import Calibration
from kinacc.kinematics import vec
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.robot import carried
from kinacc.kinematics.vec import ERRORS
from kinacc.measurements.folds import SAME_CONFIGURATION_RAD, configurations

ORDER = 8  # of the polynomials of the misfit; finer misfit differs between configurations
CUTS = 2  # of one series into halves, across the widest directions of its joints
MOST = 1500  # configurations of a series: what more would add is small beside the misfit
_NARROW_RAD = 1e-3


class Setup(NamedTuple):
    """Whether base and tool of the second series are those of the first."""

    same_base: bool
    same_tool: bool


@dataclass(frozen=True)
class Pair:
    """m residual components (mm) of two series about one DH model, and what may explain them.

    ``frames`` (m, F): motions of bases and targets, ``is_base`` (F,) says which; ``own`` (F,) marks
    those only the second series has. ``constant`` (m, 6k): errors in front of every joint,
    ``ERRORS`` joint by joint in mm and rad; ``longer`` (6k,) of them make all lengths 1e-3 longer.
    ``misfit`` (m, Q): errors growing with the joints, of prior proportions; ``joint`` (Q,) says of
    which (0-based; one more: by travel direction). ``residual`` (m,) is measured minus model.
    ``second``, ``position`` (m,): of the second series, of a position. ``cluster`` (m,):
    configuration, alike in both. ``late`` (m,): order of measuring within a series, of mean 0 and
    variance 1.
    """

    frames: np.ndarray
    is_base: np.ndarray
    own: np.ndarray
    constant: np.ndarray
    longer: np.ndarray
    misfit: np.ndarray
    joint: np.ndarray
    residual: np.ndarray
    second: np.ndarray
    position: np.ndarray
    cluster: np.ndarray
    late: np.ndarray


@one_thread
def of_observations(
    first: Observations,
    second: Observations,
    setup: Setup,
    calibration: Calibration,
    rotation_weight_mm_per_rad: float,
) -> Pair:
    """The pair about the DH model of a ``calibration`` of the arm. Raises FitError."""
    first, second = thinned(first), thinned(second)
    both = joined(first, second, setup)
    frames = _frames(both, calibration, rotation_weight_mm_per_rad)
    model = calibration.plainest.model.dh
    return about(model, frames, both, len(first), rotation_weight_mm_per_rad)


@one_thread
def cut(
    series: Observations, setup: Setup, calibration: Calibration, rotation_weight_mm_per_rad: float
) -> list[Pair]:
    """One series as pairs of ``halves``, between which nothing happened at the arm."""
    series = thinned(series)
    frames = _frames(series, calibration, rotation_weight_mm_per_rad)
    model = calibration.plainest.model.dh
    alone = about(model, frames, series, len(series), rotation_weight_mm_per_rad)
    row = np.repeat(np.arange(len(series)), 3 + 3 * series.has_rotation)
    return [*halves(alone, series.q_rad[row], setup)]


def _frames(
    observations: Observations, calibration: Calibration, rotation_weight_mm_per_rad: float
) -> Frames:
    """Base and targets of observations, the arm as calibrated."""
    robot = calibration.robot
    counts = len(observations.session_names), len(observations.target_names)
    return dh_fit.fit_frames(
        observations,
        calibration.plainest.model.dh,
        rotation_weight_mm_per_rad=rotation_weight_mm_per_rad,
        frame_terms=frame_terms(observations, known(robot.base, carried(robot), *counts)),
    ).frames


def about(
    model: DHModel,
    frames: Frames,
    both: Observations,
    first: int,
    rotation_weight_mm_per_rad: float,
) -> Pair:
    """The pair linearised at ``model`` and ``frames``; the ``first`` rows are the first series."""
    both = replace(both, q_rad=within_a_turn(both.q_rad, model.prismatic))
    empty = vec.without_errors(model, *_span(both.q_rad), ORDER)
    _, flange = vec_fit.flange_model(both, empty)
    coords = coordinates(both, frames, base_free=True, targets_free=True)
    system = PoseSystem(both, flange, coords, rotation_weight_mm_per_rad)
    parts = [*system.blocks(np.zeros(system.size))]
    residual = -np.concatenate([part for part, _ in parts])
    jacobian = np.concatenate([part for _, part in parts])
    per_row = 3 + 3 * both.has_rotation
    row = np.repeat(np.arange(len(both)), per_row)
    second = row >= first
    of_frames, errors = np.split(jacobian, [coords.size], axis=1)
    polynomials = len(ERRORS) * model.joints * (ORDER + 1)
    order = np.arange(polynomials) % (ORDER + 1)
    joint = np.arange(polynomials) // (len(ERRORS) * (ORDER + 1))
    growing, travelling = errors[:, :polynomials][:, order > 0], errors[:, polynomials:]
    size = np.sqrt(np.mean(growing**2, axis=0)) * order[order > 0]
    growing = growing / np.where(size > 0.0, size, 1.0)
    travelled = np.sqrt(np.mean(travelling**2, axis=0))
    travelling = travelling / np.where(travelled > 0.0, travelled, 1.0)
    late = np.concatenate([_late(first), _late(len(both) - first)])
    return Pair(
        frames=of_frames,
        is_base=np.arange(coords.size) < 6 * coords.anchor.sessions,
        own=~np.any(of_frames[~second] != 0.0, axis=0),
        constant=errors[:, :polynomials][:, order == 0],
        longer=longer(model),
        misfit=np.concatenate([growing, travelling], axis=1),
        joint=np.concatenate([joint[order > 0], np.full(travelling.shape[1], model.joints)]).astype(
            int
        ),
        residual=residual,
        second=second,
        position=~both.is_rotation,
        cluster=configurations(both.pose, both.q_rad)[row],
        late=late[row],
    )


def longer(model: DHModel) -> np.ndarray:
    """Errors in front of every joint (6k,) of an arm whose lengths are all 1e-3 longer.

    The last link's own length goes with the tool.
    """
    found = np.zeros((model.joints, len(ERRORS)))
    found[:, ERRORS.index("delta_z")] = np.where(model.prismatic, 0.0, model.d_mm)
    found[1:, ERRORS.index("delta_x")] = model.a_mm[:-1]
    return 1e-3 * found.ravel()


def all_shared(pair: Pair) -> bool:
    """Whether all configurations of both series are the same."""
    one, other = (np.unique(pair.cluster[pair.second == each]) for each in (False, True))
    return np.array_equal(one, other)


def share_inside(q_rad: np.ndarray, ranged_rad: np.ndarray, prismatic: np.ndarray) -> float:
    """Share of joints (n, k) that lie in the ranges of others (m, k), but for full turns."""
    low = ranged_rad.min(axis=0) - SAME_CONFIGURATION_RAD
    above = q_rad - low
    above = np.where(prismatic, above, np.mod(above, 2.0 * np.pi))
    wide = ranged_rad.max(axis=0) + SAME_CONFIGURATION_RAD - low
    return float(np.mean(np.all((above >= 0.0) & (above <= wide), axis=1)))


def halves(series: Pair, q_rad: np.ndarray, setup: Setup) -> Iterator[Pair]:
    """A series (a pair without a second one) as pairs of halves that lie apart in the joints.

    Each is cut at the median of one of the ``CUTS`` principal coordinates of the joints (m, k) of
    the components. Frames that ``setup`` does not have in common are free in both halves.
    """
    turned = np.concatenate([np.sin(q_rad), np.cos(q_rad)], axis=1)
    turned = turned - turned.mean(axis=0)
    axes = np.linalg.svd(turned, full_matrices=False)[2][:CUTS]
    anew = ~(series.is_base & setup.same_base | ~series.is_base & setup.same_tool)
    for along in (turned @ axes.T).T:
        # Whole configurations: their mean decides.
        mean = np.bincount(series.cluster, along) / np.bincount(series.cluster)
        second = (mean > np.median(mean))[series.cluster]
        yield replace(
            series,
            frames=np.concatenate(
                [series.frames, series.frames[:, anew] * second[:, None]], axis=1
            ),
            is_base=np.concatenate([series.is_base, series.is_base[anew]]),
            own=np.concatenate([np.zeros(len(anew), bool), np.ones(anew.sum(), bool)]),
            second=second,
        )


def joined(first: Observations, second: Observations, setup: Setup) -> Observations:
    """Both series as one; sessions and targets of the second are those of the first if the same."""
    sessions, session = _named(first.session_names, second.session_names, setup.same_base)
    targets, target = _named(first.target_names, second.target_names, setup.same_tool)
    columns = {
        name: np.concatenate([getattr(first, name), getattr(second, name)])
        for name in ("q_rad", "s", "position_mm", "rotation", "repeat", "fold", "payload")
    }
    return replace(
        first,
        **columns,
        pose=np.concatenate([first.pose, second.pose + first.pose.max() + 1 - second.pose.min()]),
        session=np.concatenate([first.session, session[second.session]]),
        session_names=sessions,
        target=np.concatenate([first.target, target[second.target]]),
        target_names=targets,
    )


def within_a_turn(q_rad: np.ndarray, prismatic: np.ndarray) -> np.ndarray:
    """Joints (n, k), those that turn by more than a turn taken back into one: the arm is alike."""
    turns = (np.ptp(q_rad, axis=0) > 2.0 * np.pi) & ~prismatic
    return np.where(turns, np.mod(q_rad + np.pi, 2.0 * np.pi) - np.pi, q_rad)


def thinned(observations: Observations) -> Observations:
    """At most ``MOST`` configurations, evenly over the order they were measured in."""
    configuration = configurations(observations.pose, observations.q_rad)
    count = configuration.max() + 1
    if count <= MOST:
        return observations
    kept = np.linspace(0, count - 1, MOST).round().astype(int)
    return observations.select(np.isin(configuration, kept))


def _named(first: tuple, second: tuple, same: bool) -> tuple[tuple, np.ndarray]:
    """Names of both, and where those of the second stand among them."""
    names = list(first)
    place = []
    for name in second:
        if not same or name not in first:
            names.append(name if name not in names else f"{name}, second series")
            place.append(len(names) - 1)
        else:
            place.append(names.index(name))
    return tuple(names), np.array(place, dtype=np.int64)


def _span(q_rad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    low, high = q_rad.min(axis=0), q_rad.max(axis=0)
    return low - _NARROW_RAD, high + _NARROW_RAD


def _late(count: int) -> np.ndarray:
    """Order of measuring (count,), of mean 0 and variance 1."""
    order = np.arange(count) - 0.5 * (count - 1)
    return order / max(np.sqrt(np.mean(order**2)), 0.5) if count else order

"""Which parameters poses determine; the directions of those they do not, in words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from typing import Any

import numpy as np
import pandas as pd
import scipy

from kinacc.calibration.fitting import ModelFit, PoseSystem
from kinacc.calibration.frames import BASE, MOTIONS, Frames
from kinacc.calibration.least_squares import MOVES_SQUARED, Split, one_thread
from kinacc.calibration.observations import Observations
from kinacc.calibration.uncertainty import (
    TOUCH_SQUARED,
    Uncertainty,
    named_directions,
    scale_of,
    scaled_unit,
    unit_of,
)
from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.tables.columns import Columns
from kinacc.tables.contract import columns_of

IDENTIFIED, PRIOR, UNDETERMINED, FIXED = "identified", "prior", "undetermined", "fixed"
UNIDENTIFIABLE = ": no pose separates these"
UNSEEN = ": no pose determines it"  # of one parameter alone
POORLY_DETERMINED = ": poorly determined by these poses"
LEAST = 0.02  # of the largest part of a direction; smaller parts are not listed
_RANK = 1e-6
_TIE = 1e-6  # relative reduction per column: of equal columns the earlier one is the pivot
_SEPARATE = 0.5  # part of a unit direction beside the structural ones that is reported
_MOST_NAMES = 6
_JOIN = "; "


@dataclass(frozen=True)
class LeftOpen:
    """Directions (m, P) of the parameters ``names`` (P,) that poses do not determine.

    Displacements in mm and mrad, the largest of each direction 1. ``structural`` (m,): no pose
    separates these; the others are poorly determined by the measured poses alone. ``frames``: base
    and targets.
    """

    directions: np.ndarray
    structural: np.ndarray
    names: tuple[str, ...]
    frames: Frames

    @classmethod
    def of(
        cls, hidden: np.ndarray, undetermined: np.ndarray, names: Sequence[str], frames: Frames
    ) -> LeftOpen:
        """Mix directions so that each has few parameters.

        Parameters
        ----------
        hidden : numpy.ndarray
            Directions that no pose shows, shape (h, P), in mm and mrad.
        undetermined : numpy.ndarray
            Directions that the measured poses do not determine, shape (u, P); ``hidden`` included.
        names : sequence of str
            Names of the P parameters.
        frames : Frames
            Base and targets of the fit.
        """
        arm, structural, weak = of_arm(names), [], []
        kinds = zip((~arm, arm), _apart(hidden, arm), _apart(undetermined, arm), strict=True)
        for among, exact, shown in kinds:
            structural.append(_sparse(exact, among))
            weak.append(_sparse(_beside(shown, exact, among), among))
        directions = np.concatenate([*structural, *weak])
        count = sum(map(len, structural))
        return cls(directions, np.arange(len(directions)) < count, tuple(names), frames)

    @property
    def sentences(self) -> tuple[str, ...]:
        """A line (m,) for each direction: base motions along the robot's own axes."""
        lines, arm = [], of_arm(self.names)
        for direction, structural in zip(self.directions, self.structural, strict=True):
            turned = self._in_robot_axes(direction)
            parts = sorted(np.flatnonzero(np.abs(turned) >= LEAST), key=lambda i: -abs(turned[i]))
            first = sorted(parts[:_MOST_NAMES], key=lambda i: (not arm[i], i))
            turned = turned * np.sign(turned[first[0]])
            shown = [
                f"{parameter_name(self.names[i])} {turned[i]:+.2g} {scaled_unit(self.names[i])}"
                for i in first
            ]
            more = [f"{len(parts) - _MOST_NAMES} more"] if len(parts) > _MOST_NAMES else []
            hidden = UNIDENTIFIABLE if len(parts) > 1 else UNSEEN
            ending = hidden if structural else POORLY_DETERMINED
            lines.append(", ".join(shown + more) + ending)
        return tuple(lines)

    def _in_robot_axes(self, direction: np.ndarray) -> np.ndarray:
        turned = direction.copy()
        for session, rotation in enumerate(self.frames.bases.rotation):
            first = f"{BASE}{session + 1 if session else ''}.{MOTIONS[0]}"
            if first in self.names:
                shift = self.names.index(first)
                moved = direction[shift : shift + 6].reshape(2, 3) @ rotation
                turned[shift : shift + 6] = moved.ravel()
        return turned


def of_arm(names: Sequence[str]) -> np.ndarray:
    """True (P,) for parameters of the arm; the others are motions of base and targets."""
    return np.array([name.partition(".")[2] not in MOTIONS for name in names])


def listed(table: Mapping[str, Iterable[Any]]) -> list[str]:
    """Every sentence of a table on undetermined directions, once.

    Parameters
    ----------
    table : mapping
        Columns of ``dh_identified``.

    Returns
    -------
    list of str
        Parts in mm and mrad, the base's along the robot's own axes.
    """
    rows = pd.DataFrame({name: table[name] for name in ("status", "statement")})
    cells = rows.loc[rows["status"] == UNDETERMINED, "statement"].dropna()
    return cells.astype(str).str.split(_JOIN).explode().unique().tolist()


def weak(sentences: Iterable[str]) -> list[str]:
    """Those of ``listed`` that other poses would determine, without saying so.

    Parameters
    ----------
    sentences : iterable of str
        See ``listed``.

    Returns
    -------
    list of str
        Their parameters and parts.
    """
    return [
        text.removesuffix(POORLY_DETERMINED)
        for text in sentences
        if text.endswith(POORLY_DETERMINED)
    ]


def parameter_name(name: str) -> str:
    """A parameter in words, as ``calibration.frames`` names those of base and targets.

    Parameters
    ----------
    name : str
        As ``j1.d_mm`` or ``base.x_mm``.

    Returns
    -------
    str
        As ``d of joint 1`` or ``base x``.
    """
    where, _, parameter = name.rpartition(".")
    short = parameter.partition("_")[0]
    return f"{short} of joint {where[1:]}" if parameter in PARAMETERS else f"{where} {short}"


def _apart(rows: np.ndarray, arm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions of frames alone, and the others; together they span what ``rows`` span."""
    turn, values, _ = np.linalg.svd(rows[:, arm])
    count, mixed = int(np.sum(values > _RANK * values.max(initial=0.0))), turn.T @ rows
    return mixed[count:], mixed[:count]


def _beside(rows: np.ndarray, exact: np.ndarray, among: np.ndarray) -> np.ndarray:
    """Directions in the span of ``rows`` that ``exact`` do not explain, by parts ``among``."""
    if not len(rows) or not len(exact):
        return rows
    _, values, right = np.linalg.svd(exact[:, among], full_matrices=False)
    basis = right[values > _RANK * values[0]]
    rows = rows / np.linalg.norm(rows[:, among], axis=1, keepdims=True)
    part = rows[:, among]
    directions, values, _ = np.linalg.svd(part - part @ basis.T @ basis, full_matrices=False)
    rest = directions[:, values > _SEPARATE].T @ rows
    return rest - rest[:, among] @ np.linalg.pinv(exact[:, among], rcond=_RANK) @ exact


def _sparse(rows: np.ndarray, among: np.ndarray) -> np.ndarray:
    """The same space by directions that share no pivot ``among`` (P,), to a largest part of 1.

    In the order of their pivots.
    """
    if not len(rows):
        return rows
    columns = rows[:, among]
    # Without weights rounding decides between equal columns, and processors differ.
    weights = 1.0 - _TIE * np.arange(columns.shape[1])
    _, order = scipy.linalg.qr(columns * weights, mode="r", pivoting=True)
    mixed = np.linalg.solve(columns[:, np.sort(order[: len(rows)])], rows)
    return mixed / np.abs(mixed).max(axis=1, keepdims=True)


LEANS = 0.5  # share of its prior above which a standard deviation is that of the prior
STRUCTURAL = 1e-5  # share of the largest singular value over poses all over the joints
UNSEEN_POSES = 60
UNSEEN_WEIGHT = 500.0  # mm per rad; what is null is so by any weight


def identified(fit: ModelFit, known: Uncertainty, observations: Observations) -> Columns:
    """``dh_identified``: status of every parameter of a DH fit, frames first, and why.

    Undetermined are those of which directions below the truncation's share of the largest singular
    value (base and targets projected out) hold more than 1 % (``TOUCH_SQUARED``), or a
    quarter where a prior determines it (``MOVES_SQUARED``).

    Parameters
    ----------
    fit : ModelFit
        A fit of a DH model.
    known : Uncertainty
        Its uncertainty.
    observations : Observations
        What was fitted.
    """
    free = fit.free.ravel()
    prior = np.concatenate([fit.parameters.std, fit.prior_std.ravel()[free]])
    estimated = np.concatenate([fit.parameters.free, free[free]])
    std = np.sqrt(np.maximum(np.diag(known.covariance), 0.0))
    part = np.linalg.norm(known.undetermined, axis=0)
    hidden, rows = left_open(fit, known, observations), []
    sentences, members = hidden.sentences, np.abs(hidden.directions.T) >= LEAST
    why = [_JOIN.join(compress(sentences, taking_part)) for taking_part in members]
    for i, name in enumerate(known.names):
        status = IDENTIFIED if estimated[i] else FIXED
        statement = None if estimated[i] else "fixed by calibration.frames"
        if np.isfinite(prior[i]) and std[i] > LEANS * prior[i]:
            size = f"{prior[i] / scale_of(name):g} {scaled_unit(name)}"
            status, statement = PRIOR, f"known beforehand to {size}"
        if part[i] ** 2 > (MOVES_SQUARED if status == PRIOR else TOUCH_SQUARED):
            status, statement = UNDETERMINED, why[i] or None
        deviation = std[i] if status in (IDENTIFIED, PRIOR) else None
        rows.append((name, status, deviation, unit_of(name), float(part[i]), statement))
    fixed = compress(fit.model.names, ~free)
    rows += [(name, FIXED, None, unit_of(name), 0.0, "not fitted") for name in fixed]
    return columns_of("dh_identified", rows)


@one_thread
def left_open(fit: ModelFit, known: Uncertainty, observations: Observations) -> LeftOpen:
    """What the data cannot tell apart: directions that no pose shows, whatever the joints.

    ``observations`` were fitted: which targets were seen in which sessions, and how. Poses all over
    the joints' turns (prismatic ones: a metre) are put where the model has them: without residuals
    what cannot be seen is null to rounding.
    """
    kinds = np.stack([observations.session, observations.target, observations.has_rotation])
    kinds, q_rad = np.unique(kinds, axis=1, return_index=True)[1], joints_anywhere(fit.model.dh)
    rows = observations.select(np.tile(kinds, len(q_rad)))
    rows = replace(rows, q_rad=np.repeat(q_rad, len(kinds), axis=0))
    predicted = fit.frames.seen(fit.model, rows)
    rotation = np.where(rows.has_rotation[:, None, None], predicted.rotation, np.nan)
    everywhere = replace(rows, position_mm=predicted.position_mm, rotation=rotation)
    system = PoseSystem(everywhere, fit.model, fit.free.ravel(), fit.parameters, UNSEEN_WEIGHT)
    gram = system.normal(fit.solution.x, fit.solution.scale)
    thresholds = STRUCTURAL, STRUCTURAL
    unseen = Split.of(gram, system.frames.size, np.zeros(system.size), thresholds).lost.T
    return LeftOpen.of(named_directions(fit, unseen), known.undetermined, known.names, fit.frames)


def joints_anywhere(model: DHModel) -> np.ndarray:
    """Joints of all kinds, beyond any limits: a whole turn each, or a metre either way.

    Parameters
    ----------
    model : DHModel
        An arm with k joints.

    Returns
    -------
    numpy.ndarray
        Random DH joints, the same at each call, shape (UNSEEN_POSES, k) in rad or mm.
    """
    reach = np.where(model.prismatic, 1e3, np.pi)
    return np.random.default_rng(0).uniform(-reach, reach, (UNSEEN_POSES, model.joints))

"""Instruments and targets that moved: jumps in the order of the file, and slow drifts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import scipy
from numpy import ndarray

from kinacc.checks import robust_fit, tails
from kinacc.checks.findings import Finding, finding
from kinacc.checks.readings import Readings, parted
from kinacc.checks.robust_fit import Fitted, Trial, fit
from kinacc.geometry import log_so3
from kinacc.progress import with_progress

_MOST_SPLITS = 8
_TRIED = 3  # places tried for one split
_FEWEST = 5  # poses on either side of a split
_FEW = 30  # poses: with fewer, two more frames explain noise
_CAP = 10.0  # sigma
_NEAR = 150  # readings after a split
_BETTER = 0.85  # of what is left overall: a split of a good file leaves all but a few per cent
_BETTER_THERE = 0.55  # of what is left of the readings after the split
_PLAIN = 0.5  # share at which no other place need be tried
_STEADY = 0.9  # of what jumps explain; of one jump, a steady motion explains 0.75 at most
_EXCESS = 2.0  # times what chance, or a step along a joint, explains


def without_jumps(whole: Fitted) -> tuple[Fitted, list[Finding]]:
    """The fit with every jump of base or target taken out, one after the other, and these."""
    fitted = whole
    # Poses of equal joints are one: read often, they make no jump any surer.
    few = len(np.unique(np.round(whole.readings.q_rad, 6), axis=0)) < _FEW
    for _ in with_progress(range(_MOST_SPLITS), "searches for a moved instrument or target"):
        best, least = fitted, _PLAIN if few else 1.0
        for row in _places(fitted):
            for kind in ("session", "target"):
                share, split = _split(fitted, row, kind)
                if share < least:
                    best, least = split, share
            if least < _PLAIN:
                break
        if best is fitted:
            break
        fitted = best
    return fitted, [] if fitted is whole else [*_findings(whole, fitted)]


def _linearised(fitted: Fitted) -> tuple[Readings, ndarray, ndarray, Trial]:
    """The readings that were fitted, under Huber's loss, with what is free of the fit taken out.

    Weighted design (m, 6, P), residuals (m, 6), and the linearisation itself.
    """
    trial, few = fitted.trial, fitted.readings.select(fitted.chosen)
    trial = Trial.of(few, trial.arm, trial.strength, huber=True)
    root = np.sqrt(trial.weights)
    design = trial.design * root[..., None]
    return few, design, trial.residual * root + design @ trial.step, trial


def _places(fitted: Fitted) -> list[int]:
    """Readings before which a base or target may have moved, likely places first.

    A step is judged by how much of the residuals it explains (score test of further frames, under
    Huber's loss, with the parameters of the fit free). Residuals of real arms vary smoothly with
    the joints, and files run through these in order: a step must explain more than chance, and
    more than steps along any joint or coordinate explain of the rest, which are no jumps.
    """
    if fitted.trial.sigma_mm < tails.ROUNDING:
        return []
    few, design, residual, linear = _linearised(fitted)
    slots = linear.frames.slots
    places: dict[int, float] = {}
    for kind, number, position in slots:
        width = 6 if kind == "session" else 3
        rows = np.flatnonzero(getattr(few, kind) == number)
        if len(rows) < 4 * _FEWEST:
            continue
        part, inside = design[rows], slice(_FEWEST, len(rows) - _FEWEST + 1)
        columns = part[:, :, position[:width]]
        gains, steps, inner = _gains(columns, residual[rows], part, linear.inverse)
        place = _FEWEST + int(np.argmax(gains[inside]))
        after = (np.arange(len(rows)) >= place)[:, None]
        rest = residual[rows] - columns @ steps[place] * after
        rest = rest + part @ (linear.inverse @ inner[place])
        reference = scipy.special.chdtri(width, tails.FAMILY_WISE / (len(rows) * len(slots)))
        for along in (*few.q_rad[rows].T, *few.position_mm[rows].T):
            order = np.argsort(along, kind="stable")
            steps_along = _gains(columns[order], rest[order], part[order], linear.inverse)[0]
            reference = max(reference, steps_along[inside].max())
        if gains[place] > _EXCESS * reference:
            row = int(fitted.chosen[rows[place]])
            places[row] = max(gains[place] / reference, places.get(row, 0.0))
    return sorted(places, key=places.__getitem__, reverse=True)[:_TRIED]


def _gains(
    columns: ndarray, residual: ndarray, design: ndarray, inverse: ndarray
) -> tuple[ndarray, ndarray, ndarray]:
    """Part (n,) of the squared residuals (n, 6) that a step before each row explains.

    ``columns`` (n, 6, f) of a frame, all ``design`` (n, 6, P) with the ``inverse`` (P, P) of its
    normal equations. Also the step (n, f), and J'Z of it (n, P).
    """
    transposed = np.swapaxes(columns, 1, 2)
    score, shared, gram = (
        np.cumsum((transposed @ right)[::-1], axis=0)[::-1]
        for right in (residual[..., None], design, columns)
    )
    across = np.swapaxes(shared, 1, 2)
    ridge = 1e-6 * np.diag(np.diag(gram[0]))
    step = np.linalg.solve(gram - shared @ inverse @ across + ridge, score)
    return np.sum(step * score, axis=(1, 2)), step[..., 0], (across @ step)[..., 0]


def _split(fitted: Fitted, row: int, kind: str) -> tuple[float, Fitted]:
    """The fit without a jump near a reading: before the one that parts the two frames best.

    Also what it leaves over what it may leave at most to be believed, overall or where it is, by
    the fits' own lengths, each cut at ten sigma so that gross errors do not decide.
    """
    observed, rows = parted(fitted.readings, row, kind)
    frames = [int(getattr(item, kind)[row]) for item in (fitted.readings, observed)]
    again = fit(observed, fitted.trial.arm.nominal)
    both = np.flatnonzero(np.isin(getattr(observed, kind), frames))
    part, costs = observed.select(both), []
    for frame in frames:
        label: dict[str, Any] = {kind: np.full(len(both), frame)}
        left = robust_fit.residuals(again.trial.arm, replace(part, **label)).position_mm
        remaining = np.linalg.norm(left, axis=1)
        costs.append(np.append(0.0, np.minimum(remaining, _CAP * again.trial.sigma_mm)))
    first = int(np.argmin(np.cumsum(costs[0]) - np.cumsum(costs[1])))
    sides = part.pose[:first], part.pose[first:]
    if min(len(np.unique(side)) for side in sides) < _FEWEST:
        return np.inf, again
    if both[first] != row:
        observed, rows = parted(fitted.readings, both[first], kind)
        again = fit(observed, fitted.trial.arm.nominal)
    before, after = (np.minimum(e.left_mm, _CAP * fitted.trial.sigma_mm) for e in (fitted, again))
    near = rows[:_NEAR]
    everywhere, there = after.mean() / before.mean(), after[near].mean() / before[near].mean()
    return min(everywhere / _BETTER, max(there / _BETTER_THERE, everywhere)), again


def _findings(whole: Fitted, fitted: Fitted) -> Iterator[Finding]:
    """Jumps of base and targets; a drift in place of the jumps of a base that drifts."""
    observed, frames = fitted.readings, fitted.trial.arm.frames
    drifts = _drifts_mm(whole, fitted)
    for kind, poses in (("session", frames.bases), ("target", frames.targets)):
        is_base = kind == "session"
        label, names = getattr(observed, kind), getattr(observed, f"{kind}_names")
        for name in dict.fromkeys(names):
            mine = np.flatnonzero(np.array(names)[label] == name)
            if is_base and name in drifts:
                by, drift_mm = _signed(drifts[name]), drifts[name].tolist()
                yield finding("drift", observed.line[mine], by=by, drift_mm=drift_mm)
                continue
            known = np.diff(getattr(whole.readings, kind)[mine]) != 0
            for place in np.flatnonzero((np.diff(label[mine]) != 0) & ~known):
                rows, first = mine[place + 1 :], int(observed.line[mine[place + 1]])
                old, new = label[mine[place]], label[rows[0]]
                shift = poses.position_mm[new] - poses.position_mm[old]
                turn = poses.rotation[new] @ poses.rotation[old].T
                if is_base:
                    # How far points in the middle of the readings went.
                    middle = fitted.residuals.predicted.position_mm[rows].mean(axis=0)
                    arm = middle - poses.position_mm[new]
                    shift = shift + arm - turn.T @ arm
                yield finding(
                    "base_jump" if is_base else "target_moved",
                    observed.lines(rows),
                    row=observed.row_names.one(first),
                    target=str(name or ""),
                    by=_signed(shift),
                    first_line=first,
                    shift_mm=shift.tolist(),
                    turn_mrad=1e3 * float(np.linalg.norm(log_so3(turn))) * is_base,
                )


def _signed(vector: ndarray) -> str:
    return ", ".join(f"{value:+.3g}" for value in vector)


def _drifts_mm(whole: Fitted, split: Fitted) -> dict[str | None, ndarray]:
    """How far the base of each session that drifted did so (3,), mm.

    It drifts where a steady motion explains as much of what the fit without jumps leaves as the
    jumps that were found, whose places are chosen.
    """
    few, design, residual, linear = _linearised(whole)
    drifts: dict[str | None, ndarray] = {}
    for base, name in enumerate(few.session_names):
        rows, place = np.flatnonzero(few.session == base), linear.frames.slots[base][2]
        columns, rest = design[rows][:, :, place], (residual[rows], design[rows], linear.inverse)
        part = split.readings.session[whole.chosen[rows]]
        jumps = [columns * (part == item)[:, None, None] for item in np.unique(part)[1:]]
        if jumps:
            time = np.linspace(-0.5, 0.5, len(rows))[:, None, None]
            gains, motion, _ = _gains(columns * time, *rest)
            if gains[0] > _STEADY * _gains(np.concatenate(jumps, axis=2), *rest)[0][0]:
                at_mm = whole.trial.arm.frames.bases.position_mm[base]
                lever = few.position_mm[rows].mean(axis=0) - at_mm
                drifts[name] = -motion[0, :3] - np.cross(motion[0, 3:], lever)
    return drifts

"""What a model is worth: which one to use, where it is biased, the rows it fits worst."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from kinacc.calibration.residuals import Errors

STANDARD_ERRORS = 2.0  # by which a gain must exceed zero
REGIONS = 6  # of equal width in every joint's measured range
WORST = 20


@dataclass(frozen=True)
class Standing:
    """How a model did on held-out rows: position errors, and what it gains on the plainest model.

    ``rms_mm`` over all rows and the mean over folds of theirs, ``folds_mm``; ``gain_mm2``: squared
    error taken off that of the plainest model per configuration, and its standard error.
    """

    rms_mm: float
    folds_mm: float
    gain_mm2: float
    std_error_mm2: float


@dataclass(frozen=True)
class Selection:
    """The model ``selected`` on so many ``configurations`` held out, and how every model did."""

    selected: str
    configurations: int
    standings: dict[str, Standing]


def select(
    held_out: Mapping[str, Errors], configuration: np.ndarray, fold: np.ndarray
) -> Selection:
    """Choose among models by their errors on rows held out of them, the plainest model first.

    Another one is selected where its mean gain exceeds STANDARD_ERRORS standard errors (a one-sided
    paired test over configurations) and its rms over all rows and mean over folds are lower as
    well; of several the one of the lowest rms. ``configuration`` (n,) and ``fold`` (n,) of the
    rows; rows that a model was not tried on are NaN. The plainest is selected where nothing was
    held out.
    """
    squared = {name: np.sum(each.position_mm**2, axis=1) for name, each in held_out.items()}
    plainest = next(iter(squared))
    rows = np.isfinite(list(squared.values())).all(axis=0)
    if not rows.any():
        return Selection(plainest, 0, dict.fromkeys(squared, Standing(*[np.nan] * 4)))
    unit = np.unique(configuration[rows], return_inverse=True)[1]
    numbers, count = np.unique(fold[rows]), unit.max() + 1
    standings = {}
    for name, each in squared.items():
        rms = float(np.sqrt(each[rows].mean()))
        folds = float(np.mean([np.sqrt(each[rows & (fold == k)].mean()) for k in numbers]))
        gain = error = 0.0
        if name != plainest:
            less = np.bincount(unit, (squared[plainest] - each)[rows]) / np.bincount(unit)
            gain = float(less.mean())
            error = float(less.std(ddof=1) / np.sqrt(count)) if count > 1 else np.inf
        standings[name] = Standing(rms, folds, gain, error)
    plain, best = standings[plainest], plainest
    for name, each in standings.items():
        worth = each.gain_mm2 > STANDARD_ERRORS * each.std_error_mm2
        worth = worth and each.rms_mm < plain.rms_mm and each.folds_mm < plain.folds_mm
        if worth and each.rms_mm < standings[best].rms_mm:
            best = name
    return Selection(best, int(count), standings)


def bias(errors: Errors, q_rad: np.ndarray) -> Iterator[tuple]:
    """Errors by region of every joint ``q_rad`` (n, k): where a model leaves something systematic.

    Rows of ``joint_bias``: joint, range in rad, number of rows, mean and its standard error of
    three components and rms of the position error in mm. Regions without a row are left out. The
    standard error takes rows as independent.
    """
    rows = np.isfinite(errors.position_mm).all(axis=1)
    vectors, q_rad = errors.position_mm[rows], q_rad[rows]
    for joint in range(q_rad.shape[1]) if len(q_rad) else ():
        angle = q_rad[:, joint]
        edges = np.linspace(angle.min(), angle.max(), REGIONS + 1)
        region = np.clip(np.searchsorted(edges, angle, side="right") - 1, 0, REGIONS - 1)
        for number in np.unique(region):
            part = vectors[region == number]
            error = np.full(3, np.nan)
            if len(part) > 1:
                error = part.std(axis=0, ddof=1) / np.sqrt(len(part))
            rms = float(np.sqrt(np.mean(np.sum(part**2, axis=1))))
            span = float(edges[number]), float(edges[number + 1])
            yield (joint + 1, *span, len(part), *part.mean(axis=0), *error, rms)


def worst(errors: Errors, count: int = WORST) -> np.ndarray:
    """Indices of the rows with the largest position errors, largest first, ties in file order."""
    size = np.linalg.norm(errors.position_mm, axis=1)
    size = np.where(np.isfinite(size), size, -np.inf)
    order = np.argsort(-size, kind="stable")[:count]
    return order[np.isfinite(size[order])]

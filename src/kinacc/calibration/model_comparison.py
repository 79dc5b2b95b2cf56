"""What a model is worth: which one to use, where it is biased, the rows it fits worst."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kinacc.calibration.residuals import Errors

DH, VEC = "dh", "vec"
STANDARD_ERRORS = 2.0  # by which a gain must exceed zero
REGIONS = 6  # of equal width in every joint's measured range
WORST = 20


@dataclass(frozen=True)
class Gain:
    """Held-out squared position error that VEC takes off DH, per configuration, in mm^2.

    ``selected`` is VEC where the mean exceeds STANDARD_ERRORS standard errors (a one-sided paired
    test over ``configurations``) and its rms over all rows and mean over folds are lower as well.
    """

    configurations: int
    mean_mm2: float
    std_error_mm2: float
    rms_mm: dict[str, float]
    folds_mm: dict[str, float]
    selected: str


def gain(by_dh: Errors, by_vec: Errors, configuration: np.ndarray, fold: np.ndarray) -> Gain:
    """Compare both models on rows held out of them; rows that neither was tried on are NaN.

    ``configuration`` (n,) and ``fold`` (n,) of the rows. DH is selected where nothing was held out.
    """
    squared = {
        DH: np.sum(by_dh.position_mm**2, axis=1),
        VEC: np.sum(by_vec.position_mm**2, axis=1),
    }
    rows = np.isfinite(squared[DH]) & np.isfinite(squared[VEC])
    if not rows.any():
        nothing = {DH: np.nan, VEC: np.nan}
        return Gain(0, np.nan, np.nan, nothing, nothing, DH)
    unit = np.unique(configuration[rows], return_inverse=True)[1]
    less = np.bincount(unit, (squared[DH] - squared[VEC])[rows]) / np.bincount(unit)
    count = less.size
    error = float(less.std(ddof=1) / np.sqrt(count)) if count > 1 else np.inf
    rms = {name: float(np.sqrt(each[rows].mean())) for name, each in squared.items()}
    numbers = np.unique(fold[rows])
    folds = {
        name: float(np.mean([np.sqrt(each[rows & (fold == k)].mean()) for k in numbers]))
        for name, each in squared.items()
    }
    better = less.mean() > STANDARD_ERRORS * error
    better = better and rms[VEC] < rms[DH] and folds[VEC] < folds[DH]
    return Gain(count, float(less.mean()), error, rms, folds, VEC if better else DH)


@dataclass(frozen=True)
class Bias:
    """Errors in one region of one joint (0-based): mean (3,), its standard error (3,), rms, mm."""

    joint: int
    low_rad: float
    high_rad: float
    n: int
    mean_mm: np.ndarray
    std_error_mm: np.ndarray
    rms_mm: float


def bias(errors: Errors, q_rad: np.ndarray) -> Iterator[Bias]:
    """Errors by region of every joint ``q_rad`` (n, k): where a model leaves something systematic.

    Regions without a row are left out. The standard error takes rows as independent.
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
            yield Bias(joint, *span, len(part), part.mean(axis=0), error, rms)


def worst(errors: Errors, count: int = WORST) -> np.ndarray:
    """Indices of the rows with the largest position errors, largest first, ties in file order."""
    size = np.linalg.norm(errors.position_mm, axis=1)
    size = np.where(np.isfinite(size), size, -np.inf)
    order = np.argsort(-size, kind="stable")[:count]
    return order[np.isfinite(size[order])]

"""Cross-validation folds by configuration: what belongs together is held out together."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping

import numpy as np
import pandas as pd
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from kinacc.config.records import Settings
from kinacc.measurements.reader import UNCERTAINTY
from kinacc.tables.columns import Columns

TIME_BLOCK = "time_block"
LEAST_ROWS = 3  # that place a base or a target
SAME_CONFIGURATION_RAD = np.deg2rad(0.1)  # joints this close are one configuration visited again


def configurations_of(columns: Columns) -> np.ndarray:
    """Number (n,) of every measured row's configuration, see :func:`configurations`."""
    names = [name for name in columns if name[:1] == "q" and name[1:].isdigit()]
    q_rad = np.stack([np.asarray(columns[name], dtype=float) for name in names], axis=1)
    return configurations(np.asarray(columns["pose"]), q_rad)


def configurations(
    pose: np.ndarray, q_rad: np.ndarray, tolerance_rad: float = SAME_CONFIGURATION_RAD
) -> np.ndarray:
    """Configuration number (n,) of every row, counted in order of first appearance.

    Rows of one ``pose`` (n,) share a configuration (its targets and repeats), and so do poses whose
    joints (n, k) agree within ``tolerance_rad`` in every joint, full turns apart (revisits). The
    relation is closed under chaining: no two configurations hold rows within the tolerance.
    """
    turn, count = np.full(q_rad.shape[1], 2.0 * np.pi), len(pose)
    tree = cKDTree(np.mod(q_rad, turn) % turn, boxsize=turn)
    pairs = tree.query_pairs(tolerance_rad, p=np.inf, output_type="ndarray")
    _, first, rank = np.unique(pose, return_index=True, return_inverse=True)
    links = np.concatenate([pairs, np.stack([np.arange(count), first[rank]], axis=1)])
    joined = coo_array((np.ones(len(links)), links.T), shape=(count, count))
    return pd.factorize(connected_components(joined, directed=False)[1])[0]


def assign(configuration: np.ndarray, folds: int, seed: int) -> np.ndarray:
    """Fold (n,) in which each row is held out: whole configurations, sizes as even as they allow.

    Configurations are shuffled by ``seed``, then dealt largest first to the smallest fold. With
    fewer configurations than ``folds`` some folds stay empty.
    """
    labels, inverse, sizes = np.unique(configuration, return_inverse=True, return_counts=True)
    order = np.random.default_rng(seed).permutation(len(labels))
    order = order[np.argsort(-sizes[order], kind="stable")]
    filled = np.zeros(folds, dtype=np.int64)
    fold_of = np.empty(len(labels), dtype=np.int64)
    for label in order:
        fold_of[label] = int(np.argmin(filled))
        filled[fold_of[label]] += sizes[label]
    return fold_of[inverse]


def blocks(configuration: np.ndarray, folds: int) -> np.ndarray:
    """Fold (n,) of each row by blocks of time: rows are in the order they were measured.

    Whole configurations in the order of their first rows, cut into ``folds`` runs of sizes as even
    as they allow; a configuration that is visited again stays in the block of its first visit.
    """
    number = pd.factorize(configuration)[0]
    sizes = np.bincount(number)
    middle = np.cumsum(sizes) - 0.5 * sizes
    fold_of = np.minimum((middle * folds / len(configuration)).astype(np.int64), folds - 1)
    return fold_of[number]


def always_trained(
    fold: np.ndarray, labels: Mapping[str, np.ndarray], configuration: np.ndarray
) -> Iterator[tuple[str, str, np.ndarray]]:
    """Kind and value of labels (by kind, each (n,)) that no fold (n,) may hold out, and rows (n,).

    A fold that leaves fewer than ``LEAST_ROWS`` rows of a session or target leaves nothing to place
    it by: all rows of its configurations (n,) train. Where all rows have one label it is not asked.
    """
    for kind, label in labels.items():
        table = pd.crosstab(pd.Series(label).map(str), fold)  # None is a label as well
        # Too few rows outside one of its folds.
        scarce = (table.gt(0) & table.rsub(table.sum(axis=1), axis=0).lt(LEAST_ROWS)).any(axis=1)
        for name in table.index[scarce] if len(table) > 1 else ():
            of_label = configuration[np.asarray(label).astype(str) == name]
            yield kind, name, np.isin(configuration, of_label)


def split(columns: Columns, settings: Settings) -> Columns:
    """The columns with ``fold`` and ``subset``: whole configurations held out together.

    ``settings``: seed and the ``measurements`` section. Fold null without folds, and for the
    configurations of a session or target that could not be placed without them (with a warning
    that names these); the rows of the validation fold are the validation subset.
    """
    section = settings["measurements"]
    count, folds = len(columns["pose"]), section["folds"]
    fold = np.full(count, np.nan)
    if folds is not None:
        same, in_time = configurations_of(columns), section["fold_by"] == TIME_BLOCK
        number = blocks(same, folds) if in_time else assign(same, folds, settings["seed"])
        fold = number.astype(float)
        labels = {kind: columns[kind] for kind in sorted({*columns} & {"session", "target"})}
        for kind, value, rows in [*always_trained(fold, labels, same)]:
            fold[rows] = np.nan
            warnings.warn(
                f"{kind} {value} has fewer than {LEAST_ROWS} rows outside one of its folds: "
                f"its {int(rows.sum())} rows always train and have no held-out error",
                stacklevel=2,
            )
    held_out = fold == (-1 if section["validation_fold"] is None else section["validation_fold"])
    subset = np.where(held_out, "validation", "train").astype(object)
    # What a source of measurements need not state is null.
    null = {name: np.full(count, np.nan) for name in ("row", "temperature_c", *UNCERTAINTY)}
    null["session"] = np.full(count, None, dtype=object)
    return {**null, **columns, "subset": subset, "fold": fold}

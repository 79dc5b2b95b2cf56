"""Rows of one pose: the column that names their targets, and names that count readings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from kinacc.errors import input_error
from kinacc.measurements.column_names import WORDS, name_of
from kinacc.measurements.intake.columns import NamedColumns, names_in
from kinacc.measurements.intake.groups import keep_distances
from kinacc.measurements.joining import AGAIN
from kinacc.measurements.table import RawTable

_APART_MM = 5.0  # readings of one target of a pose lie nearer to one another
_STILL_RAD = 5e-4
_MOST_TARGETS = 24
_SAME_RADIUS = 0.05  # of the largest: radii that were measured scatter
_ALLOWED = "a column target that names the reflector of every row"


def with_targets(
    table: RawTable, columns: NamedColumns, q_rad: np.ndarray, point_mm: np.ndarray
) -> NamedColumns:
    """The columns with that of the targets, where rows of one pose need one.

    ``q_rad`` (n, k), ``point_mm`` (n, 3). Raises InputError where rows are of several targets and
    no column names them.
    """
    if len(columns.targets) != 1:
        return columns
    keys = pd.DataFrame(np.round(q_rad / _STILL_RAD))
    if "session" in columns.single:
        keys["session"] = table.texts(columns.single["session"].column)
    pose = keys.groupby([*keys.columns], sort=False).ngroup().fillna(-1).to_numpy(int)
    target, names = columns.single.get("target"), list[str]()
    radius = next((n.column for n in names_in(table) if WORDS["radius"] & {*n.terms}), "")
    size = np.nan_to_num(table.values(radius)) if radius else np.zeros(len(table))
    if np.ptp(size) > _SAME_RADIUS * np.max(size):
        # A reflector of another radius has its centre elsewhere in the same nest.
        if target:
            wrong = pd.Series(size).groupby(table.texts(target.column)).nunique().max() > 1
        else:
            of_radius = np.where(pose < 0, -1, pd.factorize(size)[0] * len(pose) + pose)
            wrong = _are_apart(point_mm, of_radius) or len({*size}) > _MOST_TARGETS
        if wrong:
            message = "the radius of the reflectors changes, so that their centres lie elsewhere"
            raise input_error(table.where(radius), message, _ALLOWED)
        names = [radius]
    elif not target and _are_apart(point_mm, pose):
        ways: dict[tuple[int, ...], str] = {}
        for column in (name for name in table.columns if name not in columns.read()):
            labels = np.array(table.texts(column), dtype=object)
            if _names_targets(labels, point_mm, pose):
                ways.setdefault(tuple(pd.factorize(labels)[0]), column)
        names = [*ways.values()]
        if len(names) != 1:
            known = f"{' and '.join(names)} may name" if names else "no column names"
            message = f"rows of equal joints lie over {_APART_MM:g} mm apart, {known} their target"
            raise input_error(table.path, message, _ALLOWED, "a column session names set-ups")
    if target or not names:
        return columns
    return replace(columns, single=columns.single | {"target": name_of(names[0])})


def _spans(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Largest extent along an axis of ``values`` (n, k) in every group of several rows."""
    frame = pd.DataFrame(values[group >= 0]).groupby(group[group >= 0])
    return (frame.max() - frame.min()).max(axis=1)[frame.size() > 1].dropna().to_numpy()


def _are_apart(point_mm: np.ndarray, group: np.ndarray) -> bool:
    """Whether rows of a group are, as a rule, far from one another."""
    spans = _spans(point_mm, group)
    return bool(spans.size) and float(np.median(spans)) > _APART_MM


def _names_targets(labels: np.ndarray, point_mm: np.ndarray, pose: np.ndarray) -> bool:
    """Whether labels stand for points of one body, each read about once in most poses."""
    if not 2 <= len({*labels}) <= _MOST_TARGETS:
        return False
    rows = pose >= 0
    by_label = pd.DataFrame(point_mm[rows]).groupby([pose[rows], labels[rows]])
    if (by_label.max() - by_label.min()).max().max() > _APART_MM:
        return False
    first = by_label.first().unstack()
    return keep_distances(
        [first.xs(label, axis=1, level=1).to_numpy() for label in {*labels[rows]}]
    )


def counts_readings(table: RawTable, columns: NamedColumns, q_rad: np.ndarray) -> bool:
    """Whether numbers behind the names of poses count readings of them: P12_1, P12_2.

    Readings that came from other directions stay poses of their own: as repeats they would scatter
    by the arm's backlash.
    """
    names = table.texts(columns.single["pose"].column) if "pose" in columns.single else []
    poses = [AGAIN.sub("", name) for name in names]
    if any(a == b for a, b in zip(names, poses, strict=True)):
        return False
    if any(WORDS["approach"] & {*name_of(column).terms} for column in table.columns):
        return False
    spans = _spans(q_rad, pd.factorize(np.array(poses, dtype=object))[0])
    return bool(spans.size) and float(spans.max()) < _STILL_RAD

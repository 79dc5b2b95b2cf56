"""Jacobians of a few motions, each spread over many parameters by functions of the pose.

A VEC coefficient moves the arm as the error it belongs to does, times a Chebyshev polynomial of
one joint. Normal equations follow from the motions and the polynomials without the Jacobian in the
parameters ever being formed: a sixth of the work, and no memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Group:
    """Motions ``columns`` of a Jacobian, each spread over the T functions ``basis`` (n, T).

    Parameters follow motion by motion, function by function. ``basis`` None: the motions are
    parameters themselves.
    """

    columns: slice
    basis: np.ndarray | None

    @property
    def motions(self) -> int:
        """Number of motions."""
        return self.columns.stop - self.columns.start

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.motions * (1 if self.basis is None else self.basis.shape[1])


def spread(columns: np.ndarray, groups: Sequence[Group]) -> np.ndarray:
    """Jacobian (n, m, P) in the parameters, from the motions ``columns`` (n, m, E)."""
    if all(group.basis is None for group in groups):
        return columns
    count, rows = columns.shape[:2]
    full = np.empty((count, rows, sum(group.size for group in groups)))
    begin = 0
    for group in groups:
        part = columns[:, :, group.columns]
        into = full[:, :, begin : begin + group.size]
        if group.basis is None:
            into[:] = part
        else:
            shaped = into.reshape(count, rows, group.motions, -1)
            np.multiply(part[..., None], group.basis[:, None, None, :], out=shaped)
        begin += group.size
    return full


def applied(columns: np.ndarray, groups: Sequence[Group], vectors: np.ndarray) -> np.ndarray:
    """The spread Jacobian of ``columns`` (n, m, E) times ``vectors`` (P, c): (n, m, c)."""
    moved, begin = np.empty((len(columns), columns.shape[2], vectors.shape[1])), 0
    for group in groups:
        own = vectors[begin : begin + group.size]
        begin += group.size
        if group.basis is not None:
            by_function = own.reshape(group.motions, -1, own.shape[1]).swapaxes(0, 1)
            own = group.basis @ by_function.reshape(group.basis.shape[1], -1)
            own = own.reshape(len(columns), group.motions, -1)
        moved[:, group.columns] = own
    return columns @ moved


def gram(columns: np.ndarray, groups: Sequence[Group]) -> np.ndarray:
    """Gram matrix (P, P) of the spread Jacobian of ``columns`` (n, m, E), summed over n and m."""
    products = np.swapaxes(columns, 1, 2) @ columns  # (n, E, E)
    ends = np.cumsum([group.size for group in groups])
    result = np.empty((ends[-1], ends[-1]))
    for i, first in enumerate(groups):
        rows = slice(ends[i] - first.size, ends[i])
        for second, end in zip(groups[: i + 1], ends, strict=False):
            block = _block(products[:, first.columns, second.columns], first.basis, second.basis)
            result[rows, end - second.size : end] = block
            result[end - second.size : end, rows] = block.T
    return result


def _block(products: np.ndarray, first: np.ndarray | None, second: np.ndarray | None) -> np.ndarray:
    count, rows, columns = products.shape
    ones = np.ones((count, 1))
    first = ones if first is None else first
    second = ones if second is None else second
    both = (first[:, :, None] * second[:, None, :]).reshape(count, -1)
    # A GEMM over the poses: every pair of motions against every pair of functions.
    block = products.reshape(count, -1).T @ both
    block = block.reshape(rows, columns, first.shape[1], second.shape[1]).transpose(0, 2, 1, 3)
    return block.reshape(rows * first.shape[1], columns * second.shape[1])


def spread_rows(columns: np.ndarray, groups: Sequence[Group]) -> np.ndarray:
    """As ``spread``, observations last: (P, m, n) from the motions ``columns`` (E, m, n)."""
    if all(group.basis is None for group in groups):
        return columns
    full = np.empty((sum(group.size for group in groups), *columns.shape[1:]))
    begin = 0
    for group in groups:
        part, into = columns[group.columns], full[begin : begin + group.size]
        begin += group.size
        if group.basis is None:
            into[:] = part
        else:
            shaped = into.reshape(group.motions, -1, *columns.shape[1:])
            np.multiply(part[:, None], np.ascontiguousarray(group.basis.T)[:, None], out=shaped)
    return full


def summed(values: np.ndarray, groups: Sequence[Group]) -> np.ndarray:
    """Sums (P,) over observations of ``values`` (E, n) of motions, spread as these are."""
    parts = [
        part.sum(axis=1) if group.basis is None else (part @ group.basis).ravel()
        for group, part in ((each, values[each.columns]) for each in groups)
    ]
    return np.concatenate(parts)

"""Observability indices of a set of poses, from the singular values of its identification Jacobian.

O1: geometric mean of the singular values over the root of the number of poses (Borm and Menq,
Int. J. Robotics Research 10, 1991); its maximum is the D-optimal set. O2: inverse condition number
(Driels and Pathre, J. Robotic Systems 7, 1990). O3: least singular value (Nahvi, Hollerbach and
Hayward, ICRA 1994), the E-optimal set. O4: square of the least over the largest, noise
amplification (Nahvi and Hollerbach, ICRA 1996). O5: inverse of the sum of inverses, after
A-optimality (Sun and Hollerbach, ICRA 2008). Compared by Joubair and Bonev, Precision Engineering
37 (2013) 698.
"""

from __future__ import annotations

import numpy as np

INDICES = {
    "O1": "geometric mean of the singular values over the root of the number of poses",
    "O2": "least singular value over the largest",
    "O3": "least singular value",
    "O4": "square of the least singular value over the largest",
    "O5": "inverse of the sum of the inverse singular values",
}
_TINY = 1e-300
_TIE = 1e-6  # of the log determinant and of an index: what is less may be rounding
_SUBSPACE = 6  # weakest directions the bounds look at


def of_values(index: str, squares: np.ndarray, poses: int) -> np.ndarray:
    """Index (...) of ``squares`` (..., r), rising eigenvalues of the normal matrix of ``poses``."""
    squares = np.maximum(squares, 0.0)
    least, largest = np.sqrt(squares[..., 0]), np.sqrt(squares[..., -1])
    if index == "O1":
        mean = np.mean(np.log(np.maximum(squares, _TINY)), axis=-1)
        return np.where(squares[..., 0] > 0.0, np.exp(0.5 * mean), 0.0) / np.sqrt(poses)
    if index == "O2":
        return least / np.maximum(largest, _TINY)
    if index == "O3":
        return least
    if index == "O4":
        return least**2 / np.maximum(largest, _TINY)
    return 1.0 / np.sum(1.0 / np.sqrt(np.maximum(squares, _TINY)), axis=-1)


def of_poses(index: str, rows: np.ndarray, chosen: np.ndarray) -> float:
    """Index of the poses ``chosen`` (N,) among candidates with ``rows`` (n, m, r)."""
    flat = rows[chosen].reshape(-1, rows.shape[-1])
    values = np.linalg.svd(flat, compute_uv=False)
    if len(values) < rows.shape[-1]:
        return 0.0
    return float(of_values(index, values[::-1] ** 2, len(chosen)))


def best_addition(
    index: str, normal: np.ndarray, rows: np.ndarray, free: np.ndarray, poses: int
) -> tuple[int, float]:
    """The candidate of ``free`` whose pose makes ``normal`` (r, r) best, and the index it gives.

    Exact for every index: O1 by the determinant lemma; the others by an upper bound for every
    candidate, evaluated from the most promising one until no bound is above the best found. The
    lowest number wins a tie.
    """
    if index == "O1":
        gains = _log_gains(normal, rows[free])
        place = int(np.argmax(gains >= gains.max() - _TIE))
        _, log_determinant = np.linalg.slogdet(normal)
        mean = (log_determinant + gains[place]) / len(normal)
        return int(free[place]), float(np.exp(0.5 * mean) / np.sqrt(poses))
    bounds = _bounds(index, normal, rows[free], poses)
    order = np.argsort(-bounds, kind="stable")
    best, value, chunk = -1, -np.inf, 16
    for begin in range(0, len(order), chunk):
        part = order[begin : begin + chunk]
        if bounds[part[0]] < value:
            break
        added = rows[free[part]]
        squares = np.linalg.eigvalsh(normal + np.swapaxes(added, 1, 2) @ added)
        found = of_values(index, squares, poses)
        top = float(found.max())
        number = int(free[part[found >= top * (1.0 - _TIE)]].min())
        if top > value * (1.0 + _TIE) or best < 0:
            best, value = number, top
    return best, value


def _log_gains(normal: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Growth (n,) of the log determinant of ``normal`` by the rows (n, m, r) of a pose each."""
    inverse = np.linalg.inv(normal)
    inside = rows @ inverse @ np.swapaxes(rows, 1, 2)
    return np.linalg.slogdet(np.eye(rows.shape[1]) + inside)[1]


def _bounds(index: str, normal: np.ndarray, rows: np.ndarray, poses: int) -> np.ndarray:
    """Upper bounds (n,) of the index with one more pose each."""
    squares, vectors = np.linalg.eigh(normal)
    if index == "O5":
        # The sum of inverse roots is convex in the matrix: its tangent lies below it.
        slope = (vectors * -0.5 * np.maximum(squares, _TINY) ** -1.5) @ vectors.T
        drop = np.einsum("nmi,ij,nmj->n", rows, slope, rows)
        sums = np.sum(np.maximum(squares, _TINY) ** -0.5) + drop
        largest = 1.0 / np.maximum(sums, _TINY)
        return np.maximum(largest, 0.0)
    # Interlacing: the least eigenvalue of the whole is at most that within any subspace.
    weak = vectors[:, : min(_SUBSPACE, len(normal))]
    seen = rows @ weak
    inside = np.swapaxes(seen, 1, 2) @ seen + weak.T @ normal @ weak
    least = np.maximum(np.linalg.eigvalsh(inside)[:, 0], 0.0)
    largest = squares[-1]  # grows with every pose
    pair = np.stack([least, np.maximum(np.full(len(rows), largest), least)], axis=1)
    return of_values(index, pair, poses) * (1.0 + 1e-9)

"""Geometry, models and fits in 60 digits: second derivations that hold 50, by the paper's formulas.

Numbers are ``decimal.Decimal`` in numpy arrays of objects, which Python's own decimal arithmetic
adds and multiplies; sines, logarithms and the like are mpmath's. A float is taken for exactly what
its bits say. Lengths are in mm, angles in rad. Everything here runs within ``working()``.
"""

from __future__ import annotations

import decimal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from decimal import Decimal

import mpmath
import numpy as np

DIGITS = 60  # of every operation, so that 50 are left after thousands of them
NOTHING = Decimal(10) ** -DIGITS
Matrix = np.ndarray  # of Decimals


@contextmanager
def working() -> Iterator[None]:
    """Both libraries at DIGITS."""
    with decimal.localcontext(decimal.Context(prec=DIGITS)), mpmath.workdps(DIGITS):
        yield


def exact(values) -> Matrix:
    """Floats, or nested lists of them, as Decimals of the same value."""
    taken = np.asarray(values, dtype=object)
    return np.vectorize(Decimal, otypes=[object])(taken) if taken.size else taken


def mp(value: Decimal | float) -> mpmath.mpf:
    return mpmath.mpf(str(value)) if isinstance(value, Decimal) else mpmath.mpf(value)


def dec(value: mpmath.mpf) -> Decimal:
    return Decimal(mpmath.nstr(value, DIGITS))


def cos_sin(angle: Decimal) -> tuple[Decimal, Decimal]:
    cosine, sine = mpmath.cos_sin(mp(angle))
    return dec(cosine), dec(sine)


def size(vector: Sequence[Decimal]) -> Decimal:
    return sum((x * x for x in vector), Decimal(0)).sqrt()


def eye(n: int) -> Matrix:
    return exact(np.eye(n))


def zeros(*shape: int) -> Matrix:
    return np.full(shape, Decimal(0), dtype=object)


def cross(v: Sequence[Decimal]) -> Matrix:
    """The matrix that crosses with v."""
    x, y, z = v
    o = Decimal(0)
    return np.array([[o, -z, y], [z, o, -x], [-y, x, o]], dtype=object)


# --- linear equations -----------------------------------------------------------------------------


def cholesky(a: Matrix) -> Matrix:
    lower = zeros(*a.shape)
    for j in range(len(a)):
        row = lower[j, :j]
        lower[j, j] = (a[j, j] - (row @ row if j else 0)).sqrt()
        if j + 1 < len(a):
            below = a[j + 1 :, j] - (lower[j + 1 :, :j] @ row if j else 0)
            lower[j + 1 :, j] = below / lower[j, j]
    return lower


def inverse(a: Matrix) -> Matrix:
    """Of a symmetric positive definite matrix."""
    lower = cholesky(a)
    n = len(a)
    half = zeros(n, n)
    for j in range(n):
        half[j, j] = 1 / lower[j, j]
        for i in range(j + 1, n):
            half[i, j] = -(lower[i, j:i] @ half[j:i, j]) / lower[i, i]
    return half.T @ half


def eigen(a: Matrix) -> tuple[Matrix, Matrix]:
    """Eigenvalues, falling, and vectors (columns) of a symmetric matrix."""
    values, vectors = mpmath.eigsy(mpmath.matrix(np.vectorize(mp, otypes=[object])(a).tolist()))
    taken = np.vectorize(dec, otypes=[object])
    return taken(list(values))[::-1], taken(vectors.tolist())[:, ::-1]


# --- rotations and frames -------------------------------------------------------------------------


def frame(rotation: Matrix, position: Matrix) -> Matrix:
    found = eye(4)
    found[:3, :3], found[:3, 3] = rotation, position
    return found


def pose_frame(x: float, y: float, z: float, wxyz: Sequence[float]) -> Matrix:
    """Of a position and a quaternion, which is taken to unit length."""
    quaternion = exact(wxyz)
    w, *rest = quaternion / size(quaternion)
    turn = cross(rest)
    return frame(eye(3) + 2 * w * turn + 2 * (turn @ turn), exact([x, y, z]))


def undone(at: Matrix) -> Matrix:
    """The inverse of a rigid motion."""
    return frame(at[:3, :3].T, -(at[:3, :3].T @ at[:3, 3]))


def rotation_vector(rotation: Matrix) -> Matrix:
    """Of a turn by less than half a circle."""
    skew = (rotation - rotation.T) / 2
    axis = np.array([skew[2, 1], skew[0, 2], skew[1, 0]], dtype=object)
    sine, cosine = size(axis), (np.trace(rotation) - 1) / 2
    return axis * (dec(mpmath.atan2(mp(sine), mp(cosine))) / sine) if sine else axis


def turned_by(vector: Matrix) -> Matrix:
    """The rotation of a rotation vector."""
    angle = size(vector)
    if not angle:
        return eye(3)
    cosine, sine = cos_sin(angle)
    turn = cross(vector / angle)
    return eye(3) + sine * turn + (1 - cosine) * (turn @ turn)


def inverse_left_jacobian(vector: Matrix) -> Matrix:
    """How a rotation vector follows a small turn from the left."""
    angle, turn = size(vector), cross(vector)
    if not angle:
        return eye(3)
    cosine, sine = cos_sin(angle)
    return eye(3) - turn / 2 + turn @ turn * (1 / angle**2 - (1 + cosine) / (2 * angle * sine))


def nearest_rotation(matrix: Matrix) -> tuple[Matrix, Matrix]:
    """R and S with ``matrix`` = R S, S symmetric: R is the rotation closest to it."""
    at = matrix
    for _ in range(12):
        a, b, c = at.T
        adjugate = np.array([cross(b) @ c, cross(c) @ a, cross(a) @ b], dtype=object)
        after = (at + adjugate.T / (a @ (cross(b) @ c))) / 2
        done = max(abs(x) for x in (after - at).ravel()) < Decimal(10) ** (5 - DIGITS)
        at = after
        if done:
            break
    return at, at.T @ matrix


# --- the models (eqs. 3 to 6) ---------------------------------------------------------------------

DH_MOVES = ("theta", "d", "a", "alpha", "beta")


def dh_parts(row: Sequence[Decimal], q: Decimal) -> list[tuple[str, int, Matrix]]:
    """Rz(q + theta) Tz(d) Tx(a) Rx(alpha) Ry(beta): each turn or shift, its axis, its matrix."""
    theta, d, a, alpha, beta = row
    parts = []
    turns = (("turn", 2, q + theta), ("shift", 2, d), ("shift", 0, a))
    for kind, axis, amount in (*turns, ("turn", 0, alpha), ("turn", 1, beta)):
        along = zeros(3)
        along[axis] = Decimal(1)
        if kind == "shift":
            parts.append((kind, axis, frame(eye(3), along * amount)))
        else:
            parts.append((kind, axis, frame(turned_by(along * amount), zeros(3))))
    return parts


def dh_link(row: Sequence[Decimal], q: Decimal) -> Matrix:
    found = eye(4)
    for _, _, part in dh_parts(row, q):
        found = found @ part
    return found


def dh_forward(table: Matrix, q: Sequence[Decimal]) -> Matrix:
    found = eye(4)
    for row, angle in zip(table, q, strict=True):
        found = found @ dh_link(row, angle)
    return found


def dh_motions(table: Matrix, q: Sequence[Decimal]) -> tuple[Matrix, Matrix]:
    """The flange, and (6, 5 k) how each DH parameter moves it: shift, then turn, in the base."""
    at, begun = eye(4), []
    for row, angle in zip(table, q, strict=True):
        for kind, axis, part in dh_parts(row, angle):
            begun.append((kind, at[:3, axis], at[:3, 3]))
            at = at @ part
    columns = []
    for kind, axis, origin in begun:
        if kind == "shift":
            columns.append(np.concatenate([axis, zeros(3)]))
        else:
            columns.append(np.concatenate([cross(axis) @ (at[:3, 3] - origin), axis]))
    return at, np.array(columns, dtype=object).T


def chebyshev(order: int, u: Decimal) -> Matrix:
    """T_0 .. T_order at u."""
    found = [Decimal(1), u]
    while len(found) <= order:
        found.append(2 * u * found[-1] - found[-2])
    return np.array(found[: order + 1], dtype=object)


def vec_motions(
    table: Matrix, series: Matrix, low: Matrix, high: Matrix, q: Sequence[Decimal]
) -> tuple[Matrix, Matrix]:
    """The flange by eqs. 5 and 6, its rotation the nearest true one; how it moves (6, P) with every
    coefficient of ``series`` (k, 6, order + 1)."""
    bases = [
        chebyshev(series.shape[2] - 1, (2 * angle - a - b) / (b - a))
        for angle, a, b in zip(q, low, high, strict=True)
    ]
    links = []
    for row, each, basis, angle in zip(table, series, bases, q, strict=True):
        error = each @ basis
        links.append((frame(eye(3) + cross(error[3:]), error[:3]), dh_link(row, angle)))
    before, after = [eye(4)], [eye(4)]
    for error, link in links:
        before.append(before[-1] @ error @ link)
    for error, link in reversed(links):
        after.append(error @ link @ after[-1])
    whole = before[-1]
    rotation, stretch = nearest_rotation(whole[:3, :3])
    follow = inverse(np.trace(stretch) * eye(3) - stretch)
    columns = []
    for i, (_, link) in enumerate(links):
        rest = link @ after[len(links) - 1 - i]
        for axis in range(6):
            unit = zeros(3)
            unit[axis % 3] = Decimal(1)
            if axis < 3:  # a shift moves the origin alone
                shift, turn = before[i][:3, :3] @ unit, zeros(3)
            else:
                changed = before[i][:3, :3] @ cross(unit) @ rest[:3]
                shift = changed[:, 3]
                skew = rotation.T @ changed[:, :3]
                skew = skew - skew.T
                own = follow @ np.array([skew[2, 1], skew[0, 2], skew[1, 0]], dtype=object)
                turn = rotation @ own
            columns += [np.concatenate([shift, turn]) * term for term in bases[i]]
    return frame(rotation, whole[:3, 3]), np.array(columns, dtype=object).T


# --- fits -----------------------------------------------------------------------------------------


def settled(step: Callable[[Matrix], Matrix], at: Matrix, close: Decimal) -> Matrix:
    """Where ``step`` (P,) leads nowhere any more, by Anderson's acceleration of ``at`` + step."""
    places, steps = [at], [step(at)]
    while max(abs(x) for x in steps[-1]) > close:
        last = steps[-1]
        after = places[-1] + last
        if len(steps) > 1:
            turned = np.array([last - each for each in steps[:-1]], dtype=object)
            moved = np.array([places[-1] - each for each in places[:-1]], dtype=object)
            after = after - inverse(turned @ turned.T) @ (turned @ last) @ (moved + turned)
        assert len(steps) < 40, "the fit in 50 digits does not converge"
        places.append(after)
        steps.append(step(after))
    return places[-1] + steps[-1]


def residual(model: Matrix, seen: Matrix, weight: Decimal) -> tuple[Matrix, Matrix]:
    """Model minus measurement of one pose: mm, and the rotation vector times ``weight``; and the
    matrix (6, 6) that takes a motion of the model to its change."""
    vector = rotation_vector(model[:3, :3] @ seen[:3, :3].T)
    taking = zeros(6, 6)
    taking[:3, :3], taking[3:, 3:] = eye(3), weight * inverse_left_jacobian(vector)
    return np.concatenate([model[:3, 3] - seen[:3, 3], weight * vector]), taking


def truncated(jacobian: Matrix, threshold: float) -> tuple[Matrix, Matrix, Matrix]:
    """Singular values, kept directions (columns) and lost ones: below a share of the largest."""
    values, vectors = eigen(jacobian.T @ jacobian)
    values = np.array([max(value, Decimal(0)).sqrt() for value in values], dtype=object)
    kept = sum(1 for value in values if value >= Decimal(threshold) * values[0])
    return values, vectors[:, :kept], vectors[:, kept:]


def two_variances(r: Matrix, j: Matrix, root: Matrix) -> tuple[Decimal, Decimal]:
    """Of position and of rotation residuals: those whose expected sums of squares are those seen.

    ``root`` root' inverts j'j on the fitted directions."""
    turned = np.tile([False] * 3 + [True] * 3, len(r) // 6)
    parts = [(j[kind] @ root).T @ (j[kind] @ root) for kind in (~turned, turned)]
    a, b, c, d = ((parts[i] * parts[k].T).sum() for i in range(2) for k in range(2))
    half = len(r) // 2
    a += half - 2 * np.trace(parts[0])
    d += half - 2 * np.trace(parts[1])
    one, other = (r[~turned] ** 2).sum(), (r[turned] ** 2).sum()
    return (one * d - b * other) / (a * d - b * c), (a * other - c * one) / (a * d - b * c)


def sandwich(r: Matrix, j: Matrix, root: Matrix) -> Matrix:
    """Covariance of a least-squares estimate whose residuals have two variances."""
    turned = np.tile([False] * 3 + [True] * 3, len(r) // 6)
    position, rotation = two_variances(r, j, root)
    carried = [root @ (root.T @ j[kind].T) for kind in (~turned, turned)]
    return position * (carried[0] @ carried[0].T) + rotation * (carried[1] @ carried[1].T)

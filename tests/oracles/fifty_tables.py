"""Tables of a finished study derived a second time in 50 digits from the tables before them.

Rows are dictionaries, as ``tables.rows`` gives them. Everything runs within ``working()``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from . import fifty_digits as fd
from .fifty_digits import Matrix, exact
from .kinematics import ERROR_NAMES
from .tables import Row, dh_table, joints

WEIGHT = Decimal(500)
UNIT_RAD = Decimal("0.001")  # a mrad counts as much as a mm
CLOSE = Decimal("1e-22")  # of the last step, mm and mrad: nothing in a float of 53 bits
FREE = ("theta", "d", "a", "alpha")


# --- models and errors ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Arm:
    """The models of a results folder and their frames."""

    dh: Matrix
    nominal: Matrix
    series: Matrix
    low: Matrix
    high: Matrix
    frames: dict[tuple[str, str], Matrix]

    @classmethod
    def of(cls, dh: Sequence[Row], vec: Sequence[Row], frames: Sequence[Row]) -> Arm:
        order = max(row["order"] for row in vec)
        count = max(row["joint"] for row in vec)
        series = fd.zeros(count, 6, order + 1)
        low, high = fd.zeros(count), fd.zeros(count)
        for row in vec:
            joint = row["joint"] - 1
            assert row["direction"] == 0
            series[joint, ERROR_NAMES.index(row["error"]), row["order"]] = exact(row["coefficient"])
            low[joint], high[joint] = exact([row["q_min_rad"], row["q_max_rad"]])
        placed = {
            (row["model"], row["frame"]): fd.pose_frame(
                row["x_mm"], row["y_mm"], row["z_mm"], [row[f"q{c}"] for c in "wxyz"]
            )
            for row in frames
        }
        nominal = dh_table({row["joint"]: row for row in vec}.values())
        return cls(exact(dh_table(dh)), exact(nominal), series, low, high, placed)

    def flange(self, model: str, q: Matrix) -> Matrix:
        if model == "vec":
            return fd.vec_motions(self.nominal, self.series, self.low, self.high, q)[0]
        return fd.dh_forward(self.dh if model == "dh" else self.nominal, q)

    def tool(self, model: str, q: Matrix, target: str = "tool") -> Matrix:
        return self.flange(model, q) @ self.frames[model, target]


def measured(row: Row) -> Matrix:
    return fd.pose_frame(row["x_mm"], row["y_mm"], row["z_mm"], [row[f"q{c}"] for c in "wxyz"])


# --- fits -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Fit:
    """Parameters (in mm and rad) with their covariance; the cost, the singular values."""

    x: Matrix
    covariance: Matrix
    cost: Decimal
    values: Matrix | None = None
    frames: tuple[Matrix, Matrix] | None = None


def vec_fit(arm: Arm, rows: Sequence[Row], start: Matrix, prior_mm: float, prior_rad: float) -> Fit:
    """Coefficients of greatest posterior probability, base and tool known (eqs. 5 and 6).

    What is least: the residuals' squares over their variance and the coefficients' squares over
    the prior's. The variance is that of the residuals, over their number less that of the
    coefficients they decide: P less the trace of the prior's share of the posterior."""
    shape = arm.series.shape
    scale = np.tile(np.repeat([Decimal(1)] * 3 + [UNIT_RAD] * 3, shape[2]), shape[0])
    prior = np.tile(np.repeat(exact([prior_mm] * 3 + [prior_rad] * 3), shape[2]), shape[0])
    weight = (scale / prior) ** 2
    back, tool = fd.undone(arm.frames["vec", "base"]), arm.frames["vec", "tool"]
    seen = [back @ measured(row) for row in rows]
    at_last: dict[str, Matrix] = {}

    def step(scaled: Matrix) -> Matrix:
        """From coefficients in mm and mrad with the logarithm of the variance behind them."""
        x, variance = scaled[:-1] * scale, scaled[-1].exp()
        r, j = [], []
        for row, wanted in zip(rows, seen, strict=True):
            series = x.reshape(shape)
            at, motion = fd.vec_motions(arm.nominal, series, arm.low, arm.high, exact(joints(row)))
            one, taking = fd.residual(at @ tool, wanted, WEIGHT)
            r.append(one)
            j.append(taking @ carried_to(tool, at, motion))
        r, j = np.concatenate(r), np.concatenate(j) * scale
        posterior = fd.inverse(j.T @ j + np.diag(variance * weight))
        effective = len(x) - variance * (weight @ np.diag(posterior))
        at_last.update(r=r, posterior=posterior)
        moved = -posterior @ (j.T @ r + variance * weight * scaled[:-1])
        return np.append(moved, (r @ r / (len(r) - effective) / variance).ln())

    end = fd.settled(step, np.append(start.ravel() / scale, Decimal(-2)), CLOSE)
    r, posterior = at_last["r"], at_last["posterior"]
    return Fit(end[:-1] * scale, end[-1].exp() * posterior * np.outer(scale, scale), r @ r)


def carried_to(tool: Matrix, at: Matrix, motion: Matrix) -> Matrix:
    """A motion of the flange as one of the tool."""
    lever = at[:3, :3] @ tool[:3, 3]
    return np.concatenate([motion[:3] - fd.cross(lever) @ motion[3:], motion[3:]])


def dh_fit(
    nominal: Matrix,
    q: Sequence[Matrix],
    seen: Sequence[Matrix],
    start: Matrix,
    threshold: float,
    tool: Matrix,
    base: Matrix | None = None,
) -> Fit:
    """DH parameters that are least squares of the poses ``seen`` of a target, truncated.

    ``seen`` is in the base frame, ``tool`` known; or, with ``base`` (where it starts, as ``tool``
    does), in the instrument's, and both are estimated: what they can take up is projected out
    before the parameters' directions are judged."""
    free = np.tile([name in FREE for name in fd.DH_MOVES], len(nominal))
    scale = np.tile([UNIT_RAD, Decimal(1), Decimal(1), UNIT_RAD], len(nominal))
    held, count = nominal.ravel()[free], int(free.sum())
    estimated = base is not None
    at_last: dict[str, Matrix] = {}

    def placed(moved: Matrix) -> tuple[Matrix | None, Matrix]:
        """Base and tool by their coordinates behind the parameters'."""
        if not estimated:
            return None, tool
        return base @ motion_of(moved[:6]), tool @ motion_of(moved[6:])

    def step(scaled: Matrix) -> Matrix:
        table = nominal.ravel().copy()
        table[free] = scaled[:count] * scale
        table = table.reshape(nominal.shape)
        own_base, own_tool = placed(scaled[count:])
        r, j, moves = [], [], []
        for angles, wanted in zip(q, seen, strict=True):
            flange, motion = fd.dh_motions(table, angles)
            at = flange @ own_tool
            target = fd.undone(own_base) @ wanted if estimated else wanted
            one, taking = fd.residual(at, target, WEIGHT)
            r.append(one)
            j.append(taking @ carried_to(own_tool, flange, motion)[:, free])
            if estimated:
                moves.append(np.concatenate([with_base(at, target), with_tool(at)], axis=1))
                moves[-1] = taking @ moves[-1]
        r, j = np.concatenate(r), np.concatenate(j) * scale
        frames, own, rest = None, j, r
        if estimated:
            frames = np.concatenate(moves) * np.tile([Decimal(1)] * 3 + [UNIT_RAD] * 3, 2)
            follow = -fd.inverse(frames.T @ frames) @ frames.T
            own, rest = j + frames @ (follow @ j), r + frames @ (follow @ r)
        values, kept, lost = fd.truncated(own, threshold)
        moved = -kept @ ((kept.T @ (own.T @ rest)) / values[: kept.shape[1]] ** 2)
        moved = moved - lost @ (lost.T @ (scaled[:count] - held / scale))
        at_last.update(r=r, j=j, frames=frames, values=values, kept=kept)
        return np.concatenate([moved, follow @ (r + j @ moved)]) if estimated else moved

    begin = np.concatenate([start.ravel()[free] / scale, fd.zeros(12 if estimated else 0)])
    end = fd.settled(step, begin, CLOSE)
    r, values = at_last["r"], at_last["values"]
    covariance = _covariance(r, at_last["j"], at_last["frames"], at_last["kept"], values, scale)
    frames = placed(end[count:]) if estimated else None
    return Fit(end[:count] * scale, covariance, r @ r, values, frames)


def _covariance(r, j, frames, kept, values, scale) -> Matrix:
    """Covariance of the parameters alone."""
    count = kept.shape[1]
    root = kept / values[:count]
    if frames is None:
        return fd.sandwich(r, j, root) * np.outer(scale, scale)
    lower = fd.cholesky(fd.inverse(frames.T @ frames))  # its product with itself inverts
    follow = -fd.inverse(frames.T @ frames) @ frames.T @ j
    n = frames.shape[1]
    whole = fd.zeros(n + len(root), n + count)
    whole[:n, :n], whole[:n, n:], whole[n:, n:] = lower, follow @ root, root
    every = np.concatenate([frames, j], axis=1)
    return fd.sandwich(r, every, whole)[n:, n:] * np.outer(scale, scale)


def with_base(at: Matrix, target: Matrix) -> Matrix:
    """How model minus measurement follows small motions of the base, along its own axes."""
    found = fd.zeros(6, 6)
    found[:3, :3] = fd.eye(3)
    found[:3, 3:] = -fd.cross(target[:3, 3])
    found[3:, 3:] = at[:3, :3] @ target[:3, :3].T  # from the right of the rotation's difference
    return found


def with_tool(at: Matrix) -> Matrix:
    """How it follows small motions of the target, along the target's own axes."""
    found = fd.zeros(6, 6)
    found[:3, :3] = found[3:, 3:] = at[:3, :3]
    return found


def motion_of(step: Matrix) -> Matrix:
    """A small motion from scaled coordinates: shift in mm, then turn in mrad."""
    return fd.frame(fd.turned_by(step[3:] * UNIT_RAD), step[:3])

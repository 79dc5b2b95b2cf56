"""How VEC models are fitted: their joint range, order and prior, stated or chosen held out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from kinacc.calibration import selection, tables, vec_fit
from kinacc.calibration.constrained import FrameTerms
from kinacc.calibration.frames import Frames
from kinacc.calibration.models import Common, Estimator, Fit, nominal_frames
from kinacc.calibration.observations import Observations
from kinacc.calibration.selection import Choice, Grid
from kinacc.calibration.uncertainty import Uncertainty
from kinacc.calibration.vec_fit import Prior, VECFit
from kinacc.config.error_models import NOMINAL
from kinacc.kinematics import vec
from kinacc.kinematics.robot import Robot
from kinacc.kinematics.vec import VECModel
from kinacc.tables.columns import Columns

_AUTO = "auto"


@dataclass(frozen=True)
class VECEstimator(Estimator):
    """Settings of ``calibration.vec``.

    ``joint_range_rad`` (k,), (k,) of the DH joints. ``grid``: orders and priors to choose from;
    None where ``order`` and ``prior`` are stated.
    """

    joint_range_rad: tuple[np.ndarray, np.ndarray]
    order: int
    prior: Prior
    grid: Grid | None
    travel_direction: bool

    kind: ClassVar[str] = "vec"
    name: ClassVar[str] = "VEC fit"
    fix: ClassVar[str] = vec_fit.VEC_FIX

    @classmethod
    def of(cls, calibration: Mapping, arm: Robot, every: Observations) -> Self:
        """By the ``calibration`` settings."""
        section = calibration["vec"]
        angle_rad = 1e-3 * float(section["prior_std_mrad"])
        stated = Prior(
            float(section["prior_std_mm"]), angle_rad, float(section["prior_decay"]), angle_rad
        )
        return cls(
            Common.of(calibration, arm),
            _joint_range_rad(section, arm, every.q_rad),
            1 if section["order"] == _AUTO else int(section["order"]),
            stated,
            _grid(section, stated),
            bool(section["travel_direction"]),
        )

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return 6 * self.common.nominal.joints * (self.order + 1)

    def choices(self, every: Observations, progress: Callable | None = None) -> dict[str, Columns]:
        """``vec_orders``: the order and prior of every fold, or those stated."""
        tried = [] if self.grid is None else self._tried(every, progress)
        return {"vec_orders": tables.vec_orders_columns(tried, (self.order, self.prior))}

    def chosen(self, tables_of: Mapping[str, Columns], fold: int | None) -> Self:
        """The estimator with the order and prior that ``vec_orders`` states for one fold."""
        if self.grid is None:
            return self
        order, std_mm, decay = tables.chosen_order(tables_of["vec_orders"], fold)
        for prior in self.grid.priors:
            if prior.delta_mm == std_mm and prior.decay == decay:
                return replace(self, order=order, prior=prior)
        raise ValueError(f"vec_orders states a prior of {std_mm} mm, decay {decay}: not in grid")

    def fit(
        self, observations: Observations, others: Mapping[str, Fit], near: Fit | None = None
    ) -> VECFit:
        """The VEC model on the nominal arm, base and targets starting where that has them."""
        frames, terms = self._begin(observations, others)
        start: VECModel | None = near.model if near else None
        # High orders are worth it; the end is the same to a few nm, which the paper's tables keep.
        worth = self.grid is not None and start is not None and start.order == self.order
        return vec_fit.fit(
            self._wanted(observations),
            self._empty(self.order),
            prior=self.prior,
            rotation_weight_mm_per_rad=self.common.rotation_weight_mm_per_rad,
            frames=frames,
            frames_free=terms is not None,
            frame_terms=terms,
            start=start if worth else None,
        )

    def tables(
        self, fitted: VECFit, known: Uncertainty, observations: Observations
    ) -> dict[str, Columns]:
        """How the fit went, and what the poses tell of the coefficients without a prior."""
        gauge = vec_fit.gauge(
            self._wanted(observations),
            fitted.model,
            fitted.frames,
            self.common.rotation_weight_mm_per_rad,
        )
        return {"vec_fit": tables.vec_fit_columns(fitted, gauge, known)}

    def _tried(self, every: Observations, progress: Callable | None) -> list[Choice]:
        frames, terms = self._begin(every, {})
        weight = self.common.rotation_weight_mm_per_rad
        at = vec_fit.frames_of(every, self._empty(1), frames, terms is not None, terms, weight)
        size = at.coordinates.size
        # That a trial trains on three blocks of five is no limit: the prior holds what these do
        # not show. What is chosen is fitted without a fold, too.
        count = selection.carried(every.select(every.fold >= 0))
        grid = self.grid.within(count, self.common.nominal.joints, size)
        return selection.choices(
            self._wanted(every),
            self._empty(max(grid.orders)),
            at,
            weight,
            grid,
            progress,
        )

    def _begin(
        self, observations: Observations, others: Mapping[str, Fit]
    ) -> tuple[Frames, FrameTerms | None]:
        """Where base and targets start, and what is taken for granted of those estimated."""
        stated, terms = self.common.frames(observations)
        if stated is None and NOMINAL in others:
            stated = others[NOMINAL].frames
        return stated or nominal_frames(observations, self.common), terms

    def _empty(self, order: int) -> VECModel:
        return vec.without_errors(self.common.nominal, *self.joint_range_rad, order)

    def _wanted(self, observations: Observations) -> Observations:
        return observations if self.travel_direction else observations.without_directions()


def _grid(section: Mapping, stated: Prior) -> Grid | None:
    """The orders and priors to choose from; None where both are stated."""
    by_order, by_prior = section["order"] == _AUTO, section["prior"] == "chosen"
    if not by_order and not by_prior:
        return None
    orders = (
        tuple(order for order in selection.ORDERS if order <= int(section["order_highest"]))
        if by_order
        else (int(section["order"]),)
    )
    return Grid(orders, selection.chosen_priors(stated.offset_rad) if by_prior else (stated,))


def _joint_range_rad(
    section: Mapping, arm: Robot, q_rad: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Range (k,), (k,) of the DH joints; those of the data are ``q_rad`` (n, k)."""
    wanted = section["joint_range"]
    if wanted == "data":
        margin = np.deg2rad(float(section["joint_range_margin_deg"]))
        return q_rad.min(axis=0) - margin, q_rad.max(axis=0) + margin
    low, high = arm.q_min_rad, arm.q_max_rad
    if wanted != "limits":
        low, high = np.deg2rad(np.array(wanted, dtype=float)).T
    return arm.dh_box(low, high)

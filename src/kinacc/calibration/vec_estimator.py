"""How VEC models are fitted: their joint range, order and prior, stated or chosen held out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
import pandas as pd

from kinacc.calibration import vec_fit
from kinacc.calibration.fitting import Fit, ModelFit, placed
from kinacc.calibration.models import Common, Estimator
from kinacc.calibration.observations import Observations
from kinacc.calibration.vec_fit import Prior
from kinacc.config.error_models import NOMINAL
from kinacc.config.records import Settings
from kinacc.kinematics import vec
from kinacc.kinematics.robot import Robot
from kinacc.kinematics.vec import VECModel
from kinacc.progress import with_progress
from kinacc.tables.columns import Tables
from kinacc.tables.contract import ARTEFACTS

_AUTO = "auto"


@dataclass(frozen=True)
class VECEstimator(Estimator):
    """How VEC models are fitted: settings of ``calibration.vec``.

    Attributes
    ----------
    joint_range_rad : tuple of numpy.ndarray
        Least and largest DH joints, shapes (k,), rad or mm.
    order : int
        Of a fit.
    prior : Prior
        Of a fit.
    orders : tuple of int
        To choose from, by vec_fit.
    prior_stated : bool
        Only the order is chosen.
    travel_direction : bool
        Errors depend on the direction a joint travelled in.
    """

    joint_range_rad: tuple[np.ndarray, np.ndarray]
    order: int
    prior: Prior
    orders: tuple[int, ...]
    prior_stated: bool
    travel_direction: bool

    kind: ClassVar[str] = "vec"

    @classmethod
    def of(cls, calibration: Settings, arm: Robot, every: Observations) -> Self:
        """By the ``calibration`` settings."""
        section = calibration["vec"]
        angle_rad = 1e-3 * section["prior_std_mrad"]
        orders = [order for order in vec_fit.ORDERS if order <= section["order_highest"]]
        orders = orders if section["order"] == _AUTO else [section["order"]]
        return cls(
            Common.of(calibration, arm),
            _joint_range_rad(section, arm, every.q_rad),
            orders[0],
            Prior(section["prior_std_mm"], angle_rad, section["prior_decay"], angle_rad),
            tuple(orders),
            section["prior"] != "chosen",
            section["travel_direction"],
        )

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return 6 * self.common.arm.dh.joints * (self.order + 1)

    @property
    def open(self) -> bool:
        """Whether order or prior are left to the vec_fit."""
        return len(self.orders) > 1 or not self.prior_stated

    def choices(self, every: Observations) -> Tables:
        """``vec_orders``: orders and priors tried with each fold unseen and with all seen."""
        parts: list[pd.DataFrame] = []
        folds = [None, *(int(fold) for fold in np.unique(every.fold) if fold >= 0)]
        if not self.open:
            unjudged = vec_fit.table_of([(self.order, self.prior, np.nan, None)])
            parts.append(unjudged.assign(fold=np.nan))
        for fold in with_progress(folds if self.open else (), "shares of the poses held out"):
            training = every if fold is None else every.select(every.fold != fold)
            parts.append(self._choice(training, parts[0] if parts else None).assign(fold=fold))
        table = pd.concat([part.astype({"fold": float, "chosen": int}) for part in parts])
        names = [column.name for column in ARTEFACTS["vec_orders"].columns]
        return {"vec_orders": {name: table[name].to_numpy() for name in names}}

    def chosen(self, tables: Tables, fold: int | None) -> Self:
        """The estimator with the order and prior that ``vec_orders`` states for one fold."""
        if not self.open:
            return self
        table = pd.DataFrame(tables["vec_orders"]).query("chosen == 1")
        row = table[table["fold"].isna() if fold is None else table["fold"] == fold].iloc[0]
        prior = self.prior
        if not self.prior_stated:
            std_mm, decay = float(row["prior_std_mm"]), float(row["prior_decay"])
            prior = vec_fit.prior_of(std_mm, decay, self.prior.offset_rad)
        return replace(self, order=int(row["order"]), prior=prior)

    def fit(self, observations: Observations, others: Mapping[str, Fit]) -> ModelFit:
        """The VEC model on the nominal arm, base and targets starting where that has them."""
        begin = others[NOMINAL].frames if NOMINAL in others else None
        return vec_fit.fit(
            self._wanted(observations),
            self._empty(self.order),
            prior=self.prior,
            rotation_weight_mm_per_rad=self.common.rotation_weight_mm_per_rad,
            frames=self.common.frames(observations),
            begin=begin or self.common.nominal_frames(observations),
            few=self.open,
        )

    def _choice(self, training: Observations, near: pd.DataFrame | None) -> pd.DataFrame:
        common, weight = self.common, self.common.rotation_weight_mm_per_rad
        arm, frames = common.arm.dh, common.frames(training)
        parameters = placed(training, arm, frames, weight, common.nominal_frames(training))
        most = vec_fit.highest_order(training, arm.joints, parameters.size)
        orders = [order for order in self.orders if order <= most]
        if not orders:  # too few residuals to judge by
            usual = vec_fit.prior_of(vec_fit.USUAL_STD, 1.0, self.prior.offset_rad)
            return vec_fit.table_of([(self.orders[0], usual, np.nan, None)])
        stated = self.prior if self.prior_stated else None
        observations = self._wanted(training)
        return vec_fit.choose(
            observations, self._empty(1), parameters, weight, orders, stated, near
        )

    def _empty(self, order: int) -> VECModel:
        return vec.without_errors(self.common.arm.dh, *self.joint_range_rad, order)

    def _wanted(self, observations: Observations) -> Observations:
        """The observations, every travel direction unknown where it does not matter."""
        s = observations.s if self.travel_direction else np.zeros_like(observations.s)
        return replace(observations, s=s)


def _joint_range_rad(
    section: Settings, arm: Robot, q_rad: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Range (k,), (k,) of the DH joints; those of the data are ``q_rad`` (n, k)."""
    wanted = section["joint_range"]
    if wanted == "data":
        margin = np.deg2rad(section["joint_range_margin_deg"])
        return q_rad.min(axis=0) - margin, q_rad.max(axis=0) + margin
    low, high = arm.q_min_rad, arm.q_max_rad
    if wanted != "limits":
        low, high = np.deg2rad(np.array(wanted, dtype=float)).T
    return arm.dh_box(low, high)

"""Error models of an arm fitted to observations: one estimator for each kind, behind one face."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from kinacc.calibration import fitting
from kinacc.calibration.fitting import Fit, ModelFit
from kinacc.calibration.frames import FrameParameters, Frames, frame_terms, known
from kinacc.calibration.observations import Observations
from kinacc.config import error_models, parameter_rules
from kinacc.config.error_models import NOMINAL
from kinacc.config.parameter_rules import Rule
from kinacc.config.records import Settings
from kinacc.kinematics.model import ErrorModel
from kinacc.kinematics.robot import Robot, carried
from kinacc.tables.columns import Tables


@dataclass(frozen=True)
class Common:
    """What all fits of a data set share; see the ``calibration`` section of the configuration.

    ``arm``: the nominal one. ``frames_estimated``: base and tool are unknown; else they are those
    of the arm. ``frame_rules``: what is known of them beforehand.
    """

    arm: Robot
    rotation_weight_mm_per_rad: float
    frames_estimated: bool
    frame_rules: tuple[Rule, ...]

    @classmethod
    def of(cls, calibration: Settings, arm: Robot) -> Self:
        """By the ``calibration`` settings."""
        return cls(
            arm,
            calibration["rotation_weight_mm_per_rad"],
            calibration["base_and_tool"] == "estimated",
            tuple(parameter_rules.rules(calibration["frames"], of_frames=True)),
        )

    def frames(self, observations: Observations) -> FrameParameters:
        """Base and targets from where the robot's description has them; fixed if not estimated."""
        counts = len(observations.session_names), len(observations.target_names)
        stated = known(self.arm.base, carried(self.arm), *counts)
        if not self.frames_estimated:
            return FrameParameters.none(stated)
        return frame_terms(observations, stated, self.frame_rules)

    def fit(self, observations: Observations, nominal: ErrorModel, **settings: Any) -> ModelFit:
        """A model fitted to measurements, by ``settings`` of ``fitting.fit``."""
        settings = {"frames": self.frames(observations)} | settings
        weight = self.rotation_weight_mm_per_rad
        return fitting.fit(observations, nominal, rotation_weight_mm_per_rad=weight, **settings)

    def nominal_frames(self, observations: Observations) -> Frames:
        """Base and targets of the nominal arm, fitted where they are not known. Raises FitError."""
        frames, weight = self.frames(observations), self.rotation_weight_mm_per_rad
        if not frames.size:
            return frames.reference
        return fitting.fit_frames(
            observations, self.arm.dh, rotation_weight_mm_per_rad=weight, frames=frames
        )


@dataclass(frozen=True)
class Estimator:
    """How models of one kind are fitted: what all fits share, and settings of its own."""

    common: Common

    kind: ClassVar[str]

    @classmethod
    def of(cls, calibration: Settings, arm: Robot, every: Observations) -> Self:
        """By the ``calibration`` settings; ``every``: all observations of the data set."""
        raise NotImplementedError

    @classmethod
    def contradictions(
        cls, calibration: Settings, arm: Robot
    ) -> Iterator[tuple[tuple[str, ...], str, str]]:
        """Keys of its section that cannot be for ``arm``, what is wrong, and what is allowed."""
        yield from ()

    def choices(self, every: Observations) -> Tables:
        """Tables that say how settings left open were chosen. Raises FitError."""
        return {}

    def chosen(self, tables: Tables, fold: int | None) -> Self:
        """The estimator with what such tables chose without seeing ``fold`` (None: all seen)."""
        return self

    def fit(self, observations: Observations, others: Mapping[str, Fit]) -> ModelFit:
        """The model of ``observations``; ``others`` are fitted already. Raises FitError."""
        raise NotImplementedError


def estimators(calibration: Settings, arm: Robot, every: Observations) -> dict[str, Estimator]:
    """The estimators that settings ask for.

    Parameters
    ----------
    calibration : mapping
        Section ``calibration`` of the configuration.
    arm : Robot
        The nominal arm.
    every : Observations
        All observations of the data set.

    Returns
    -------
    dict
        Estimators by kind, in the order of fitting.
    """
    return {
        kind: error_models.loaded(error_models.ERROR_MODELS[kind].estimator).of(
            calibration, arm, every
        )
        for kind in error_models.asked_for(calibration)
    }


def fit_all(observations: Observations, estimators: Sequence[Estimator]) -> dict[str, Fit]:
    """Fit models of all kinds, and base and targets of the nominal arm.

    Parameters
    ----------
    observations : Observations
        Measured points and poses.
    estimators : sequence of Estimator
        In the order of fitting, at least one.

    Returns
    -------
    dict
        ``Fit`` by kind, the nominal one last.

    Raises
    ------
    FitError
        A fit does not converge.
    InputError
        There are fewer residuals than parameters.
    """
    common, fits = estimators[0].common, dict[str, Fit]()
    nominal = {NOMINAL: Fit(common.arm.dh, common.nominal_frames(observations))}
    for estimator in estimators:
        fits[estimator.kind] = estimator.fit(observations, fits | nominal)
    return fits | nominal

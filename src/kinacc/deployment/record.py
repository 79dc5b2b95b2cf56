"""A calibrated arm as one record: robot, chosen model, frames, and how sure the fit was of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kinacc.calibration.misfit import Misfit
from kinacc.calibration.noise import UNKNOWN
from kinacc.calibration.uncertainty import Uncertainty, scale_of
from kinacc.config.error_models import ERROR_MODELS, NOMINAL
from kinacc.errors import input_error
from kinacc.geometry import IDENTITY, Pose, compose, invert, skew
from kinacc.kinematics.inverse import limits
from kinacc.kinematics.model import ErrorModel, JointState
from kinacc.kinematics.robot import Robot, carried
from kinacc.tables.allowed import SUBSETS

MODELS = (*ERROR_MODELS, NOMINAL)
FRAMES = ("base", "instrument")
POSES = dict(zip(SUBSETS, ("training poses", "held-out poses"), strict=True))
FLANGE, TOOL = "flange", "tool"
MEASURED, STATED = "measured", "stated"  # where an orientation comes from
_NO_MISFIT = Misfit(NOMINAL, np.nan, UNKNOWN)
_LEAST_SHARE = 1e-14  # of the largest eigenvalue: below it is rounding


@dataclass(frozen=True)
class Residual:
    """Rms magnitudes of what a model leaves unexplained, and of which rows ("validation")."""

    position_mm: float
    orientation_rad: float
    subset: str


@dataclass(frozen=True)
class Calibration:
    """One model of one calibrated arm.

    ``choice`` is one of ``MODELS``. ``base`` is the first DH frame in the instrument's frame,
    ``targets`` are tool and other targets in the last DH frame. ``known`` is the uncertainty of the
    fit (None for the nominal model), ``residual`` what the model does not explain.
    ``fitted_range_rad`` (k,), (k,) are the DH joints the data cover (mm where a joint slides);
    ``fitted`` how the arm stood at the readings that were fitted, None where that is not known.
    ``base_name`` is what ``known`` calls the base, which differs by session. ``anchor`` is the DH
    model of the same data where this is another one fitted with its base: errors of a VEC model can
    turn or shift base and tool against each other by mm and no measured pose shows it, so the
    robot's own base, the tool programs mean, and what poses leave open are those of the DH model.
    ``left_open`` says in sentences what that is; None where nobody asked.
    ``orientation_measured`` are the targets with a measured orientation; the others, and without
    any the flange too, have the orientation that the robot file states. ``outdated`` is why the
    calibration is not that of the files and settings there now; empty where it is. ``misfit``: what
    the standard deviations of ``known`` are worth.
    """

    name: str
    robot: Robot
    choice: str
    model: ErrorModel
    base: Pose
    targets: Mapping[str, Pose]
    known: Uncertainty | None = None
    residual: Residual | None = None
    fitted_range_rad: tuple[np.ndarray, np.ndarray] | None = None
    base_name: str = "base"
    anchor: Calibration | None = None
    fitted: JointState | None = None
    left_open: tuple[str, ...] | None = None
    orientation_measured: frozenset[str] = frozenset()
    outdated: str = ""
    misfit: Misfit = _NO_MISFIT

    def orientation_source(self, point: str | None = None) -> str:
        """``measured`` or ``stated`` (by the robot file), of a target by name or the flange."""
        name = point or self.default_point
        known = self.orientation_measured
        return MEASURED if name in known or (name == FLANGE and known) else STATED

    def facts(self, frame: str, point: str | None) -> dict[str, str]:
        """Name, robot, model, frame and point of an answer, and why it is outdated if it is."""
        point = point or self.default_point
        return {
            "calibration": self.name,
            "robot": self.robot.name,
            "model": self.choice,
            "frame": frame,
            "point": point,
            "orientation": self.orientation_source(point),
            **({"outdated": self.outdated} if self.outdated else {}),
        }

    @property
    def default_point(self) -> str:
        """The tool where there is one, else the first target, or the flange."""
        return TOOL if TOOL in self.targets else next(iter(self.targets), FLANGE)

    def point(self, name: str | None) -> Pose:
        """A target by name, or the flange, in the last DH frame. InputError for another name."""
        name = name or self.default_point
        if name in self.targets:
            return self.targets[name]
        if name == FLANGE:
            return self.robot.flange
        known = ", ".join([*self.targets, FLANGE])
        raise input_error("point", f"{name!r} is none of this calibration", known)

    @property
    def plainest(self) -> Calibration:
        """The model whose parameters say what the poses left open."""
        return self if self.anchor is None or self.anchor.known is None else self.anchor

    def origin(self, frame: str) -> Pose:
        """First DH frame in ``frame``: the robot's own base, or the instrument."""
        if frame not in FRAMES:
            raise input_error("frame", f"{frame!r}", ", ".join(FRAMES))
        if frame == "instrument":
            return self.base
        if self.anchor is None:
            return self.robot.base
        return compose(self.robot.base, compose(invert(self.anchor.base), self.base))

    def pose(self, at: JointState, frame: str = "base", point: str | None = None) -> Pose:
        """Poses (n, ...) of a point in ``frame``."""
        return compose(self.origin(frame), compose(self.model.pose(at), self.point(point)))

    def joint_jacobian(
        self, at: JointState, frame: str = "base", point: str | None = None
    ) -> np.ndarray:
        """Jacobian (n, 6, k) of ``pose`` in the DH joints; rows as in ``ErrorModel``."""
        return self.of_point(self.model.joint_jacobian(at), self.model.pose(at), frame, point)

    def of_point(self, slopes: np.ndarray, end: Pose, frame: str, point: str | None) -> np.ndarray:
        """Jacobian (n, 6, P) of a point in ``frame``, from that of the last DH frame at ``end``."""
        # A turn of the last frame swings the point: w x arm = -[arm] w.
        arm = (end.rotation @ self.point(point).position_mm[:, None])[..., 0]
        turn = self.origin(frame).rotation
        moved = (slopes[:, :3] - skew(arm) @ slopes[:, 3:], slopes[:, 3:])
        return np.concatenate([turn @ part for part in moved], axis=1)

    @cached_property
    def root(self) -> np.ndarray:
        """Matrix (P, r) whose product with its transpose is the covariance of ``known``."""
        if self.known is None:
            return np.zeros((0, 0))
        units = self.units
        values, vectors = np.linalg.eigh(self.known.covariance / np.outer(units, units))
        retained = values > _LEAST_SHARE * max(float(values[-1]), 0.0)
        return units[:, None] * vectors[:, retained] * np.sqrt(values[retained])

    @property
    def units(self) -> np.ndarray:
        """Unit (P,) in which displacements of the parameters are measured: mm, and one mrad."""
        return np.array([scale_of(name) for name in self.parameters])

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names (P,) of the fitted parameters; none without a covariance."""
        return self.known.names if self.known else ()

    def outside_range(self, q_rad: np.ndarray, slack: np.ndarray | float = 1e-9) -> np.ndarray:
        """True (n, k) where a DH joint lies outside what the data cover by more than ``slack``."""
        return limits.outside(np.atleast_2d(q_rad), self.fitted_range_rad, slack)


def nominal(robot: Robot, name: str = "") -> Calibration:
    """A robot as its maker describes it, as a calibration that nothing was learned for."""
    targets = {TOOL: carried(robot)}
    return Calibration(name or robot.name, robot, NOMINAL, robot.dh, IDENTITY, targets)

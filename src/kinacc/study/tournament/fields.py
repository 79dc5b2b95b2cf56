"""Error fields of the tournament: true errors of many poses, synthetic and measured.

A field is a pool of configurations with the deterministic error of the model at each. Campaigns
draw their candidates from the pool at random.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from kinacc.artifacts.columns import Columns
from kinacc.artifacts.contract import columns_of
from kinacc.assess.error_effects import joint_errors
from kinacc.errors import InputError, Problem
from kinacc.kinematics import dh, robot
from kinacc.study.operating_points import readings_of
from kinacc.synthetic import plan
from kinacc.synthetic.accepted import accepted_draw
from kinacc.synthetic.draw import physical_robot
from kinacc.synthetic.physical import PhysicalRobot, Visits, pose

CALIBRATION_POSES = 400
POOL = 1000
_TRUNCATION = 1e-6  # DH directions that the calibration poses do not see are left alone
_DEFECT_SHARE = 0.02
_DEFECT_RAD = 6e-4  # jump of joint 2 where its teeth are worn: about 1 mm at the flange
_RARE_SHARE, _RARE_MM = 0.01, (1.2, 1.9)


@dataclass(frozen=True)
class Field:
    """``q_rad`` (n, k) reported joints and true errors ``error_mm`` (n, 3), robot base frame.

    ``kind`` is ``paper``, ``synthetic`` or ``measured``; ``robot`` the arm's name or file.
    """

    name: str
    kind: str
    robot: str
    q_rad: np.ndarray
    error_mm: np.ndarray
    meaning: str = ""

    def __post_init__(self) -> None:
        shapes = self.q_rad.shape[:1] + self.error_mm.shape
        if self.error_mm.ndim != 2 or shapes[2] != 3 or shapes[0] != shapes[1] or not shapes[0]:
            found = f"joints {self.q_rad.shape}, errors {self.error_mm.shape}"
            raise InputError(
                Problem(f"field {self.name}", found, "(n, k) and (n, 3), n at least 1")
            )
        if not np.all(np.isfinite(self.error_mm)):
            what = "holds errors that are not finite"
            raise InputError(Problem(f"field {self.name}", what, "numbers in mm"))

    @property
    def points(self) -> int:
        """Number of configurations in the pool."""
        return len(self.error_mm)

    @cached_property
    def size_mm(self) -> np.ndarray:
        """Sizes of the errors (n,)."""
        return np.linalg.norm(self.error_mm, axis=1)

    @cached_property
    def effects(self) -> np.ndarray:
        """What an error of each joint does at the tool (n, 3, 6 k), see :mod:`causes`."""
        return joint_errors(robot.load(self.robot), self.q_rad)

    def candidates(self, count: int, entropy: tuple[int, ...]) -> np.ndarray:
        """Rows of ``count`` configurations drawn without replacement, in random order."""
        return np.random.default_rng([*entropy, 0]).permutation(self.points)[:count]


def of_points(name: str, robot_name: str, points: Mapping) -> Field:
    """The paper's field: ``assessment_points`` of a modelled space."""
    meaning = "errors of the DH model at the operating points of the study"
    return Field(name, "paper", robot_name, _stacked(points, "q"), _vectors(points), meaning)


def of_measurements(name: str, robot_name: str, errors: Mapping, measurements: Mapping) -> Field:
    """Cross-validated errors of the DH model at measured configurations, readings averaged.

    errors: ``pose_errors``; measurements: ``measurements``. The errors hold the noise of the
    instrument, which counts as truth here.
    """
    wanted = (np.asarray(errors["comparison"]) == "dh_vs_measured") & (
        np.asarray(errors["estimate"]) == "cross_validated"
    )
    if not wanted.any():
        what = "pose_errors holds no cross-validated errors of the DH model"
        raise InputError(Problem(f"field {name}", what, fix="set measurements.folds"))
    rows = np.flatnonzero(wanted)
    groups = readings_of(np.asarray(errors["pose"])[rows], np.asarray(errors["target"])[rows])
    vectors, q_rad = _vectors(errors), _stacked(measurements, "q")
    pose_of = {int(each): row for row, each in reversed([*enumerate(measurements["pose"])])}
    first = [pose_of[int(np.asarray(errors["pose"])[rows[group[0]]])] for group in groups]
    means = np.array([vectors[rows[group]].mean(axis=0) for group in groups])
    meaning = "held-out errors of the DH model at measured configurations"
    return Field(name, "measured", robot_name, q_rad[first], means, meaning)


def synthetic(name: str, draw: int) -> Field:
    """Physical arm of an accepted draw less the DH model calibrated to it, at other poses.

    ``name`` is one of :data:`FAMILIES`. The calibration sees no noise, so all that is left is
    deterministic; DH parameters and base are fitted to positions by least squares.
    """
    made = accepted_draw(draw)
    arm = physical_robot(made.seed, made.scales, made.geometry)
    change = FAMILIES[name]
    q_rad = plan.configurations(robot.load("mh180"), CALIBRATION_POSES + POOL)
    arm = change.arm(arm)
    true_mm = pose(arm, _quiet_visits(q_rad)).position_mm
    error_mm = true_mm - dh.forward(arm.dh, q_rad).position_mm
    rng = np.random.default_rng([made.seed, 4])
    error_mm = change.after(error_mm, q_rad, arm, rng)
    fitted = slice(None, CALIBRATION_POSES)
    left_mm = _beyond_dh(arm, q_rad, error_mm, fitted)
    return Field(
        f"{name}_{draw}",
        "synthetic",
        "mh180",
        q_rad[CALIBRATION_POSES:],
        left_mm[CALIBRATION_POSES:],
        change.meaning,
    )


@dataclass(frozen=True)
class Family:
    """How a synthetic field differs from the accepted draw; ``meaning`` in words."""

    meaning: str
    arm: Callable[[PhysicalRobot], PhysicalRobot]
    after: Callable[..., np.ndarray] = lambda error_mm, *_: error_mm


def _only(**factors: float) -> Callable[[PhysicalRobot], PhysicalRobot]:
    """The arm with the effects named times their factors, the other effects beyond a VEC none."""

    def change(arm: PhysicalRobot) -> PhysicalRobot:
        parts = ("compliance", "ripple_rad", "backlash_rad", "drift", "repeatability_rad")
        own = {part: getattr(arm.beyond, part) * factors.get(part, 0.0) for part in parts}
        return replace(arm, beyond=replace(arm.beyond, **own))

    return change


def _small(arm: PhysicalRobot) -> PhysicalRobot:
    return replace(_only()(arm), smooth=replace(arm.smooth, amplitude=0.35 * arm.smooth.amplitude))


def _with_defect(error_mm, q_rad, arm, rng) -> np.ndarray:
    """A worn spot of joint 2: it jumps over a few degrees that hold 2 % of the poses."""
    angle = q_rad[:, 1]
    start = rng.uniform(0.3, 0.7)
    low, high = np.quantile(angle, [start, start + _DEFECT_SHARE])
    worn = (angle >= low) & (angle < high)
    lever = dh.joint_jacobian(arm.dh, q_rad)[:, :3, 1]
    return error_mm + np.where(worn[:, None], lever * _DEFECT_RAD, 0.0)


def _with_rare(error_mm, q_rad, arm, rng) -> np.ndarray:
    """Single poses far off, for no reason a model could know."""
    size = np.where(rng.random(len(q_rad)) < _RARE_SHARE, rng.uniform(*_RARE_MM, len(q_rad)), 0.0)
    turn = rng.normal(size=(len(q_rad), 3))
    return error_mm + size[:, None] * turn / np.linalg.norm(turn, axis=1)[:, None]


FAMILIES: dict[str, Family] = {
    "smooth": Family("errors that depend smoothly on single joints", _only()),
    "gravity": Family("compliance under gravity, four times as large", _only(compliance=4.0)),
    "ripple": Family("ripple of the gears alone, on smooth errors", _only(ripple_rad=1.0)),
    "thermal": Family("warming up, three times as large", _only(drift=3.0)),
    "workshop": Family(
        "all effects of the physical arm",
        _only(compliance=1.0, ripple_rad=1.0, backlash_rad=1.0, drift=1.0),
    ),
    "defect": Family(
        "a worn spot of joint 2 that moves 2 % of the poses",
        _only(compliance=1.0, ripple_rad=0.3),
        _with_defect,
    ),
    "rare": Family("small smooth errors and 1 % of single poses far off", _small, _with_rare),
}


def _quiet_visits(q_rad: np.ndarray) -> Visits:
    """Visits without chance: in the plan's order and time."""
    count = len(q_rad)
    return Visits(q_rad, plan.directions(q_rad), plan.time_h(count), np.zeros(q_rad.shape))


def _beyond_dh(arm: PhysicalRobot, q_rad, error_mm, fitted: slice) -> np.ndarray:
    """What DH parameters and base, fitted by linear least squares, leave of small errors."""
    count = len(q_rad)
    parameters = dh.parameter_jacobian(arm.dh, q_rad)[:, :3, :, :4].reshape(count, 3, -1)
    tip_mm = dh.forward(arm.dh, q_rad).position_mm
    turns = np.stack([np.cross(axis, tip_mm) for axis in np.eye(3)], axis=2)
    shifts = np.broadcast_to(np.eye(3), (count, 3, 3))
    matrix = np.concatenate([parameters, turns, shifts], axis=2)
    size = np.linalg.norm(matrix.reshape(3 * count, -1), axis=0)
    matrix = matrix / np.where(size > 1e-9 * size.max(), size, 1.0)  # some move no position
    known = matrix[fitted].reshape(-1, matrix.shape[2])
    solved, *_ = np.linalg.lstsq(known, error_mm[fitted].ravel(), rcond=_TRUNCATION)
    return error_mm - matrix @ solved


def _stacked(columns: Mapping, letter: str) -> np.ndarray:
    names = [name for name in columns if name[:1] == letter and name[1:].isdigit()]
    return np.stack([np.asarray(columns[name], dtype=float) for name in names], axis=1)


def _vectors(columns: Mapping) -> np.ndarray:
    return np.stack([np.asarray(columns[f"e{axis}_mm"], dtype=float) for axis in "xyz"], axis=1)


def described(fields: Sequence[Field]) -> Columns:
    """``tournament_fields``: name, origin and sizes of every field."""
    rows = [
        {
            "field": field.name,
            "kind": field.kind,
            "meaning": field.meaning,
            "points": field.points,
            "mean_mm": field.size_mm.mean(),
            "median_mm": np.median(field.size_mm),
            "quantile_99_mm": np.quantile(field.size_mm, 0.99, method="inverted_cdf"),
            "max_mm": field.size_mm.max(),
        }
        for field in fields
    ]
    return columns_of("tournament_fields", rows)


def of_tables(
    tables: Mapping[str, Mapping], robots: Mapping[str, str], draws: Sequence[int]
) -> list[Field]:
    """Every field: of the data sets, then the synthetic families.

    tables: ``<data set>/<artefact>`` to columns; robots: by data set; draws: accepted draws of
    which every family is made. A data set with ``pose_errors`` is measured.
    """
    found = []
    for name, arm in robots.items():
        if f"{name}/pose_errors" in tables:
            errors, seen = (tables[f"{name}/{which}"] for which in ("pose_errors", "measurements"))
            found.append(of_measurements(name, arm, errors, seen))
        else:
            found.append(of_points(name, arm, tables[f"{name}/assessment_points"]))
    return found + [synthetic(family, draw) for family in FAMILIES for draw in draws]

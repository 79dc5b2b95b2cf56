"""What a campaign fixes before its first reading: points and their order, assessor, instruments."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from functools import cached_property
from typing import Annotated, Any, Literal, get_type_hints

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, NonNegativeInt, ValidationError, create_model

from kinacc.assess.adaptive import AdaptiveAssessor, Candidates
from kinacc.assess.registry import ADAPTIVE
from kinacc.campaign.instrument import Instrument, Numbers
from kinacc.config import json_files
from kinacc.config.load import problems_of
from kinacc.config.settings import Study
from kinacc.errors import InputError, Problem, refuse
from kinacc.geometry import Pose

METHOD = 2  # of the bounds: raised where the same readings give other bounds
# Settings that earlier plans state, with the defaults they had.
_FORMER = {"correct_drift": False, "assume": "nothing", "isolation": 1.25, "crowd": 0.05}


@dataclass(frozen=True)
class Points:
    """The m candidates: reported joints (m, k) rad (mm where a joint slides) and travel (m, k).

    ``modelled_mm`` (m, 3): position in the robot's base as the calibration predicts it;
    ``slope`` (m, 3, k): its derivative by the reported joints. ``label``: names for people.
    """

    label: tuple[str, ...]
    joints: np.ndarray
    directions: np.ndarray | None
    modelled_mm: np.ndarray
    slope: np.ndarray

    def __len__(self) -> int:
        return len(self.label)

    def number(self, label: str) -> int | None:
        """The point of a name, with or without spaces about it; None where there is none."""
        return self._numbers.get(label.strip())

    @cached_property
    def _numbers(self) -> dict[str, int]:
        return {label.strip(): number for number, label in enumerate(self.label)}

    def position_mm(self, point: int, joints: np.ndarray | None) -> np.ndarray:
        """Modelled position (3,) at the joints reported on the spot, near those of the point."""
        if joints is None:
            return self.modelled_mm[point]
        return self.modelled_mm[point] + self.slope[point] @ (joints - self.joints[point])


@dataclass(frozen=True)
class Limits:
    """What a reading must keep to be taken, and what the campaign is for (None: not stated).

    ``joint_rad``: largest distance of reported joints from those of the pose; ``implausible_mm``:
    error beyond which a reading is refused, infinite where the plan is to derive it. ``width_mm``
    is wanted of the bounds on ``target``.
    """

    joint_rad: float = float(np.deg2rad(0.02))
    implausible_mm: float = math.inf
    tolerance_mm: float | None = None
    width_mm: float | None = None
    target: Literal["measured", "candidates", "region"] = "candidates"


@dataclass(frozen=True)
class Plan:
    """A campaign before any reading.

    ``order`` (m,) is the random order of the candidates; ``route`` the points of the first visit
    in the order they are driven to. ``to_base`` takes the instrument's frame to the robot's base.
    ``slides`` (k,): which joints slide. ``about`` names robot, calibration, model and point.
    ``overruled``: what spoke against beginning it so, a sentence each. ``method``: of the bounds.
    """

    points: Points
    order: np.ndarray
    route: np.ndarray
    assessor: AdaptiveAssessor
    instruments: tuple[Instrument, ...]
    to_base: Pose
    slides: np.ndarray
    limits: Limits
    seed: int
    about: Mapping[str, str]
    overruled: tuple[str, ...] = ()
    method: int = METHOD

    @cached_property
    def covariance_mm2(self) -> np.ndarray:
        """Covariances (m, 3, 3) of a reading of the first instrument at each of the points, in the
        robot's base."""
        return self.instruments[0].in_base(self.to_base, self.points.modelled_mm)

    @property
    def by_travel(self) -> bool:
        """Whether the first visit is made in order of travel."""
        return not np.array_equal(self.route, self.order[: len(self.route)])

    def instrument(self, name: str | None) -> Instrument:
        """An instrument by name, the first where none is named. InputError for another name."""
        if name is None:
            return self.instruments[0]
        devices = {device.name: device for device in self.instruments}
        if name not in devices:
            raise InputError(Problem("instrument", f"{name!r} is not there", ", ".join(devices)))
        return devices[name]

    def visiting(self, left_out: frozenset[int]) -> np.ndarray:
        """Points in the order in which the assessor numbers them, without those left out.

        The points of the first visit are the first of the random order; among themselves they come
        as the route has them, for all of them are visited before anything is decided.
        """
        order = np.array([point for point in self.order if point not in left_out], dtype=int)
        first = self.assessor.begin(self.candidates(order)).first
        place = np.full(len(self.points), len(self.points))
        place[self.route] = np.arange(len(self.route))
        head = order[:first]
        return np.concatenate([head[np.argsort(place[head], kind="stable")], order[first:]])

    def candidates(self, rows: np.ndarray) -> Candidates:
        """The candidates in the order of ``rows``, with the noise of the first instrument."""
        return Candidates(self.covariance_mm2[rows])


# Found in 98 % of campaigns with a drift of three standard deviations, for a tenth of the width.
_REFERENCES, _LEAST_BUDGET, _LEAST_READINGS = 20, 1.4, 100


def assessor_of(
    name: str, settings: Mapping[str, object], points: float = math.inf
) -> AdaptiveAssessor:
    """Return an assessor.

    Parameters
    ----------
    name : str
        Name of an adaptive assessor.
    settings : mapping
        Its settings; ``measurements`` is the budget. What it shares with ``study`` of the
        configuration has the limits and the default that it has there.
    points : int, optional
        Number of candidates: 20 ``references`` are the default where the budget has them.

    Returns
    -------
    AdaptiveAssessor

    Raises
    ------
    InputError
        For unknown names and settings, and for values of another type.
    """
    if name not in ADAPTIVE:
        raise InputError(Problem("--assessor", f"{name!r} is not there", ", ".join(ADAPTIVE)))
    kinds = get_type_hints(ADAPTIVE[name])
    stated: dict[str, Any] = {}
    for item in fields(ADAPTIVE[name]):
        default = ... if item.default is MISSING else item.default
        # A campaign's budget is its own: it may be larger than that of a simulation.
        shared = Study.model_fields if item.name != "measurements" else {}
        stated[item.name] = (kinds[item.name], shared.get(item.name, default))
    unknown = [key for key in settings if key not in stated]
    allowed = ", ".join(stated)
    refuse(Problem(f"setting {key} of {name}", "is not there", allowed) for key in unknown)
    model = create_model(name, __config__=ConfigDict(strict=True), **stated)
    try:
        values = model.model_validate(settings).model_dump()
    except ValidationError as error:
        raise InputError(problems_of(error, lambda path: f"setting {path[0]} of {name}")) from None
    enough = values["measurements"] >= max(_LEAST_BUDGET * points, _LEAST_READINGS)
    if "references" in values and "references" not in settings and enough:
        values["references"] = _REFERENCES
    return ADAPTIVE[name](**values)


class _Point(BaseModel):
    label: str
    joints: Numbers
    directions: Numbers | None
    modelled_mm: Numbers
    slope: Numbers


class _Pose(BaseModel):
    rotation: Numbers
    position_mm: Numbers


class _Assessor(BaseModel):
    name: str
    settings: dict[str, Any]


class _Arm(BaseModel):
    prismatic: list[bool]


class _File(BaseModel):
    """File of a plan."""

    format: Literal[1] = 1
    method: int = 1
    about: dict[str, str]
    assessor: _Assessor
    instruments: Annotated[tuple[Instrument, ...], Field(min_length=1)]
    to_base: _Pose
    arm: _Arm
    limits: Limits
    seed: NonNegativeInt
    order: list[int]
    route: list[int]
    overruled: tuple[str, ...] = ()
    points: Annotated[list[_Point], Field(min_length=1)]


def to_json(plan: Plan) -> bytes:
    """Return the plan as text; ``from_json`` gives back equal numbers."""
    points, names = plan.points, [*_Point.model_fields]
    columns = [getattr(points, name) for name in names]
    columns = [[None] * len(points) if column is None else column for column in columns]
    file = _File.model_construct(
        method=plan.method,
        about=dict(plan.about),
        assessor=_Assessor(name=plan.assessor.name, settings=vars(plan.assessor)),
        instruments=plan.instruments,
        to_base=_Pose.model_construct(**plan.to_base._asdict()),
        arm=_Arm(prismatic=plan.slides.tolist()),
        limits=plan.limits,
        seed=plan.seed,
        order=plan.order.tolist(),
        route=plan.route.tolist(),
        overruled=plan.overruled,
        points=[
            _Point.model_construct(**dict(zip(names, row, strict=True)))
            for row in zip(*columns, strict=True)
        ],
    )
    return (json.dumps(file.model_dump()) + "\n").encode()


def from_json(text: bytes, where: str) -> Plan:
    """Return the plan written by ``to_json``. Raises InputError where it cannot be read."""
    try:
        return _plan(_File.model_validate(json_files.values_of(text, where)))
    except (RecursionError, TypeError, ValueError) as error:
        message = f"is no campaign: {' '.join(str(error).split())[:200]}"
        raise InputError(Problem(where, message, fix="bring it back from a copy")) from None


def _plan(file: _File) -> Plan:
    rows, turned = file.points, [row.directions is not None for row in file.points]
    points = Points(
        tuple(row.label for row in rows),
        np.array([row.joints for row in rows]),
        np.array([row.directions for row in rows], dtype=np.int8) if all(turned) else None,
        np.array([row.modelled_mm for row in rows]),
        np.array([row.slope for row in rows]),
    )
    to_base = Pose(file.to_base.rotation, file.to_base.position_mm)
    slides, (count, joints) = np.array(file.arm.prismatic), points.joints.shape
    shapes = [
        (points.modelled_mm, (count, 3)),
        (points.slope, (count, 3, joints)),
        (slides, (joints,)),
        (to_base.rotation, (3, 3)),
        (to_base.position_mm, (3,)),
        *((device.covariance_mm2, (3, 3)) for device in file.instruments),
    ]
    valid = {
        "shape": all(array.shape == shape for array, shape in shapes),
        "directions": all(turned) or not any(turned),
        "order": sorted(file.order) == list(range(count)),
        "route": {*file.route} <= {*file.order},
        "about": {"robot", "calibration", "model", "point"} <= {*file.about},
    }
    if wrong := [name for name, holds in valid.items() if not holds]:
        raise ValueError(f"{', '.join(wrong)} does not fit the rest")
    settings = file.assessor.settings
    used = [key for key, value in _FORMER.items() if settings.get(key, value) != value]
    fix = "begin a new campaign; readings can be recorded in it again"
    refuse(Problem(f"setting {key}", "is gone from kinacc", fix=fix) for key in used)
    known = {key: value for key, value in settings.items() if key not in _FORMER}
    return Plan(
        points,
        np.array(file.order),
        np.array(file.route),
        assessor_of(file.assessor.name, known),
        file.instruments,
        to_base,
        slides,
        file.limits,
        file.seed,
        file.about,
        file.overruled,
        file.method,
    )

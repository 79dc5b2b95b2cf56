"""What a campaign fixes before its first reading: points and their order, assessor, instruments."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    NonNegativeInt,
    PlainSerializer,
    PlainValidator,
    ValidationError,
    model_validator,
)

from kinacc.assess.adaptive import AdaptiveAssessor, Candidates
from kinacc.assess.registry import ADAPTIVE
from kinacc.assess.statement import CANDIDATES, MEASURED, REGION
from kinacc.campaign.instrument import Instrument, finite
from kinacc.config import json_files
from kinacc.config.problems import problems_of
from kinacc.errors import InputError, Problem, input_error, refuse
from kinacc.geometry import Pose

TARGETS = (CANDIDATES, REGION, MEASURED)  # of bounds: those on all candidates stand first
METHOD = 2  # of the bounds: raised where the same readings give other bounds
# Settings that earlier plans state, with the defaults they had.
_FORMER = {
    "correct_drift": False,
    "assume": "nothing",
    "isolation": 1.25,
    "crowd": 0.05,
    "deviations": 1.0,
}


@dataclass(frozen=True)
class Points:
    """The m candidates: reported joints (m, k) rad (mm where a joint slides) and travel (m, k).

    ``modelled_mm`` (m, 3): position in the robot's base as the calibration predicts it;
    ``slope`` (m, 3, k): its derivative by the reported joints. ``label``: names for people.
    """

    label: tuple[str, ...]
    joints: np.ndarray
    modelled_mm: np.ndarray
    slope: np.ndarray
    directions: np.ndarray | None = None

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

    @classmethod
    def of(cls, rows: Any) -> Points:
        """The points of a list of mappings, as :meth:`rows` returns them."""
        if isinstance(rows, Points):
            return rows
        label = tuple(row["label"].strip() for row in rows)
        arrays = {
            name: finite([row[name] for row in rows]) for name in ("joints", "modelled_mm", "slope")
        }
        count, joints = arrays["joints"].shape
        shapes = arrays["modelled_mm"].shape, arrays["slope"].shape
        if shapes != ((count, 3), (count, 3, joints)):
            raise ValueError(f"points of shapes {shapes}")
        if rows[0]["directions"] is not None:
            directions = finite([row["directions"] for row in rows])
            arrays["directions"] = directions.astype(np.int8)
        return cls(label, **arrays)

    def rows(self) -> list[dict[str, Any]]:
        """A mapping for each point."""
        return [
            {name: None if column is None else column[row] for name, column in vars(self).items()}
            for row in range(len(self))
        ]


@dataclass(frozen=True)
class Limits:
    """What a reading must keep to be taken, and what the campaign is for (None: not stated).

    ``joint_rad``: largest distance of reported joints from those of the pose; ``implausible_mm``:
    error beyond which a reading is refused, infinite where the plan is to derive it.
    """

    joint_rad: FiniteFloat = float(np.deg2rad(0.02))
    implausible_mm: FiniteFloat = math.inf
    tolerance_mm: float | None = None


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
        Its settings; ``measurements`` is the budget.
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
        raise input_error("--assessor", f"{name!r} is not there", ", ".join(ADAPTIVE))
    kind = ADAPTIVE[name]
    allowed = [item.name for item in fields(kind)]
    refuse(
        Problem(f"setting {key} of {name}", "is not there", ", ".join(allowed))
        for key in settings
        if key not in allowed
    )
    try:
        assessor: AdaptiveAssessor = kind(**settings)
    except ValidationError as error:
        raise InputError(problems_of(error, lambda path: f"setting {path[0]} of {name}")) from None
    enough = assessor.measurements >= max(_LEAST_BUDGET * points, _LEAST_READINGS)
    if enough and "references" in allowed and "references" not in settings:
        return kind(**settings, references=_REFERENCES)
    return assessor


def _recorded(value: Any) -> AdaptiveAssessor:
    """The assessor of a file, or one that is there already."""
    if not isinstance(value, Mapping):
        return value
    return assessor_of(value["name"], dict(value["settings"].items() - _FORMER.items()))


def _pose(value: Any) -> Pose:
    pose = value if isinstance(value, Pose) else Pose(*map(finite, map(value.get, Pose._fields)))
    if pose.rotation.shape != (3, 3) or pose.position_mm.shape != (3,):
        raise ValueError("no pose")
    return pose


class Arm(BaseModel):
    """Which joints slide; plans of earlier versions have more of the arm."""

    prismatic: list[bool]


class Plan(BaseModel):
    """A campaign before any reading, as its file has it.

    ``order`` (m,) is the random order of the candidates; ``route`` the points of the first visit
    in the order they are driven to. ``to_base`` takes the instrument's frame to the robot's base.
    ``about`` names robot, calibration, model and point.
    ``overruled``: doubts at the start that were overruled. ``method``: of the bounds.
    """

    model_config = ConfigDict(frozen=True)

    format: Literal[1] = 1
    method: int = METHOD
    about: dict[str, str]
    assessor: Annotated[
        AdaptiveAssessor,
        PlainValidator(_recorded),
        PlainSerializer(lambda assessor: {"name": assessor.name, "settings": vars(assessor)}),
    ]
    instruments: Annotated[tuple[Instrument, ...], Field(min_length=1)]
    to_base: Annotated[Pose, PlainValidator(_pose), PlainSerializer(lambda pose: pose._asdict())]
    arm: Arm
    limits: Limits
    seed: NonNegativeInt
    order: Annotated[np.ndarray, PlainValidator(np.array)]
    route: Annotated[np.ndarray, PlainValidator(np.array)]
    overruled: tuple[str, ...] = ()
    points: Annotated[Points, PlainValidator(Points.of), PlainSerializer(Points.rows)]

    @model_validator(mode="after")
    def _fits(self) -> Self:
        count, joints = self.points.joints.shape
        valid = {
            "instruments": all(item.covariance_mm2.shape == (3, 3) for item in self.instruments),
            "arm": self.slides.shape == (joints,),
            "order": sorted(self.order) == list(range(count)),
            "route": {*self.route} <= {*self.order},
        }
        if wrong := [name for name, holds in valid.items() if not holds]:
            raise ValueError(f"{', '.join(wrong)} does not fit the rest")
        return self

    @cached_property
    def slides(self) -> np.ndarray:
        """Which joints slide (k,)."""
        return np.array(self.arm.prismatic)

    @cached_property
    def covariance_mm2(self) -> np.ndarray:
        """Covariances (m, 3, 3) of a reading of the first instrument at each of the points, in the
        robot's base."""
        return self.instruments[0].in_base(self.to_base, self.points.modelled_mm)

    def instrument(self, name: str | None) -> Instrument:
        """An instrument by name, the first where none is named. InputError for another name."""
        if name is None:
            return self.instruments[0]
        devices = {device.name: device for device in self.instruments}
        if name not in devices:
            raise input_error("instrument", f"{name!r} is not there", ", ".join(devices))
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


def to_json(plan: Plan) -> bytes:
    """Return the plan as text; ``from_json`` gives back equal numbers."""
    return (json.dumps(plan.model_dump(), default=lambda array: array.tolist()) + "\n").encode()


@lru_cache(maxsize=4)  # every reading that is added looks at the plan of its campaign three times
def from_json(text: bytes, where: str) -> Plan:
    """Return the plan written by ``to_json``. Raises InputError where it cannot be read."""
    try:
        plan = Plan.model_validate({"method": 1, **json_files.values_of(text, where)})
        if not {"robot", "calibration", "model", "point", "candidates"} <= {*plan.about}:
            raise ValueError("about does not fit the rest")
    except (AttributeError, LookupError, RecursionError, TypeError, ValueError) as error:
        message = f"is no campaign: {' '.join(str(error).split())[:200]}"
        raise input_error(where, message, fix="bring it back from a copy") from None
    return plan

"""What a campaign fixes before its first reading: points and their order, assessor, instruments."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property

import numpy as np
from pydantic import ValidationError

from kinacc.assess.adaptive import AdaptiveAssessor, Candidates
from kinacc.assess.registry import ADAPTIVE
from kinacc.assess.statement import CANDIDATES, TARGETS
from kinacc.campaign.instrument import FRAMES, Instrument
from kinacc.campaign.laser_tracker import LaserTracker
from kinacc.config import json_files
from kinacc.config.load import problems_of
from kinacc.config.settings import Study
from kinacc.errors import InputError, Problem, refuse
from kinacc.geometry import Pose

FORMAT = 1
METHOD = 2  # of the bounds: raised where the same readings give other bounds
_ABOUT = ("robot", "calibration", "model", "point")


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

    ``width_mm`` is wanted of the bounds on ``target``.
    """

    joint_rad: float
    implausible_mm: float
    tolerance_mm: float | None = None
    width_mm: float | None = None
    target: str = CANDIDATES


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
        first = fixed_visit(self.assessor, self.candidates(order))
        place = np.full(len(self.points), len(self.points))
        place[self.route] = np.arange(len(self.route))
        head = order[:first]
        return np.concatenate([head[np.argsort(place[head], kind="stable")], order[first:]])

    def candidates(self, rows: np.ndarray) -> Candidates:
        """The candidates in the order of ``rows``, with the noise of the first instrument."""
        return Candidates(self.covariance_mm2[rows])


def fixed_visit(assessor: AdaptiveAssessor, candidates: Candidates) -> int:
    """Number of points that are visited whatever is read: rows 0, 1, .. in order."""
    return assessor.begin(candidates).first


def assessor_of(name: str, settings: Mapping[str, object]) -> AdaptiveAssessor:
    """An assessor by name with its settings. Raises InputError for unknown names and settings.

    What it shares with the configuration's ``study`` is held to the schema and defaults to it.
    """
    if name not in ADAPTIVE:
        raise InputError(Problem("--assessor", f"{name!r} is not there", ", ".join(ADAPTIVE)))
    known = {field.name: field for field in fields(ADAPTIVE[name])}
    # A campaign's budget is its own: it may be larger than that of a simulation.
    free = {*known} - {"measurements"}
    shared = free & {*Study.model_fields}
    asked = {key: value for key, value in settings.items() if key in shared}
    problems: list[Problem] = []
    try:
        Study.model_validate(asked)
    except ValidationError as error:
        problems += problems_of(error, lambda path: f"setting {path[0]} of {name}")
    for key, value in settings.items():
        where = f"setting {key} of {name}"
        if key not in known:
            problems.append(Problem(where, "is not there", ", ".join(known)))
        elif key not in shared and not _is_like(value, known[key].default):
            allowed = {str: "a word", bool: "true or false"}.get(type(known[key].default))
            problems.append(Problem(where, f"{value!r}"[:60], allowed or "a number"))
    refuse(problems)
    defaults = {key: getattr(Study(), key) for key in shared}
    return ADAPTIVE[name](**{**defaults, **settings})


# Found in 98 % of campaigns with a drift of three standard deviations, for a tenth of the width.
_REFERENCES, _LEAST_BUDGET, _LEAST_READINGS = 20, 1.4, 100


def with_references(
    assessor: AdaptiveAssessor, points: int, references: int | None = None
) -> AdaptiveAssessor:
    """Return the assessor with 20 reference readings where the budget has them.

    ``references``: None where their number is not given; ``points``: number of candidates.
    """
    enough = assessor.measurements >= max(_LEAST_BUDGET * points, _LEAST_READINGS)
    if references is not None or not enough or not hasattr(assessor, "references"):
        return assessor
    return replace(assessor, references=_REFERENCES)


def _is_like(value: object, default: object) -> bool:
    """Whether a value is of the kind of a setting's default; a number where that tells none."""
    if isinstance(default, (str, bool)):
        return type(value) is type(default)
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return number or value is default


def to_json(plan: Plan) -> bytes:
    """Return the plan as text; ``from_json`` gives back equal numbers."""
    points, directions = plan.points, plan.points.directions
    content = {
        "format": FORMAT,
        "method": plan.method,
        "about": dict(plan.about),
        "assessor": {"name": plan.assessor.name, "settings": asdict(plan.assessor)},
        "instruments": list(map(asdict, plan.instruments)),
        "to_base": {
            "rotation": plan.to_base.rotation,
            "position_mm": plan.to_base.position_mm,
        },
        "arm": {"prismatic": plan.slides},
        "limits": asdict(plan.limits),
        "seed": plan.seed,
        "order": plan.order,
        "route": plan.route,
        "overruled": plan.overruled,
        "points": [
            {
                "label": label,
                "joints": points.joints[i],
                "directions": None if directions is None else directions[i],
                "modelled_mm": points.modelled_mm[i],
                "slope": points.slope[i],
            }
            for i, label in enumerate(points.label)
        ],
    }
    return (json.dumps(content, default=lambda array: array.tolist()) + "\n").encode()


def from_json(text: bytes, where: str) -> Plan:
    """Return the plan written by ``to_json``. Raises InputError where it cannot be read."""
    try:
        return _plan(json_files.values_of(text, where))
    except (AttributeError, LookupError, RecursionError, TypeError, ValueError) as error:
        message = f"is no campaign: {' '.join(str(error).split())[:200]}"
        raise InputError(Problem(where, message, fix="bring it back from a copy")) from None


def _plan(file: Mapping) -> Plan:
    rows, about = file["points"], file["about"]
    count, joints = len(rows), len(rows[0]["joints"])

    def array(value: object, *shape: int) -> np.ndarray:
        numbers = np.array(value, dtype=float)
        if numbers.shape != shape or not np.isfinite(numbers).all():
            raise ValueError(f"{numbers.shape} numbers where {shape} are expected")
        return numbers

    turned = rows[0]["directions"] is not None
    directions = array([row["directions"] for row in rows], count, joints) if turned else None
    points = Points(
        tuple(row["label"] for row in rows),
        array([row["joints"] for row in rows], count, joints),
        None if directions is None else directions.astype(np.int8),
        array([row["modelled_mm"] for row in rows], count, 3),
        array([row["slope"] for row in rows], count, 3, joints),
    )
    instruments = tuple(
        Instrument(
            item["name"],
            array(item["covariance_mm2"], 3, 3),
            {name: name for name in FRAMES}[item["frame"]],
            LaserTracker(**item["laser"]) if item.get("laser") else None,
            float(item.get("resolution_mm", 0.0)),
        )
        for item in file["instruments"]
    )
    limits = Limits(**file["limits"])
    array([limits.joint_rad, limits.implausible_mm], 2)
    valid = {
        "format": file["format"] == FORMAT,
        "instruments": len(instruments) > 0,
        "order": sorted(file["order"]) == list(range(count)),
        "route": {*file["route"]} <= {*file["order"]},
        "seed": isinstance(file["seed"], int) and file["seed"] >= 0,
        "about": {*_ABOUT} <= {*about},
        "target": limits.target in TARGETS,
        "texts": all(isinstance(text, str) for text in (*points.label, *about.values())),
    }
    if wrong := [name for name, holds in valid.items() if not holds]:
        raise ValueError(f"{', '.join(wrong)} does not fit the rest")
    to_base = file["to_base"]
    return Plan(
        points, np.array(file["order"]), np.array(file["route"]),
        _recorded_assessor(**file["assessor"]), instruments,
        Pose(array(to_base["rotation"], 3, 3), array(to_base["position_mm"], 3)),
        array(file["arm"]["prismatic"], joints).astype(bool), limits, file["seed"], about,
        tuple(file.get("overruled", ())), file.get("method", 1),
    )  # fmt: skip


# Settings that earlier plans state, with the defaults they had.
_FORMER = {"correct_drift": False, "assume": "nothing", "isolation": 1.25, "crowd": 0.05}


def _recorded_assessor(name: str, settings: Mapping[str, object]) -> AdaptiveAssessor:
    used = [key for key, value in _FORMER.items() if settings.get(key, value) != value]
    fix = "begin a new campaign; readings can be recorded in it again"
    refuse(Problem(f"setting {key}", "is gone from kinacc", fix=fix) for key in used)
    return assessor_of(name, {k: value for k, value in settings.items() if k not in _FORMER})


def digest(text: bytes) -> str:
    """Short content hash of a plan's file."""
    return hashlib.sha256(text).hexdigest()[:16]

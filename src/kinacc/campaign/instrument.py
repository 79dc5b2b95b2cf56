"""Noise of one reading: instruments, laser trackers, and the noise of a repeatability test."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    PlainSerializer,
    PlainValidator,
    TypeAdapter,
    ValidationError,
)

from kinacc.assess.adaptive import COVARIANCE, are_covariances
from kinacc.assess.noise import ENOUGH, FEWEST
from kinacc.config import json_files
from kinacc.config.names import not_in_a_line
from kinacc.errors import Problem, gathered, input_error, refuse
from kinacc.geometry import Pose
from kinacc.measurements.table import numbers_of

Frame = Literal["base", "instrument"]
BASE: Frame = "base"
INSTRUMENT: Frame = "instrument"
LASER = "laser:"
_FORMS = "1 standard deviation, 3 (x, y, z), or 9 numbers of a covariance in mm^2, row by row"
_LASER_FORM = (
    f"{LASER}range_mm=..,range_um_per_m=..,angle_mm=..,angle_um_per_m=..,repeat_mm=.., standard "
    "deviations (0 where a key is left out; 1 um/m is 1 urad)"
)
_ROUNDED = 1.0 / math.sqrt(12.0)  # standard deviation of what is rounded to steps of 1
_LARGEST_STD_MM = 1e3
_SMALLEST_STD_MM = 1e-9  # below the size of an atom; squares of less vanish


def finite(value: object) -> np.ndarray:
    """Return numbers as an array; ValueError where one is not finite."""
    numbers = np.array(value, dtype=float)
    if not np.isfinite(numbers).all():
        raise ValueError("numbers that are not finite")
    return numbers


# Arrays in files of JSON.
Numbers = Annotated[
    np.ndarray, PlainValidator(finite), PlainSerializer(lambda array: array.tolist())
]


_Size = Annotated[float, Field(ge=0.0, lt=1e3)]


@dataclass(frozen=True, kw_only=True)
class LaserTracker:
    """Standard deviations of a tracker whose head is the origin of its frame.

    ``range``: along the beam, ``angle``: in each of the two directions across it; a part in mm, and
    one in um for each m of distance. ``repeat_mm``: how well the arm repeats a pose, per axis.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    range_mm: _Size = 0.0
    range_um_per_m: _Size = 0.0
    angle_mm: _Size = 0.0
    angle_um_per_m: _Size = 0.0
    repeat_mm: _Size

    def __post_init__(self) -> None:
        if np.min(self.std_mm(np.array([1e3]))) <= _SMALLEST_STD_MM:
            raise ValueError("range and angle must be above 0")

    def std_mm(self, distance_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Standard deviations (m,) along the beam and across it, without that of the arm."""
        along = self.range_mm + 1e-6 * self.range_um_per_m * distance_mm
        across = self.angle_mm + 1e-6 * self.angle_um_per_m * distance_mm
        return along, across

    def covariance_mm2(self, from_head_mm: np.ndarray) -> np.ndarray:
        """Covariances (m, 3, 3) of readings at ``from_head_mm`` (m, 3), in the axes of these."""
        distance_mm = np.linalg.norm(from_head_mm, axis=1)
        along, across = self.std_mm(distance_mm)
        with np.errstate(invalid="ignore"):
            beam = np.nan_to_num(from_head_mm / distance_mm[:, None])
        outer = beam[:, :, None] * beam[:, None, :]
        even = (across**2 + self.repeat_mm**2)[:, None, None] * np.eye(3)
        return even + (along**2 - across**2)[:, None, None] * outer


@dataclass(frozen=True)
class Instrument:
    """Covariance (3, 3) of one reading, mm^2, in the frame of the instrument's readings.

    ``frame``: ``base``, the robot's own base, or ``instrument``, that of the calibration. With
    ``laser`` it depends on the place, and ``covariance_mm2`` is the largest, equal in all
    directions. ``resolution_mm``: step in which readings are written, whose rounding the
    covariance includes; 0 where it is not stated.
    """

    name: str
    covariance_mm2: Numbers
    frame: Frame
    laser: LaserTracker | None = None
    resolution_mm: float = 0.0

    def in_base(self, to_base: Pose, at_mm: np.ndarray) -> np.ndarray:
        """Covariances (m, 3, 3) in the robot's base of readings at ``at_mm`` (m, 3) there.

        ``to_base`` takes the instrument's frame there.
        """
        covariance = np.tile(self.covariance_mm2, (len(at_mm), 1, 1))
        if self.laser is not None:
            from_head_mm = (at_mm - to_base.position_mm) @ to_base.rotation
            covariance = floored(self.laser.covariance_mm2(from_head_mm), self.resolution_mm)
        elif self.frame == BASE:
            return covariance
        turned = to_base.rotation @ covariance @ to_base.rotation.T
        return 0.5 * (turned + np.swapaxes(turned, 1, 2))

    def placed(self, to_base: Pose, at_mm: np.ndarray) -> Instrument:
        """The instrument with the largest covariance that it has at places (m, 3) in the base."""
        if self.laser is None:
            return self
        variances_mm2 = np.linalg.eigvalsh(self.in_base(to_base, at_mm))
        return replace(self, covariance_mm2=variances_mm2.max() * np.eye(3))

    def of_reading(self, std: str) -> Instrument:
        """The same instrument with the noise of one reading: 1, 3 or 9 numbers as text."""
        covariance = floored(covariance_of(std, "reading"), self.resolution_mm)
        return replace(self, covariance_mm2=covariance, laser=None)

    @property
    def noise(self) -> str:
        """The noise in few words."""
        std = np.sqrt(np.diag(self.covariance_mm2))
        axes = std[:1] if np.all(std == std[0]) else std
        text = f"{', '.join(f'{axis:.4g}' for axis in axes)} mm per axis"
        if self.laser is not None:
            stated = (f"{name} {value:g}" for name, value in vars(self.laser).items() if value)
            text += f", less at nearer candidates (laser: {', '.join(stated)})"
        if np.triu(self.covariance_mm2, 1).any():
            text += ", correlated"
        if self.resolution_mm:
            text += f", read in steps of {self.resolution_mm:g} mm"
        return text


def floored(covariance_mm2: np.ndarray, resolution_mm: float) -> np.ndarray:
    """Covariances (..., 3, 3) with no variance of an axis below that of rounding to steps."""
    lacking = (_ROUNDED * resolution_mm) ** 2 - np.diagonal(covariance_mm2, axis1=-2, axis2=-1)
    return covariance_mm2 + np.maximum(lacking, 0.0)[..., None] * np.eye(3)


def instruments(
    texts: Iterable[str], frame: Frame, resolution_mm: float = 0.0
) -> tuple[Instrument, ...]:
    """Return the instruments of arguments.

    Parameters
    ----------
    texts : iterable of str
        ``tracker=0.03``, ``camera=0.1,0.1,0.3``, nine numbers of a covariance in mm^2, or
        ``tracker=laser:range_mm=..,repeat_mm=..`` (:class:`LaserTracker`).
    frame : {"base", "instrument"}
        Frame of readings and covariances.
    resolution_mm : float
        Step in which readings are written.

    Returns
    -------
    tuple of Instrument

    Raises
    ------
    InputError
        Naming everything that is wrong with any of them.
    """
    devices: dict[str, Instrument] = {}
    problems: list[Problem] = []
    for text in texts:
        with gathered(problems):
            device = _instrument(text, frame, resolution_mm)
            if device.name in devices:
                raise input_error(f"instrument {device.name}", "is given twice")
            devices[device.name] = device
    refuse(problems, "These instruments cannot be used")
    return tuple(devices.values())


def _instrument(text: str, frame: Frame, resolution_mm: float) -> Instrument:
    name, equals, noise = (part.strip() for part in text.partition("="))
    if not equals or not name:
        raise input_error("--instrument", repr(text), f"NAME={_FORMS}")
    refuse(not_in_a_line("--instrument", name))
    where, laser = f"noise of {name}", None
    if not noise.startswith(LASER):
        covariance = covariance_of(noise, where)
    elif frame == BASE:
        message = "a laser tracker's noise depends on where it stands"
        raise input_error(where, message, "--frame instrument")
    else:
        laser = _laser(noise, where)
        covariance = laser.covariance_mm2(np.zeros((1, 3)))[0]
    return Instrument(name, floored(covariance, resolution_mm), frame, laser, resolution_mm)


def covariance_of(text: str, where: str) -> np.ndarray:
    """Return the covariance (3, 3) of a text with 1, 3 or 9 numbers.

    Raises InputError naming ``where`` for other texts, and for numbers that are no noise.
    """
    values = numbers_of(text)
    if values.size == 9:
        covariance = values.reshape(3, 3)
        if not are_covariances(covariance[None]).all():
            raise input_error(where, "is no covariance", COVARIANCE)
        return covariance
    if values.size not in (1, 3):
        raise input_error(where, repr(text), _FORMS)
    if not ((values >= _SMALLEST_STD_MM) & (values <= _LARGEST_STD_MM)).all():
        allowed = f"at least {_SMALLEST_STD_MM:g} mm, at most {_LARGEST_STD_MM:g} mm"
        raise input_error(where, f"standard deviation {text.strip()} mm", allowed)
    return np.diag(np.broadcast_to(values, 3) ** 2)


def _laser(text: str, where: str) -> LaserTracker:
    """The tracker of a text that begins with ``laser:``."""
    parts = [part.partition("=")[::2] for part in text.removeprefix(LASER).split(",")]
    values = {name.strip(): value.strip() for name, value in parts}
    wrong = ["a key twice"] if len(values) < len(parts) else []
    try:
        tracker = TypeAdapter(LaserTracker).validate_python(values)
    except ValidationError as error:
        wrong += [" ".join(map(str, (*item["loc"], item["msg"]))) for item in error.errors()]
    if wrong:
        raise input_error(where, f"{text!r} ({'; '.join(wrong)})", _LASER_FORM)
    return tracker


class _Noise(BaseModel):
    covariance_mm2: Numbers
    freedom: FiniteFloat


class _Test(BaseModel):
    """File of ``kinacc repeatability``; ``poses_differ``: that some poses scatter more."""

    format: Literal["kinacc repeatability 1"]
    file: str
    noise: _Noise | None
    poses_differ: str | None


def read_repeatability(path: str | Path) -> tuple[np.ndarray, int, list[Problem]]:
    """Return the noise of a file that ``kinacc repeatability -o`` wrote.

    Parameters
    ----------
    path : path
        JSON file.

    Returns
    -------
    covariance_mm2 : (3, 3) array
        In mm^2, in the frame of the readings of the test.
    freedom : int
        Degrees of freedom.
    doubts : list of Problem
        Why a campaign should not take one noise for all poses; empty where nothing shows it.

    Raises
    ------
    InputError
        Where the file holds no noise, or too few degrees of freedom.
    """
    where, fix = f"--repeatability {path}", "write it with kinacc repeatability FILE -o noise.json"
    try:
        content = json_files.values_of(json_files.bytes_of(path), str(path))
        test = _Test.model_validate(content)
    except OSError:
        raise input_error(where, "no such file", fix=fix) from None
    except (RecursionError, ValueError):
        raise input_error(where, "is no answer of kinacc repeatability", fix=fix) from None
    if test.noise is None:
        raise input_error(where, "has no noise: no pose was visited again", fix=fix)
    covariance, freedom = test.noise.covariance_mm2, int(test.noise.freedom)
    problems = []
    if not are_covariances(covariance[None]).all():
        problems.append(Problem(where, "has no covariance", COVARIANCE, fix))
    if freedom < FEWEST:
        allowed = f"at least {FEWEST}; {ENOUGH} are wanted"
        problems.append(Problem(where, f"{freedom} degrees of freedom", allowed, fix))
    refuse(problems)
    sure = "state the largest with --noise-mm; --sure takes that of all poses together"
    differ = Problem(f"--repeatability, {test.file}", test.poses_differ or "", fix=sure)
    return covariance, freedom, [differ] if test.poses_differ else []

"""Which parameters of a fit are free, fixed or known beforehand, as the configuration says.

A rule names what it is about: a DH parameter of every joint (``d``), a joint (``joint 3``), one
parameter (``joint 3 d``, or ``j3.d_mm`` as in the tables), a frame (``base``, ``tool``, a target)
or a component of it (``base rz``). The rule that says most about a parameter holds: ``joint 3 d``
before ``joint 3``, that before ``d``. It says ``free``, ``fixed`` (at the nominal value), or states
a value (fixed there), a prior standard deviation about the nominal value, or both.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from kinacc.config.fields import OrWord, Text, refused

FREE = "free"
FRAMES = "calibration.frames"
_IN_TABLES = {name: f"{name}_mm" for name in ("d", "a", "x", "y", "z")}
_IN_TABLES |= {name: f"{name}_rad" for name in ("theta_offset", "alpha", "beta", "rx", "ry", "rz")}
_IN_TABLES["theta"] = "theta_offset_rad"
_NAMES = f"{FRAMES} has base, base rz, tool x and the like, with x, y, z, rx, ry, rz; "
_NAMES += "calibration.dh.parameters d, joint 3, joint 3 d, with theta, d, a, alpha, beta"
_UNITS = {"mm": ("mm", 1.0), "rad": ("rad", 1.0), "mrad": ("rad", 1e-3)}
_UNITS["deg"] = ("rad", math.pi / 180.0)
_OF_JOINTS = re.compile(
    r"(?=.)(?:j(?:oint ?)?(?P<joint>\d{1,9})(?:[ .](?=.)|$))?"
    r"(?:(?P<parameter>theta_offset|theta|d|a|alpha|beta)(?:_mm|_rad)?)?"
)
_OF_FRAMES = re.compile(r"(?P<frame>[^ .]+)(?:[ .](?P<parameter>r?[xyz])(?:_mm|_rad)?)?")


@dataclass(frozen=True)
class Rule:
    """One rule: ``joint`` or ``frame`` and ``parameter`` (None for all) it is about.

    ``free``: estimated. ``value`` and ``std`` by unit (mm, rad): where stated.
    """

    name: str
    joint: int | None
    frame: str | None
    parameter: str | None
    free: bool
    value: Mapping[str, float]
    std: Mapping[str, float]


def rules(content: Mapping[str, Any], of_frames: bool = False) -> list[Rule]:
    """Rules about joints, or of frames, of names to ``free``, ``fixed``, or values by unit.

    Raises a validation error, at its name, for a rule that states nothing, the same twice, or a
    number that its parameter does not have.
    """
    results: dict[Any, Rule] = {}
    for name, state in content.items():
        text = " ".join(name.split())
        match = _OF_FRAMES.fullmatch(text) if of_frames else _OF_JOINTS.fullmatch(text.lower())
        if match is None:
            raise refused(f"{name!r} is no parameter", _NAMES, name)
        about: dict[str, str | None] = {"joint": None, "frame": None} | match.groupdict()
        parameter = _IN_TABLES.get(about["parameter"] or "")
        joint = int(about["joint"]) if about["joint"] else None
        subject = joint, about["frame"], parameter
        known: dict[str, dict[str, float]] = {"value": {}, "prior_std": {}}
        for key, number in state.items() if isinstance(state, Mapping) else ():
            kind, _, short = key.rpartition("_")
            known[kind][_UNITS[short][0]] = _UNITS[short][1] * number
        value, std = known["value"], known["prior_std"]
        wrong = {*value, *std} - {unit(parameter)} if parameter else {*value}
        message, fix = "", ""
        if subject in results:
            message = f"{name!r} is said twice, in two spellings"
        elif not isinstance(state, str) and len(value) + len(std) < max(len(state), 1):
            message = "states nothing, or the same in two units"
        elif any(item <= 0.0 for item in std.values()):
            message = "a standard deviation should be greater than 0"
        elif wrong:
            message = f"{', '.join(wrong)} is no unit of {parameter or 'no one parameter'}"
            fix = "name one parameter, and its unit"
        if message:
            raise refused(message, fix, name)
        results[subject] = Rule(name, *subject, state == FREE or bool(std), value, std)
    return [*results.values()]


def _about_joints(content: dict[str, Any]) -> dict[str, Any]:
    rules(content)
    return content


def _about_frames(content: dict[str, Any]) -> dict[str, Any]:
    rules(content, of_frames=True)
    return content


_Key = Annotated[str, Field(pattern="^(value|prior_std)_(mm|rad|mrad|deg)$")]
# Beyond, squares overflow.
_Known = dict[_Key, Annotated[float, Field(gt=-1e100, lt=1e100)]]
_Rules = dict[Text, OrWord[_Known, Literal["free", "fixed"]]]
JointRules = Annotated[_Rules, AfterValidator(_about_joints)]
FrameRules = Annotated[_Rules, AfterValidator(_about_frames)]


def rule_for(
    results: Sequence[Rule], parameter: str, joint: int | None = None, frame: str | None = None
) -> Rule | None:
    """The rule that says most about ``parameter`` of a joint (1-based) or of a frame."""
    about = [rule for rule in results if rule.parameter in (None, parameter)]
    about = [rule for rule in about if rule.frame == frame and rule.joint in (None, joint)]
    return max(about, key=lambda r: (bool(r.joint or r.frame), bool(r.parameter)), default=None)


def unit(parameter: str) -> str:
    """mm or rad, by the end of a parameter's name."""
    return parameter.rpartition("_")[2]

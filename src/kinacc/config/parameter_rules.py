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
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from kinacc.errors import Problem

FREE, FIXED = "free", "fixed"
_PARAMETERS = {name: f"{name}_rad" for name in ("theta_offset", "alpha", "beta")}
_PARAMETERS |= {"theta": "theta_offset_rad", "d": "d_mm", "a": "a_mm"}
_COMPONENTS = {name: f"{name}_mm" for name in "xyz"}
_COMPONENTS |= {f"r{name}": f"r{name}_rad" for name in "xyz"}
_UNITS = {"mm": ("mm", 1.0), "rad": ("rad", 1.0), "mrad": ("rad", 1e-3)}
_UNITS["deg"] = ("rad", math.pi / 180.0)
_LARGEST = 1e100  # beyond, squares overflow
_JOINT = re.compile(r"(?:joint ?|j)(\d{1,9})(?:[ .](\w+?)(?:_mm|_rad)?)?")
_FRAME = re.compile(r"([^ .]+)(?:[ .]+(r?[xyz])(?:_mm|_rad)?)?")
_SAID = re.compile("(value|prior_std)_(mm|rad|mrad|deg)")
JOINTS, FRAMES = "joints", "frames"
KEYS = {JOINTS: "calibration.dh.parameters", FRAMES: "calibration.frames"}
_NAMES = {
    JOINTS: "d, joint 3, joint 3 d and the like, with theta, d, a, alpha, beta",
    FRAMES: "base, base rz, tool x and the like, with x, y, z, rx, ry, rz",
}
_SAYS = "free, fixed, or a mapping of value_ and prior_std_ with mm, mrad, rad or deg"


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
    value: Mapping[str, float] = field(default_factory=dict)
    std: Mapping[str, float] = field(default_factory=dict)

    @property
    def says(self) -> int:
        """How much the rule says about a parameter."""
        return 2 * (self.joint is not None or self.frame is not None) + bool(self.parameter)


def rules(
    content: Mapping[str, Any], about: str, place: Callable[[str], str] = str
) -> tuple[list[Rule], list[Problem]]:
    """Rules of a mapping about JOINTS or FRAMES and every problem with it.

    ``place`` words where a name is. What an arm has is not asked here: see ``strangers``.
    """
    found: dict[tuple[Any, ...], Rule] = {}
    problems: list[Problem] = []
    for name, says in content.items():
        subject = _subject(name)
        if subject is None or (subject[1] is not None) != (about == FRAMES):
            other = KEYS[JOINTS if about == FRAMES else FRAMES]
            # Any word could be the name of a frame.
            is_known = subject and (subject[1] in (None, "base", "tool") or subject[2])
            fix = f"it belongs in {other}" if is_known else ""
            what = f"{name!r} is no parameter of {about}"
            problems.append(Problem(place(name), what, _NAMES[about], fix))
            continue
        free, value, std, faults = _said(says, subject[2])
        problems += [Problem(place(name), what, _SAYS) for what in faults]
        if subject in found:
            what = f"is said again; first as {found[subject].name!r}"
            problems.append(Problem(place(name), what))
        found[subject] = Rule(str(name), *subject, free, value, std)
    return [*found.values()], problems


def strangers(
    found: Sequence[Rule], joints: int, frames: Mapping[str, Sequence[str]] | None = None
) -> Iterator[tuple[Rule, str, str]]:
    """Rules about what an arm of ``joints`` has not: the rule, what is wrong, what there is.

    ``frames``: the components of every estimated frame; None where that is not known yet.
    """
    for rule in found:
        if rule.joint is not None and not 1 <= rule.joint <= joints:
            yield rule, f"there is no joint {rule.joint}", f"joints 1 to {joints}"
        if rule.frame is None or frames is None:
            continue
        if rule.frame not in frames:
            yield rule, f"no frame {rule.frame} is estimated", ", ".join(frames)
        elif rule.parameter and rule.parameter not in frames[rule.frame]:
            what = f"{rule.parameter} of {rule.frame} is not estimated"
            yield rule, what, ", ".join(frames[rule.frame])


def rule_for(
    found: Sequence[Rule], parameter: str, joint: int | None = None, frame: str | None = None
) -> Rule | None:
    """The rule that says most about ``parameter`` of a joint (1-based) or of a frame."""
    about = [rule for rule in found if rule.parameter in (None, parameter)]
    if frame is None:
        about = [rule for rule in about if rule.frame is None and rule.joint in (None, joint)]
    else:
        about = [rule for rule in about if rule.frame == frame]
    return max(about, key=lambda rule: rule.says, default=None)


def unit(parameter: str) -> str:
    """mm or rad, by the end of a parameter's name."""
    return parameter.rpartition("_")[2]


def _subject(name: Any) -> tuple[int | None, str | None, str | None] | None:
    """Joint, frame and parameter a name stands for; None where it stands for none."""
    words = " ".join(str(name).split())
    lower = words.lower().removesuffix("_mm").removesuffix("_rad")
    if lower in _PARAMETERS:
        return None, None, _PARAMETERS[lower]
    if match := _JOINT.fullmatch(words.lower()):
        joint, parameter = int(match[1]), match[2]
        known = parameter is None or parameter in _PARAMETERS
        return (joint, None, _PARAMETERS.get(parameter)) if known else None
    if match := _FRAME.fullmatch(words):
        return None, match[1], _COMPONENTS.get(match[2])
    return None


def _said(
    says: Any, parameter: str | None
) -> tuple[bool, dict[str, Any], dict[str, Any], list[str]]:
    """Whether free, value and standard deviation by unit, and every fault."""
    if says in (FREE, FIXED):
        return says == FREE, {}, {}, []
    if not isinstance(says, Mapping) or not says:
        return True, {}, {}, [f"{says!r} is not understood"]
    found: dict[str, dict[str, float]] = {"value": {}, "prior_std": {}}
    faults: list[str] = []
    for key, number in says.items():
        match = _SAID.fullmatch(str(key))
        if match is None:
            faults.append(f"unknown key {key!r}")
            continue
        kind, factor = _UNITS[match[2]]
        into = found[match[1]]
        if isinstance(number, bool) or not isinstance(number, (int, float)):
            faults.append(f"{key}: {number!r} is not a number")
            continue
        if kind in into:
            faults.append(f"{key} is stated in two units")
        if not abs(number) < _LARGEST or (match[1] == "prior_std" and number <= 0.0):
            needed = "finite" if match[1] == "value" else "positive"
            faults.append(f"{key}: {number!r} is not {needed}")
        if parameter and unit(parameter) != kind:
            faults.append(f"{key}: {parameter} is in {unit(parameter)}")
        if match[1] == "value" and parameter is None:
            faults.append(f"{key}: a value needs the name of one parameter")
        into[kind] = factor * number
    return bool(found["prior_std"]), found["value"], found["prior_std"], faults

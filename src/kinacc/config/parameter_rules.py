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
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from kinacc.config.fields import Or, Text, refused

FREE, FIXED = "free", "fixed"
JOINTS, FRAMES = "joints", "frames"
KEYS = {JOINTS: "calibration.dh.parameters", FRAMES: "calibration.frames"}
_PARAMETERS = {name: f"{name}_rad" for name in ("theta_offset", "alpha", "beta")}
_PARAMETERS |= {"theta": "theta_offset_rad", "d": "d_mm", "a": "a_mm"}
_COMPONENTS = {name: f"{name}_mm" for name in "xyz"}
_COMPONENTS |= {f"r{name}": f"r{name}_rad" for name in "xyz"}
_UNITS = {"mm": ("mm", 1.0), "rad": ("rad", 1.0), "mrad": ("rad", 1e-3)}
_UNITS["deg"] = ("rad", math.pi / 180.0)
_JOINT = re.compile(r"(?:joint ?|j)(\d{1,9})(?:[ .](\w+?)(?:_mm|_rad)?)?")
_FRAME = re.compile(r"([^ .]+)(?:[ .]+(r?[xyz])(?:_mm|_rad)?)?")
_NAMES = {
    JOINTS: "d, joint 3, joint 3 d and the like, with theta, d, a, alpha, beta",
    FRAMES: "base, base rz, tool x and the like, with x, y, z, rx, ry, rz",
}


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
    def weight(self) -> int:
        """How much the rule says about a parameter."""
        return 2 * (self.joint is not None or self.frame is not None) + bool(self.parameter)


def rules(content: Mapping[str, Any]) -> list[Rule]:
    """Rules of a mapping of names to ``free``, ``fixed``, or values and priors by unit.

    Raises a validation error, at its name, for a rule that states nothing, the same twice, or a
    number that its parameter does not have.
    """
    results: dict[Any, Rule] = {}
    for name, state in content.items():
        subject, known = _subject(name) or (None, None, None), _numbers(name, state)
        rule = Rule(name, *subject, state == FREE or bool(known["prior_std"]), *known.values())
        wrong = {*rule.value}
        if rule.parameter:
            wrong = (wrong | {*rule.std}) - {unit(rule.parameter)}
        if wrong:
            message = f"{', '.join(wrong)} is no unit of {rule.parameter or 'no one parameter'}"
            raise refused(message, "name one parameter, and its unit", name)
        if subject in results:
            raise refused(f"{name!r} is said twice, in two spellings", "", name)
        results[subject] = rule
    return [*results.values()]


def _numbers(name: str, state: Any) -> dict[str, dict[str, float]]:
    """Values and standard deviations of a rule by unit, mm and rad."""
    known: dict[str, dict[str, float]] = {"value": {}, "prior_std": {}}
    stated = state if isinstance(state, Mapping) else {}
    for key, number in stated.items():
        kind, _, short = key.rpartition("_")
        known[kind][_UNITS[short][0]] = _UNITS[short][1] * number
    if sum(map(len, known.values())) < max(len(stated), not isinstance(state, str)):
        raise refused("states nothing, or the same in two units", "", name)
    if any(std <= 0.0 for std in known["prior_std"].values()):
        raise refused("a standard deviation should be greater than 0", "", name)
    return known


def _check(about: str) -> AfterValidator:
    """Validator of rules about JOINTS or FRAMES."""

    def check(content: dict[str, Any]) -> dict[str, Any]:
        for name in content:
            subject = _subject(name)
            if subject is None or (subject[1] is not None) != (about == FRAMES):
                others = KEYS[JOINTS if about == FRAMES else FRAMES]
                fix = f"give {_NAMES[about]}; others belong in {others}"
                raise refused(f"{name!r} is no parameter of {about}", fix, name)
        rules(content)
        return content

    return AfterValidator(check)


_Key = Annotated[str, Field(pattern="^(value|prior_std)_(mm|rad|mrad|deg)$")]
# Beyond, squares overflow.
_Known = dict[_Key, Annotated[float, Field(gt=-1e100, lt=1e100)]]
_State = Annotated[_Known, Or((FREE, FIXED))]
JointRules = Annotated[dict[Text, _State], _check(JOINTS)]
FrameRules = Annotated[dict[Text, _State], _check(FRAMES)]


def strangers(
    results: Sequence[Rule], joints: int, frames: Mapping[str, Sequence[str]] | None = None
) -> Iterator[tuple[Rule, str, str]]:
    """Rules about what an arm of ``joints`` has not: the rule, what is wrong, what there is.

    ``frames``: the components of every estimated frame; None where that is not known yet.
    """
    for rule in results:
        if rule.joint is not None and not 1 <= rule.joint <= joints:
            yield rule, f"there is no joint {rule.joint}", f"joints 1 to {joints}"
        if rule.frame is None or frames is None:
            continue
        if rule.frame not in frames or rule.parameter not in (None, *frames[rule.frame]):
            there = ", ".join(frames.get(rule.frame, frames))
            yield rule, f"{rule.parameter or rule.frame} is not estimated", there


def rule_for(
    results: Sequence[Rule], parameter: str, joint: int | None = None, frame: str | None = None
) -> Rule | None:
    """The rule that says most about ``parameter`` of a joint (1-based) or of a frame."""
    about = [rule for rule in results if rule.parameter in (None, parameter)]
    about = [rule for rule in about if rule.frame == frame and rule.joint in (None, joint)]
    return max(about, key=lambda rule: rule.weight, default=None)


def unit(parameter: str) -> str:
    """mm or rad, by the end of a parameter's name."""
    return parameter.rpartition("_")[2]


def _subject(name: str) -> tuple[int | None, str | None, str | None] | None:
    """Joint, frame and parameter a name stands for; None where it stands for none."""
    text = " ".join(name.split())
    lower = text.lower().removesuffix("_mm").removesuffix("_rad")
    if lower in _PARAMETERS:
        return None, None, _PARAMETERS[lower]
    if match := _JOINT.fullmatch(text.lower()):
        is_known = match[2] is None or match[2] in _PARAMETERS
        return (int(match[1]), None, _PARAMETERS.get(match[2])) if is_known else None
    match = _FRAME.fullmatch(text)
    return (None, match[1], _COMPONENTS.get(match[2])) if match else None

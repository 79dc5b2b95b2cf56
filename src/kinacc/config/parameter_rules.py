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
    """Rules of a valid mapping of names to ``free``, ``fixed``, or values and priors by unit."""
    results = []
    for name, state in content.items():
        known: dict[str, dict[str, float]] = {"value": {}, "prior_std": {}}
        for key, number in state.items() if isinstance(state, Mapping) else ():
            kind, _, short = key.rpartition("_")
            known[kind][_UNITS[short][0]] = _UNITS[short][1] * number
        is_free = state == FREE or bool(known["prior_std"])
        subject = _subject(name) or (None, None, None)
        results.append(Rule(name, *subject, is_free, known["value"], known["prior_std"]))
    return results


def _check(about: str) -> AfterValidator:
    """Validator of the names of rules about JOINTS or FRAMES, and of units beside names."""

    def check(content: dict[str, Any]) -> dict[str, Any]:
        subjects: list[Any] = []
        for name, state in content.items():
            subject, fix = _subject(name), ""
            stated = [] if isinstance(state, str) else [key.rpartition("_") for key in state]
            kinds = [(kind, _UNITS[short][0]) for kind, _, short in stated]
            parameter = subject[2] if subject else None
            units = {parameter and unit(parameter)}
            wrong = [k for k, u in kinds if (parameter or k == "value") and u not in units]
            if subject is None or (subject[1] is not None) != (about == FRAMES):
                message = f"{name!r} is no parameter of {about}"
                second = KEYS[JOINTS if about == FRAMES else FRAMES]
                fix = f"give {_NAMES[about]}; others belong in {second}"
            elif subject in subjects:
                message = f"{name!r} is said twice, in two spellings"
            elif len({*kinds}) < len(kinds) or not (stated or isinstance(state, str)):
                message = "states nothing, or the same in two units"
            elif wrong:
                message = (
                    f"{wrong[0]} of {parameter or 'no one parameter'} is named in another unit"
                )
                fix = "name one parameter, and its unit"
            elif any(k == "prior_std" and state["_".join((k, u))] <= 0.0 for k, _, u in stated):
                message = "a standard deviation should be greater than 0"
            else:
                subjects.append(subject)
                continue
            raise refused(message, fix, name)
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

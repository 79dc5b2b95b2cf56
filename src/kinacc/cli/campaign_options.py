"""Options that beginning and planning a campaign share: noise, assessor, aims."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path

from kinacc.assess.adaptive import AdaptiveAssessor
from kinacc.assess.registry import ADAPTIVE, RECOMMENDED
from kinacc.assess.statement import CONFIDENCE
from kinacc.campaign import instrument, known_noise, plan, slips
from kinacc.campaign.known_noise import KnownNoise
from kinacc.errors import InputError, Problem, refuse

_LARGEST_MM = 1e6


def instruments(
    noise_mm: str | None,
    covariance_mm2: str | None,
    named: Sequence[str] | None = None,
    frame: str = "base",
    resolution_mm: float | None = None,
    calibrations: Sequence[Path] = (),
    tested: KnownNoise | None = None,
) -> tuple[instrument.Instrument, ...]:
    """Instruments of ``--noise-mm``, ``--covariance-mm2`` and ``--instrument``, if there is one.

    ``tested``: the noise of ``--repeatability``, instead of these. Raises InputError where there is
    none, with what results folders ``calibrations`` tell of it.
    """
    unnamed = [f"instrument={each}" for each in (covariance_mm2, noise_mm) if each is not None]
    texts = [*unnamed, *(named or ())]
    refuse(not_positive(resolution_mm=resolution_mm))
    if tested is not None:
        if texts:
            what = f"is given beside {', '.join(texts)}"
            raise InputError(Problem("--repeatability", what, "one of them", "leave one out"))
        own = instrument.floored(tested.covariance_mm2, resolution_mm or 0.0)
        return (instrument.Instrument("instrument", own, frame, None, resolution_mm or 0.0),)
    if not texts:
        known = dict.fromkeys(map(slips.noise_known, calibrations))
        fix = slips.ways_to_noise([*known], several=named is not None)
        raise InputError(Problem("noise", "is not given", fix=fix))
    return instrument.instruments(texts, frame, resolution_mm or 0.0)


def tested_noise(path: str | None) -> KnownNoise | None:
    """The noise of ``--repeatability``; None where it is not given."""
    return None if path is None else known_noise.read(path)


# Options of what is so in the workshop, by the settings they become and what these are without.
_WORKSHOP = {
    "noise": ("noise", "known"),
    "wrong_readings": ("wrong_rate", None),
    "references": ("references", None),
    "error": ("error_of", "mean"),
    "arm_mm": ("arm_mm", None),
    "allowance_mm": ("allowance_mm", None),
}


_OPTIONS = {"measurements": "--budget", "confidence": "--confidence"} | {
    setting: f"--{option.replace('_', '-')}" for option, (setting, _) in _WORKSHOP.items()
}


def workshop(given: Mapping[str, object]) -> dict[str, object]:
    """Settings of an assessor by the options on noise, wrong readings, drift and what is meant.

    Raises InputError for a share that is none.
    """
    found = {
        setting: given[option]
        for option, (setting, without) in _WORKSHOP.items()
        if given[option] != without
    }
    if "noise" in found:
        found["noise"] = "estimated"
    if "wrong_rate" in found:
        found["wrong_rate"] = _share(str(found["wrong_rate"]))
    return found


def _share(text: str) -> float:
    """A share as 1% or 0.01."""
    number, percent, rest = text.strip().partition("%")
    try:
        value = float(number) * (0.01 if percent else 1.0)
    except ValueError:
        value = math.nan
    if rest or not 0.0 <= value < 1.0:
        raise InputError(Problem("--wrong-readings", repr(text), "a share as 1% or 0.01"))
    return value


def assessor(
    name: str | None,
    budget: int,
    confidence: float | None,
    stated: Sequence[str],
    asked: Mapping[str, object],
    tested: KnownNoise | None = None,
) -> AdaptiveAssessor:
    """The assessor of ``--assessor``, ``--budget``, ``--confidence`` and ``--set``.

    ``asked``: settings by :func:`workshop`; ``tested``: the noise of ``--repeatability``, known up
    to a factor. Raises InputError also for what the assessor knows nothing of.
    """
    name = name or RECOMMENDED
    settings: dict[str, object] = {"measurements": budget}
    if name not in ADAPTIVE or "confidence" in {each.name for each in fields(ADAPTIVE[name])}:
        settings["confidence"] = CONFIDENCE if confidence is None else confidence
    elif confidence is not None:
        what = f"{confidence:g}: {name} states a value without bounds, which has no confidence"
        fix = "leave it out, or choose another --assessor"
        raise InputError(Problem("--confidence", what, fix=fix))
    if tested is not None and name in ADAPTIVE:
        if "noise_freedom" not in {each.name for each in fields(ADAPTIVE[name])}:
            what = f"{name} takes the noise as known, and a test knows it up to a factor only"
            fix = "state it with --noise-mm, or choose another --assessor"
            raise InputError(Problem("--repeatability", what, fix=fix))
        if "noise" in asked:
            what = "estimate, and a test tells the noise"
            raise InputError(Problem("--noise", what, fix="leave it out, or --repeatability"))
        settings |= {"noise": "estimated", "noise_freedom": tested.freedom}
    if name in ADAPTIVE:
        known = {each.name for each in fields(ADAPTIVE[name])}
        fix = f"leave it out, or choose --assessor {RECOMMENDED}"
        refuse(
            Problem(_OPTIONS[each], f"{name} knows nothing of it", fix=fix)
            for each in asked
            if each not in known
        )
    settings |= asked
    for text in stated:
        key, mark, value = text.partition("=")
        if not mark:
            raise InputError(Problem("--set", repr(text), "NAME=VALUE"))
        try:
            settings[key.strip()] = json.loads(value)
        except (ValueError, RecursionError):
            settings[key.strip()] = value.strip()
    try:
        return plan.assessor_of(name, settings)
    except InputError as error:
        # An assessor knows its settings, not the options they came from.
        raise InputError(
            [
                replace(
                    each,
                    where=_OPTIONS.get(each.where, each.where),
                    allowed=_as_options(each.allowed),
                    fix=_as_options(each.fix),
                )
                for each in error.problems
            ]
        ) from None


def _as_options(text: str) -> str:
    """A sentence with the options that settings come from."""
    for setting in ("wrong_rate", "references", "error_of"):
        text = re.sub(rf"\b{setting}\b", _OPTIONS[setting], text)
    return text


# Found in 98 % of campaigns with a drift of three standard deviations, for a tenth of the width.
_REFERENCES, _LEAST_BUDGET, _LEAST_READINGS = 20, 1.4, 100


def with_references(
    assessor: AdaptiveAssessor, points: int, references: int | None
) -> AdaptiveAssessor:
    """The assessor with 20 reference readings where none are asked for and the budget has them.

    ``references``: as given, None where the option is not; ``points``: number of candidates.
    """
    enough = assessor.measurements >= max(_LEAST_BUDGET * points, _LEAST_READINGS)
    if references is not None or not enough or not hasattr(assessor, "references"):
        return assessor
    return replace(assessor, references=_REFERENCES)


def not_positive(**given: float | None) -> list[Problem]:
    """A problem for each option that is given and not above 0, or beyond all arms."""
    return [
        Problem(f"--{name.replace('_', '-')}", f"{value:g}", f"above 0, to {_LARGEST_MM:g}")
        for name, value in given.items()
        if value is not None and not 0.0 < value <= _LARGEST_MM
    ]

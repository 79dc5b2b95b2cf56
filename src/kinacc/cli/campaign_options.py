"""Options that starting and planning a campaign share: noise and assessor."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path

from kinacc.assess.adaptive import AdaptiveAssessor
from kinacc.assess.registry import ADAPTIVE, RECOMMENDED
from kinacc.assess.statement import CONFIDENCE
from kinacc.campaign import instrument, known_noise, plan, slips
from kinacc.campaign.known_noise import KnownNoise
from kinacc.errors import InputError, Problem, refuse

_LARGEST_MM = 1e6
# Settings of assessors by the options that set them.
_SETTINGS = {
    "noise": "noise",
    "wrong_readings": "wrong_rate",
    "references": "references",
    "error": "error_of",
    "arm_mm": "arm_mm",
    "allowance_mm": "allowance_mm",
    "confidence": "confidence",
}
_DEFAULTS = {"noise": "known", "error": "mean"}


def instruments(
    given: Mapping, tested: KnownNoise | None, results: Sequence[Path] = ()
) -> tuple[instrument.Instrument, ...]:
    """Return the instruments of the options; ``tested``: the noise of ``--repeatability``.

    Raises InputError without any, with the scatter of the readings in the folders ``results``.
    """
    frame, resolution_mm = given.get("frame", "base"), given["resolution_mm"]
    unnamed = (given["covariance_mm2"], given["noise_mm"])
    texts = [f"instrument={each}" for each in unnamed if each is not None]
    texts += given.get("instrument", ())
    refuse(not_positive(resolution_mm=resolution_mm))
    resolution_mm = resolution_mm or 0.0
    if tested is None and texts:
        return instrument.instruments(texts, frame, resolution_mm)
    if tested is not None and texts:
        raise InputError(Problem("--repeatability", f"is given beside {', '.join(texts)}"))
    if tested is None:
        known = [slips.noise_by_repeats(slips.noise_of(each)) for each in results]
        fix = "\n    ".join(filter(None, [slips.WAYS_TO_NOISE, *known]))
        raise InputError(Problem("noise", "is not given", fix=fix))
    floored = instrument.floored(tested.covariance_mm2, resolution_mm)
    return (instrument.Instrument("instrument", floored, frame, None, resolution_mm),)


def tested_noise(path: str | None) -> KnownNoise | None:
    """Return the noise of ``--repeatability``; None where it is not given."""
    return None if path is None else known_noise.read(path)


def assessor(given: Mapping, budget: int, tested: KnownNoise | None) -> AdaptiveAssessor:
    """Return the assessor of the options. Raises InputError for settings that it has not."""
    name = given["assessor"] or RECOMMENDED
    known = {each.name for each in fields(ADAPTIVE[name])} if name in ADAPTIVE else {"confidence"}
    asked = {
        option: given[option]
        for option in _SETTINGS
        if given[option] is not None and given[option] != _DEFAULTS.get(option)
    }
    problems = [
        Problem(f"--{option.replace('_', '-')}", f"{name} has no such setting")
        for option in asked
        if name in ADAPTIVE and _SETTINGS[option] not in known
    ]
    if tested is not None and name in ADAPTIVE and "noise_freedom" not in known:
        problems.append(Problem("--repeatability", f"{name} takes the noise as known"))
    if tested is not None and "noise" in asked:
        problems.append(Problem("--noise", "is given beside --repeatability"))
    settings: dict[str, object] = {"measurements": budget}
    if "confidence" in known:
        settings["confidence"] = CONFIDENCE
    settings |= {_SETTINGS[option]: value for option, value in asked.items()}
    if "noise" in asked or tested is not None:
        settings["noise"] = "estimated"
    if tested is not None:
        settings["noise_freedom"] = tested.freedom
    if "wrong_readings" in asked:
        text = str(asked["wrong_readings"]).strip()
        try:
            rate = float(text.removesuffix("%")) * (0.01 if text.endswith("%") else 1.0)
            settings["wrong_rate"] = rate
        except ValueError:
            problems.append(Problem("--wrong-readings", repr(text), "a share as 1% or 0.01"))
    refuse(problems)
    for text in given["settings"]:
        key, mark, value = text.partition("=")
        if not mark:
            raise InputError(Problem("--set", repr(text), "NAME=VALUE"))
        try:
            settings[key.strip()] = json.loads(value)
        except (ValueError, RecursionError):
            settings[key.strip()] = value.strip()
    return plan.assessor_of(name, settings)


def not_positive(**given: float | None) -> list[Problem]:
    """Return a problem for each option that is given and not above 0, or beyond all arms."""
    return [
        Problem(f"--{name.replace('_', '-')}", f"{value:g}", f"above 0, to {_LARGEST_MM:g}")
        for name, value in given.items()
        if value is not None and not 0.0 < value <= _LARGEST_MM
    ]

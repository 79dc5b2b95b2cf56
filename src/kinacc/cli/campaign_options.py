"""Options that starting and planning a campaign share: noise and assessor."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from kinacc.assess.adaptive import AdaptiveAssessor
from kinacc.assess.noise import ESTIMATED
from kinacc.assess.registry import RECOMMENDED
from kinacc.campaign import doubts, instrument, known_noise
from kinacc.campaign.known_noise import KnownNoise
from kinacc.campaign.plan import assessor_of, with_references
from kinacc.errors import InputError, Problem

# Settings of assessors by the options that set them.
_SETTINGS = {
    "wrong_readings": "wrong_rate",
    "references": "references",
    "error": "error_of",
    "arm_mm": "arm_mm",
    "allowance_mm": "allowance_mm",
    "confidence": "confidence",
}


def instruments(
    options: Mapping, results: Sequence[Path] = ()
) -> tuple[tuple[instrument.Instrument, ...], KnownNoise | None]:
    """Return the instruments of the options, and the noise of ``--repeatability``.

    Raises InputError without any, with the scatter of the readings in the folders ``results``.
    """
    frame, resolution_mm = options.get("frame", "base"), options["resolution_mm"] or 0.0
    unnamed = (options["covariance_mm2"], options["noise_mm"])
    texts = [f"instrument={text}" for text in unnamed if text is not None]
    texts += options.get("instrument", ())
    if options["repeatability"] is not None:
        if texts:
            raise InputError(Problem("--repeatability", f"is given beside {', '.join(texts)}"))
        tested = known_noise.read(options["repeatability"])
        covariance = instrument.floored(tested.covariance_mm2, resolution_mm)
        used = instrument.Instrument("instrument", covariance, frame, None, resolution_mm)
        return (used,), tested
    if not texts:
        scatter = [doubts.noise_by_repeats(doubts.noise_of(folder)) for folder in results]
        fix = "\n    ".join(filter(None, [doubts.WAYS_TO_NOISE, *scatter]))
        raise InputError(Problem("noise", "is not given", fix=fix))
    return instrument.instruments(texts, frame, resolution_mm), None


def assessor(
    options: Mapping, budget: int, points: int, tested: KnownNoise | None
) -> AdaptiveAssessor:
    """Return the assessor of the options for so many candidates.

    Raises InputError for settings that it does not have.
    """
    settings: dict[str, object] = {
        name: options[option] for option, name in _SETTINGS.items() if options[option] is not None
    }
    settings["measurements"] = budget
    if options["noise"] == "estimate" or tested is not None:
        settings["noise"] = ESTIMATED
    if tested is not None:
        settings["noise_freedom"] = tested.freedom
    for text in options["settings"]:
        key, equals, value = text.partition("=")
        if not equals:
            raise InputError(Problem("--set", repr(text), "NAME=VALUE"))
        try:
            settings[key.strip()] = json.loads(value)
        except (ValueError, RecursionError):
            settings[key.strip()] = value.strip()
    chosen = assessor_of(options["assessor"] or RECOMMENDED, settings)
    return with_references(chosen, points, options["references"])

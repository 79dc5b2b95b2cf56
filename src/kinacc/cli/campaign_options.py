"""Options that beginning and planning a campaign share: noise, assessor, aims."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

from kinacc.assess.adaptive import AdaptiveAssessor
from kinacc.assess.registry import ADAPTIVE, RECOMMENDED
from kinacc.assess.statement import CONFIDENCE
from kinacc.campaign import instrument, plan, slips
from kinacc.errors import InputError, Problem

_LARGEST_MM = 1e6


def instruments(
    noise_mm: str | None,
    covariance_mm2: str | None,
    named: Sequence[str] | None = None,
    frame: str = "base",
    calibrations: Sequence[Path] = (),
) -> tuple[instrument.Instrument, ...]:
    """Instruments of ``--noise-mm``, ``--covariance-mm2`` and ``--instrument``, if there is one.

    Raises InputError where there is none, with what results folders ``calibrations`` tell of it.
    """
    unnamed = [f"instrument={each}" for each in (covariance_mm2, noise_mm) if each is not None]
    texts = [*unnamed, *(named or ())]
    if not texts:
        allowed = "--noise-mm or --covariance-mm2"
        allowed += "" if named is None else ", or --instrument NAME=.."
        known = dict.fromkeys(map(slips.noise_known, calibrations)) or [slips.MEASURE_IT]
        raise InputError(Problem("noise", "is not given", allowed, "; ".join(known)))
    return instrument.instruments(texts, frame)


def assessor(
    name: str | None, budget: int, confidence: float | None, stated: Sequence[str]
) -> AdaptiveAssessor:
    """The assessor of ``--assessor``, ``--budget``, ``--confidence`` and ``--set``.

    Raises InputError also for a confidence of an assessor that states a value without bounds.
    """
    name = name or RECOMMENDED
    settings: dict[str, object] = {"measurements": budget}
    if name not in ADAPTIVE or "confidence" in {each.name for each in fields(ADAPTIVE[name])}:
        settings["confidence"] = CONFIDENCE if confidence is None else confidence
    elif confidence is not None:
        what = f"{confidence:g}: {name} states a value without bounds, which has no confidence"
        fix = "leave it out, or choose another --assessor"
        raise InputError(Problem("--confidence", what, fix=fix))
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
        options = {"measurements": "--budget", "confidence": "--confidence"}
        raise InputError(
            [replace(each, where=options.get(each.where, each.where)) for each in error.problems]
        ) from None


def not_positive(**given: float | None) -> list[Problem]:
    """A problem for each option that is given and not above 0, or beyond all arms."""
    return [
        Problem(f"--{name.replace('_', '-')}", f"{value:g}", f"above 0, to {_LARGEST_MM:g}")
        for name, value in given.items()
        if value is not None and not 0.0 < value <= _LARGEST_MM
    ]

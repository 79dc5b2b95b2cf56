"""Options that beginning and planning a campaign share: noise, assessor, aims."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace

from kinacc.assess.adaptive import AdaptiveAssessor
from kinacc.assess.registry import RECOMMENDED
from kinacc.campaign import instrument, plan
from kinacc.errors import InputError, Problem

_LARGEST_MM = 1e6


def instruments(given: Mapping) -> tuple[instrument.Instrument, ...]:
    """Instruments of ``--noise-mm``, ``--covariance-mm2`` and ``--instrument``."""
    texts = list(given.get("instrument", ()))
    for option in ("noise_mm", "covariance_mm2"):
        if given[option] is not None:
            texts.insert(0, f"instrument={given[option]}")
    if not texts:
        allowed = "--noise-mm or --covariance-mm2"
        allowed += ", or --instrument NAME=.." if "instrument" in given else ""
        raise InputError(Problem("noise", "is not given", allowed))
    return instrument.instruments(texts, given["frame"])


def assessor(given: Mapping) -> AdaptiveAssessor:
    """The assessor of ``--assessor``, ``--budget``, ``--confidence`` and ``--set``."""
    settings: dict[str, object] = {
        "measurements": given["budget"],
        "confidence": given["confidence"],
    }
    for text in given["settings"]:
        name, mark, value = text.partition("=")
        if not mark:
            raise InputError(Problem("--set", repr(text), "NAME=VALUE"))
        try:
            settings[name.strip()] = json.loads(value)
        except (ValueError, RecursionError):
            settings[name.strip()] = value.strip()
    try:
        return plan.assessor_of(given["assessor"] or RECOMMENDED, settings)
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

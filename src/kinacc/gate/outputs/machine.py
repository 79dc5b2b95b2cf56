"""What the gate says for a program: JSON by a published schema."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from importlib.resources import files

from kinacc import __version__
from kinacc.gate.outcome import Difference, Outcome, Verdicts
from kinacc.gate.outputs import told

FORMAT = "kinacc gate 1"  # a number more where a reader of this one would read something wrong
SCHEMA = "gate-1.schema.json"


def schema_text() -> str:
    """The JSON Schema (draft 2020-12) of :func:`as_json`."""
    return (files("kinacc.gate.outputs") / SCHEMA).read_text("utf-8")


def as_json(verdicts: Verdicts) -> dict:
    """Plain values for JSON; null where there is nothing to tell or a number is not finite."""
    return {
        "format": FORMAT,
        "kinacc_version": __version__,
        "passed": verdicts.passed,
        "results": verdicts.results,
        "accepted": verdicts.accepted or None,
        "digest": verdicts.digest or None,
        "counts": told.counts(verdicts),
        "outcomes": [_outcome(each) for each in verdicts.outcomes],
        "first_screens": dict(verdicts.first_screens),
    }


def _outcome(outcome: Outcome) -> dict:
    return {
        "dataset": outcome.dataset,
        "name": outcome.name,
        "kind": outcome.kind,
        "verdict": outcome.verdict,
        "says": outcome.says,
        "fix": outcome.fix,
        "file": outcome.file or None,
        "figures": _plain(outcome.figures),
        "differences": [_difference(each) for each in outcome.differences],
    }


def _difference(difference: Difference) -> dict:
    return _plain({**asdict(difference), "explained": difference.explained})


def _plain(value):
    """Values that JSON knows: numpy's as Python's, no number that is not finite."""
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    value = value.item() if hasattr(value, "item") else value
    return None if isinstance(value, float) and not math.isfinite(value) else value

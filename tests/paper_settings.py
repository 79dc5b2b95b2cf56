"""The paper's study as the schema has it, with changes: settings and assessors of tests."""

from __future__ import annotations

from kinacc.assess.registry import ASSESSORS
from kinacc.config.records import of_section
from kinacc.config.schema import defaults


def study(**changes: object) -> dict[str, object]:
    """The section ``study``."""
    return {**defaults()["study"], **changes}


def histories(**changes: object) -> dict[str, object]:
    """The section ``histories``."""
    return {**defaults()["histories"], **changes}


def assessor(which: str | type, **changes: object):
    """An assessor, by name or class, under the default reading of the paper."""
    return of_section(ASSESSORS[which] if isinstance(which, str) else which, study(**changes))

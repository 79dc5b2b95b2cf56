"""What the tables of a campaign are marked with."""

from __future__ import annotations

from kinacc import __version__
from kinacc.artifacts import provenance
from kinacc.campaign.folder import Opened


def assessor_code() -> str:
    """Hash of the code that chooses points and makes bounds."""
    return provenance.code_hash("kinacc.assess.registry")


def marks_of(opened: Opened) -> dict[str, object]:
    """Provenance: the plan counts as the configuration, the journal as the input."""
    return {
        "kinacc_version": __version__,
        "config_hash": opened.digest,
        "code_hash": provenance.code_hash("kinacc.campaign.report", "kinacc.artifacts.store"),
        "inputs_hash": opened.journal.last,
        "seed": opened.plan.seed,
    }

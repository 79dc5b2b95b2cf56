"""Settings as the schema has them, with changes: what tests begin from."""

from __future__ import annotations

from kinacc.assess.registry import ASSESSORS
from kinacc.config.records import of_section
from kinacc.config.schema import defaults
from kinacc.deployment.planning import Experiment
from kinacc.geometry import Pose


def study(**changes: object) -> dict[str, object]:
    """The section ``study``."""
    return {**defaults()["study"], **changes}


def histories(**changes: object) -> dict[str, object]:
    """The section ``histories``."""
    return {**defaults()["histories"], **changes}


def assessor(which: str | type, **changes: object):
    """An assessor, by name or class, under the default reading of the paper."""
    return of_section(ASSESSORS[which] if isinstance(which, str) else which, study(**changes))


def experiment(tool: Pose, **changes: object) -> Experiment:
    """Poses whose positions and orientations are measured, with base and tool unknown."""
    calibration = defaults()["calibration"]
    usual = {
        "orientation": True,
        "hayati_joints": (),
        "rotation_weight_mm_per_rad": calibration["rotation_weight_mm_per_rad"],
        "threshold": calibration["dh"]["truncation"],
    }
    return Experiment(tool, **{**usual, **changes})

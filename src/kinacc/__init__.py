"""Robot kinematic model accuracy: calibrate, map the error, and state how large it can be."""

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.1.0"

# Loaded at first use: a command does not import what it does not need (SciPy does so too).
_ELSEWHERE = {
    "Pose": "kinacc.geometry",
    "Robot": "kinacc.kinematics.robot",
    "read_table": "kinacc.tables.store",
    "plan_poses": "kinacc.deployment.planning",
    "Campaign": "kinacc.campaign.campaign",
    "evaluate_assessors": "kinacc.study.monte_carlo",
    "register_error_model": "kinacc.calibration.own_model",
}
__all__ = [
    "Calibration",
    "Campaign",
    "Measurements",
    "Pose",
    "Robot",
    "__version__",
    "calibrate",
    "compare",
    "evaluate_assessors",
    "load_calibration",
    "plan_poses",
    "read_measurements",
    "read_table",
    "register_error_model",
    "verify",
]

if TYPE_CHECKING:
    from kinacc.api import (
        Calibration,
        Measurements,
        calibrate,
        compare,
        load_calibration,
        read_measurements,
        verify,
    )
    from kinacc.calibration.own_model import register_error_model
    from kinacc.campaign.campaign import Campaign
    from kinacc.deployment.planning import plan_poses
    from kinacc.geometry import Pose
    from kinacc.kinematics.robot import Robot
    from kinacc.study.monte_carlo import evaluate_assessors
    from kinacc.tables.store import read_table


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module 'kinacc' has no attribute {name!r}")
    return getattr(import_module(_ELSEWHERE.get(name, "kinacc.api")), name)


def __dir__() -> list[str]:
    return __all__

"""What the calibration stages share: settings and tables as records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from kinacc.calibration import selection, tables
from kinacc.calibration.constraints import parallel_joints, require_known
from kinacc.calibration.dh_fit import DH_FIX
from kinacc.calibration.models import Options
from kinacc.calibration.observations import Observations, from_columns
from kinacc.calibration.selection import Grid
from kinacc.calibration.system import require_enough
from kinacc.calibration.vec_fit import VEC_FIX, Prior
from kinacc.config import parameter_rules
from kinacc.kinematics.robot import Robot, carried

AUTO = "auto"
TRAIN = "train"


def options(calibration: Mapping, arm: Robot) -> Options:
    """Options of the ``calibration`` settings; a stage that lacks a section gets its defaults."""
    given: dict = {
        "base": arm.base,
        "tool": carried(arm),
        "rotation_weight_mm_per_rad": float(calibration["rotation_weight_mm_per_rad"]),
        "frames_estimated": calibration["base_and_tool"] == "estimated",
        "frame_rules": tuple(
            parameter_rules.rules(calibration["frames"], parameter_rules.FRAMES)[0]
        ),
    }
    if "vec" in calibration:
        section = calibration["vec"]
        angle_rad = 1e-3 * float(section["prior_std_mrad"])
        given |= {
            "order": 1 if section["order"] == AUTO else int(section["order"]),
            "grid": _grid(section, angle_rad),
            "travel_direction": bool(section["travel_direction"]),
            "prior": Prior(
                float(section["prior_std_mm"]), angle_rad, float(section["prior_decay"]), angle_rad
            ),
        }
    if "dh" in calibration:
        section = calibration["dh"]
        given |= {
            "dh_to_vec": section["fit_to"] == "vec",
            "hayati_joints": hayati_joints(section, arm),
            "hayati_instead": section["hayati_joints"] == AUTO,
            "arm_rules": tuple(
                parameter_rules.rules(section["parameters"], parameter_rules.JOINTS)[0]
            ),
            "loss": section["loss"],
            "threshold": float(section["truncation"]),
        }
    return Options(**given)


def hayati_joints(section: Mapping, arm: Robot) -> tuple[int, ...]:
    """Joints (1-based) with a Hayati angle, by the ``calibration.dh`` settings."""
    if section["hayati_joints"] == AUTO:
        return parallel_joints(arm.dh)
    return tuple(int(joint) for joint in section["hayati_joints"])


def _grid(section: Mapping, offset_rad: float) -> Grid | None:
    """The orders and priors to choose from; None where both are stated."""
    by_order, by_prior = section["order"] == AUTO, section["prior"] == "chosen"
    if not by_order and not by_prior:
        return None
    stated = Prior(
        float(section["prior_std_mm"]), offset_rad, float(section["prior_decay"]), offset_rad
    )
    orders = (
        tuple(order for order in selection.ORDERS if order <= int(section["order_highest"]))
        if by_order
        else (int(section["order"]),)
    )
    return Grid(orders, selection.chosen_priors(offset_rad) if by_prior else (stated,))


def chosen(options: Options, choices: Mapping, fold: int | None) -> Options:
    """The options with the order and prior that a ``vec_orders`` table states for one fold.

    ``fold``: the fold whose rows the choice has not seen; None where it has seen all.
    """
    if options.grid is None:
        return options
    order, std_mm, decay = tables.chosen_order(choices, fold)
    for prior in options.grid.priors:
        if prior.delta_mm == std_mm and prior.decay == decay:
            return replace(options, order=order, prior=prior)
    raise ValueError(f"vec_orders states a prior of {std_mm} mm, decay {decay}: not in the grid")


def observed(inputs: Mapping, robot: Robot) -> tuple[Observations, np.ndarray]:
    """All observations of ``measurements`` and the mask (n,) of the rows that train."""
    columns = inputs["measurements"]
    return from_columns(columns, robot), np.asarray(columns["subset"]) == TRAIN


def held_out_fold(every: Observations, train: np.ndarray) -> int | None:
    """The fold the delivered models have not seen; None where they have seen all."""
    folds = np.unique(every.fold[~train])
    return int(folds[0]) if len(folds) else None


def joint_range_rad(
    section: Mapping, robot: Robot, q_rad: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Range (k,), (k,) of the VEC model's DH joint angles; ``q_rad`` (n, k) are the data's."""
    wanted = section["joint_range"]
    if wanted == "data":
        margin = np.deg2rad(float(section["joint_range_margin_deg"]))
        return q_rad.min(axis=0) - margin, q_rad.max(axis=0) + margin
    low, high = robot.q_min_rad, robot.q_max_rad
    if wanted != "limits":
        low, high = np.deg2rad(np.array(wanted, dtype=float)).T
    return robot.dh_box(low, high)


def require_enough_rows(inputs: Mapping, robot: Robot, calibration: Mapping) -> None:
    """Raise InputError where the training rows have fewer residuals than a fit has parameters.

    The fits ask themselves as well; asked beforehand, nothing is remade from data that cannot do.
    """
    seen, train = observed(inputs, robot)
    seen, chosen, joints = seen.select(train), options(calibration, robot), robot.dh.joints
    frames = 0
    if chosen.frames_estimated and len(seen):
        require_known(chosen.frame_rules, seen)
        frames = int(chosen.frames(seen).free.sum())
    errors = 6 * joints * (chosen.order + 1)
    require_enough(seen, errors + frames, "VEC fit", VEC_FIX)
    parameters = int(chosen.arm(robot.dh).free.sum())
    require_enough(seen, parameters + frames, "DH fit", DH_FIX)

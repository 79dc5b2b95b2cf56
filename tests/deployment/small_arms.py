"""Calibrations of simulated arms, made by the workflow's own fits, small enough for tests."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
from calibration.simulated import POSE, disturbed, fit, measure

from kinacc.calibration import fitting, tables, uncertainty, vec_fit
from kinacc.calibration.dh_estimator import free_parameters
from kinacc.calibration.frames import MOTIONS, known
from kinacc.calibration.observations import Observations
from kinacc.calibration.vec_fit import Prior
from kinacc.deployment.folder import calibration
from kinacc.deployment.record import Calibration
from kinacc.geometry import Pose, exp_so3
from kinacc.kinematics import dh, robot, vec

BASE = Pose(exp_so3(np.array([0.3, -1.1, 2.0])), np.array([2500.0, -900.0, 400.0]))
TOOL = Pose(exp_so3(np.array([-0.4, 0.2, 0.7])), np.array([30.0, -20.0, 150.0]))
WEIGHT, NOISE_MM = 500.0, 0.03
HAYATI = {"ur10": (2, 3)}
RMS_MM = {"vec": 0.3, "dh": 0.05, "nominal": 1.0}
RESIDUALS = {
    "comparison": np.array([f"{model}_vs_measured" for model in RMS_MM]),
    "rms": np.array([*RMS_MM.values()]),
    "subset": np.full(3, "validation"), "quantity": np.full(3, "position"),
    "fold": np.full(3, np.nan),
}  # fmt: skip


def bent(model: dh.DHModel, seed: int) -> dh.DHModel:
    """The model with axes askew by a milliradian and lengths off by tenths of a millimetre."""
    return disturbed(model, np.arange(5) < 4, np.random.default_rng(seed), 1e-3, 0.3)


@cache
def truth(name: str) -> dh.DHModel:
    """A real arm: the nominal one with errors of a tenth of a millimetre and of a milliradian."""
    return bent(robot.load(name).dh, 1)


def joints(name: str, count: int, seed: int = 2, part: float = 0.36) -> np.ndarray:
    """Reported joints (count, k) in the middle ``part`` of the limits."""
    arm, half = robot.load(name), 0.5 * part
    share = np.random.default_rng(seed).uniform(0.5 - half, 0.5 + half, (count, arm.dh.joints))
    return arm.q_min_rad + share * (arm.q_max_rad - arm.q_min_rad)


def measured(name: str, count: int = 80, seed: int = 3) -> Observations:
    """Poses of the real arm seen by an instrument, joints of the robot's DH table."""
    return measured_at(name, joints(name, count, part=0.4) @ robot.load(name).joint_map.T, seed)


def measured_at(name: str, q_rad: np.ndarray, seed: int = 3) -> Observations:
    """The real arm seen by an instrument at joints (count, k) of the robot's DH table."""
    return seen_of(truth(name), q_rad, seed)


def seen_of(model: dh.DHModel, q_rad: np.ndarray, seed: int = 3) -> Observations:
    """Any arm seen by an instrument at joints (count, k) of its DH table."""
    rng, placed = np.random.default_rng(seed), known(BASE, TOOL)
    frames = placed.bases, placed.targets
    seen = measure(model, q_rad, POSE, rng, NOISE_MM, 1, frames, NOISE_MM / WEIGHT)
    return replace(seen, target_names=("tool",))


@cache
def results(name: str, count: int, seed: int, with_vec: bool) -> dict:
    """Tables of a results folder, as far as a calibration needs them."""
    return results_of(name, measured(name, count, seed=seed), with_vec)


def results_of(name: str, seen: Observations, with_vec: bool = False) -> dict:
    """The tables of what was seen of an arm; without a fit the VEC model has no errors."""
    arm = robot.load(name)
    dh_found = fit(seen, arm.dh, free_parameters(arm.dh.joints, HAYATI.get(name, ())))
    low, high = seen.q_rad.min(axis=0) - 0.02, seen.q_rad.max(axis=0) + 0.02
    plain = vec.without_errors(arm.dh, low, high, 2)
    of = dict.fromkeys(("vec", "dh", "nominal"), dh_found.frames)
    tables_of_vec = {"vec_model": plain.to_columns(np.full_like(plain.start, np.nan))}
    if with_vec:
        nominal = fitting.fit_frames(seen, arm.dh, rotation_weight_mm_per_rad=WEIGHT)
        vec_found = vec_fit.fit(
            seen,
            plain,
            prior=Prior(1.0, 1e-3, 0.7, 1e-3),
            rotation_weight_mm_per_rad=WEIGHT,
            begin=nominal,
        )
        of["vec"] = vec_found.frames
        tables_of_vec = {
            "vec_model": vec_found.model.to_columns(vec_found.std),
            "vec_covariance": tables.covariance_columns(uncertainty.of_fit(vec_found)),
        }
    covariance = uncertainty.of_fit(dh_found)
    return {
        **tables_of_vec,
        "robot": {"description": [robot.as_yaml(arm)]},
        "dh_model": dh_found.model.to_columns(dh_found.std.ravel()),
        "frames": tables.frames_columns(of, ("tool",)),
        "dh_fit": tables.fit_columns("dh_fit", dh_found, covariance),
        "dh_covariance": tables.covariance_columns(covariance),
        "residuals": RESIDUALS,
    }


def calibrated(name: str, model: str = "dh", count: int = 80, seed: int = 3) -> Calibration:
    """The calibration of a simulated arm by one model."""
    return calibration(results(name, count, seed, model == "vec"), model, name)


def moved(arm: Calibration, steps: Mapping[str, float]) -> Calibration:
    """The calibration with its named parameters displaced by steps in mm and rad."""

    def frame(pose: Pose, name: str) -> Pose:
        motion = np.array([steps.get(f"{name}.{each}", 0.0) for each in MOTIONS])
        return Pose(exp_so3(motion[3:]) @ pose.rotation, pose.position_mm + motion[:3])

    vector = arm.model.start + [steps.get(name, 0.0) for name in arm.model.names]
    targets = {name: frame(pose, name) for name, pose in arm.targets.items()}
    model, base = arm.model.with_parameters(vector), frame(arm.base, "base")
    return replace(arm, model=model, base=base, targets=targets)

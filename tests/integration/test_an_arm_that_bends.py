"""An arm whose joints give way to gravity: measured, fitted, selected, used, or told what is wrong.

Every arm here is bent and measured by `oracles.compliant_arm`, which shares no code with the
package. Truth is known, so estimates are held to the uncertainty stated with them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from command_line import call
from measured_files import write_noisy
from oracles import compliant_arm
from oracles.compliant_arm import Arm, Body
from oracles.controllers.arms import shipped
from oracles.kinematics import frame
from read_columns import Q_DEG, XYZ_MM
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from stages_by_hand import run_stages

from kinacc import read_table

POSES = 60
NOISE_MM = 0.03
WEIGHT = 500.0  # mm per rad, the default of calibration.rotation_weight_mm_per_rad
BASE = frame(2600.0, -400.0, 350.0, Rotation.from_rotvec([0.02, -0.03, 0.7]))
TOOL = frame(40.0, -25.0, 180.0, Rotation.from_rotvec([0.3, -0.2, 0.5]))

FANUC, MH180 = map(shipped, ("fanuc_r2000ic_165f", "mh180"))
FANUC_LINKS = (  # of a class of arms of 1.3 t; each centre in the DH frame its joint carries
    Body(380.0, (-150.0, 60.0, 20.0)),
    Body(260.0, (-520.0, 10.0, 90.0)),
    Body(210.0, (-60.0, -30.0, 70.0)),
    Body(95.0, (5.0, 240.0, -10.0)),
    Body(38.0, (0.0, -8.0, 30.0)),
    Body(14.0, (0.0, 3.0, -45.0)),
)
GRIPPER = Body(85.0, (15.0, -10.0, 160.0))
BENT = {2: 4.0e-7, 3: 9.0e-7}  # rad per N m: 2.5 and 1.1 million N m per rad
PER_LEVER = {2: 8.0e-7, 3: 1.1e-6}  # rad per mm
NONE = compliant_arm.NOTHING
ESTIMATED = {
    "base_and_tool": "estimated",
    "dh": {"fit_to": "measurements", "hayati_joints": "auto"},
}


@dataclass(frozen=True)
class Cell:
    """A measured arm: as it was built and bends, at reported joints (n, k) with payloads (n).

    The instrument sees ``TOOL`` in the last DH frame, from ``BASE``.
    """

    robot: str
    arm: Arm
    joints_deg: np.ndarray
    payloads: Sequence[Body]

    def dh_joints(self, joints_deg: np.ndarray) -> np.ndarray:
        return np.radians(joints_deg) @ shipped(self.robot).matrix.T

    def tool_poses(self, joints_deg: np.ndarray, payloads: Sequence[Body]) -> np.ndarray:
        """Where the tool truly is for the instrument (n, 4, 4)."""
        at = zip(self.dh_joints(joints_deg), payloads, strict=True)
        return np.array([BASE @ compliant_arm.flange(self.arm, q, load) @ TOOL for q, load in at])


def arm_in_a_cell(name: str, arm: Arm, seed: int, loads: Sequence[Body]) -> Cell:
    """An arm built a little off its drawing, visited all over its working range."""
    rng = np.random.default_rng(seed)
    low, high = np.clip(shipped(name).limits, -170.0, 170.0).T
    joints_deg = low + rng.uniform(0.05, 0.95, (POSES, len(low))) * (high - low)
    built = compliant_arm.disturbed(arm, rng, hayati_joints=(2,))
    return Cell(name, built, joints_deg, [loads[i % len(loads)] for i in range(POSES)])


def written(path: Path, cell: Cell, seed: int, with_payload: bool = False) -> Path:
    """The file of a tracker that sees full poses, with noise."""
    rng, poses = np.random.default_rng([seed, 1]), cell.tool_poses(cell.joints_deg, cell.payloads)
    names = ("payload_kg", "payload_x_mm", "payload_y_mm", "payload_z_mm") if with_payload else ()
    loads = np.transpose([[load.mass_kg, *load.centre_mm] for load in cell.payloads])
    payloads, q_rad = dict(zip(names, loads, strict=False)), np.radians(cell.joints_deg)
    return write_noisy(path, q_rad, poses, rng, NOISE_MM, NOISE_MM / WEIGHT, **payloads)


def stated(body: Body) -> dict:
    return {"mass_kg": body.mass_kg, "centre_mm": list(body.centre_mm)}


MASSES = {"joints": [2, 3], "links": [stated(body) for body in FANUC_LINKS]}


def calibrated(
    folder: Path, cell: Cell, seed: int, compliance: dict, columns: bool = False, folds: int = 0
) -> Path:
    """Results of a cell measured to a file, after the stages up to its model, or with ``folds``.

    Without the check of the data, which takes longer than all fits and has tests of its own.
    """
    file = written(folder / "poses.csv", cell, seed, columns)
    file = {"path": str(file), "orientation": {"kind": "quaternion"}}
    calibration = {"vec": {"order": 1}, "compliance": compliance, **ESTIMATED}
    settings = {
        "measurements": {"folds": folds} if folds else {"folds": None, "validation_fold": None},
        "calibration": calibration,
        "datasets": {
            "bent": {"robot": cell.robot, "measurements": {"source": "file", "file": file}}
        },
    }
    config = folder / "cell.yaml"
    config.write_text(yaml.safe_dump(settings))
    held_out = ("vec", "dh", "residuals", "summary") if folds else ()
    return run_stages(("measurements", "compliance", *held_out), [config], folder / "results")


def fanuc(seed: int, loads: Sequence[Body], compliance=BENT) -> Cell:
    """An arm whose maker states its masses."""
    return arm_in_a_cell(
        "fanuc_r2000ic_165f", Arm(FANUC.table, FANUC_LINKS, compliance), seed, loads
    )


def mh180(seed: int, loads: Sequence[Body], compliance=BENT) -> Cell:
    """An arm nobody knows the masses of, as if they were one at its end."""
    return arm_in_a_cell("mh180", Arm(MH180.table, (), compliance, PER_LEVER), seed, loads)


def deviation(folder: Path, truth: dict[str, dict[int, float]]) -> float:
    """Squared deviation of estimates from what was planted, in units of the stated covariance.

    ``truth`` maps a column of ``compliance_model`` to its true values by joint. Chi-squared with
    one degree of freedom for each value, if the covariance is right.
    """
    table, covariance = (
        read_table(folder / f"compliance_{n}.parquet") for n in ("model", "covariance")
    )
    table = table.set_index("joint")
    matrix = covariance.pivot(index="parameter", columns="other", values="covariance")
    matrix = matrix.fillna(matrix.T)
    planted = {(joint, name): v for name, values in truth.items() for joint, v in values.items()}
    names = [f"j{joint}.{name}" for joint, name in planted]
    error = np.array([table.loc[key] - value for key, value in planted.items()])
    std = np.array([table.loc[joint, f"std_{name}"] for joint, name in planted])
    assert (abs(error) < 4.0 * std).all()
    assert (std < 0.02 * np.array([*planted.values()])).all()  # sixty poses determine far better
    matrix = matrix.loc[names, names].to_numpy()
    np.testing.assert_allclose(np.sqrt(np.diag(matrix)), std, rtol=1e-9)
    return float(error @ np.linalg.solve(matrix, error))


STIFF, LEVER = {"compliance_rad_per_nm": BENT}, {"lever_coefficient_rad_per_mm": PER_LEVER}
HEAVY = Body(160.0, (30.0, -20.0, 200.0))
UNKNOWN = {"joints": [2, 3]}


@pytest.mark.parametrize(
    ("cell_of", "compliance", "columns", "truth", "seeds"),
    [
        (lambda seed: fanuc(seed, (NONE, GRIPPER)), MASSES, True, STIFF, 6),
        (lambda seed: mh180(seed, (NONE,), {}), UNKNOWN, False, LEVER, 4),
        (lambda seed: mh180(seed, (NONE, GRIPPER, HEAVY)), UNKNOWN, True, STIFF | LEVER, 4),
    ],
    ids=["known masses", "unknown masses", "a payload that changes"],
)
def test_bending_comes_back_within_its_uncertainty(
    tmp_path, cell_of, compliance, columns, truth, seeds
):
    deviations = []
    for seed in range(seeds):
        folder = tmp_path / str(seed)
        folder.mkdir()
        results = calibrated(folder, cell_of(seed), seed, compliance, columns)
        deviations.append(deviation(results, truth))
    # The sum lies in the middle 99 % of its distribution: neither modest nor boastful.
    low, high = chi2.ppf([0.005, 0.995], 2 * len(truth) * seeds)
    assert low < sum(deviations) < high, deviations


def selection(folder: Path) -> dict:
    """Held-out position rms in mm by model, and which one is ``selected``."""
    table = read_table(folder / "model_selection.parquet").set_index("model")
    return {**table["held_out_rms_mm"], "selected": table.index[table["selected"] == 1].item()}


def test_an_arm_that_does_not_bend_keeps_the_plain_dh_model(tmp_path):
    cell = fanuc(0, (GRIPPER,), compliance={2: 0.0, 3: 0.0})
    settings = MASSES | {"payload": stated(GRIPPER)}
    results = calibrated(tmp_path, cell, 0, settings, folds=3)
    rms_mm = selection(results)
    assert rms_mm["selected"] == "dh"
    assert rms_mm["compliance"] == pytest.approx(rms_mm["dh"], rel=0.1)
    table = read_table(results / "compliance_model.parquet").query("joint in (2, 3)")
    assert (abs(table["compliance_rad_per_nm"]) < 4.0 * table["std_compliance_rad_per_nm"]).all()


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> tuple[Cell, Path]:
    """A bent arm that carries the same gripper everywhere, and its results."""
    cell, settings = fanuc(21, (GRIPPER,)), MASSES | {"payload": stated(GRIPPER)}
    return cell, calibrated(tmp_path_factory.mktemp("bent"), cell, 21, settings, folds=3)


def test_an_arm_that_bends_is_selected_by_held_out_poses(finished):
    rms_mm, noise_mm = selection(finished[1]), math.sqrt(3.0) * NOISE_MM
    assert rms_mm["selected"] == "compliance"
    assert rms_mm["dh"] > 10.0 * noise_mm
    assert 0.8 * noise_mm < rms_mm["compliance"] < 1.4 * noise_mm


def new_joints(count: int) -> np.ndarray:
    """Reported joints (count, k) in degrees that no fit has seen."""
    low, high = np.clip(FANUC.limits, -150.0, 150.0).T
    share = np.random.default_rng(77).uniform(0.15, 0.85, (count, len(low)))
    return low + share * (high - low)


POSE_NAMES = [*XYZ_MM, "qw", "qx", "qy", "qz"]


def answered(
    command: str, folder: Path, rows: pd.DataFrame, path: Path, model: str
) -> pd.DataFrame:
    """What a command writes for a file, in the instrument's frame."""
    rows.to_csv(path, index=False)
    out = path.with_name(f"{command}-{model}.parquet")
    call(command, folder, path, "--model", model, "--frame", "instrument", "--out", out, code=0)
    return pd.read_parquet(out)


def test_predicted_poses_are_those_of_the_bent_arm(finished, tmp_path):
    cell, folder = finished
    joints = new_joints(12)
    truth = cell.tool_poses(joints, [GRIPPER] * len(joints))
    plan = pd.DataFrame(joints, columns=Q_DEG)
    by = {
        model: answered("predict", folder, plan, tmp_path / "plan.csv", model)
        for model in ("compliance", "dh")
    }
    off = {
        model: np.linalg.norm(poses[XYZ_MM] - truth[:, :3, 3], axis=1)
        for model, poses in by.items()
    }
    assert (off["compliance"] < 4.0 * by["compliance"]["std_position_mm"]).all()
    assert off["compliance"].max() < 0.1
    assert np.median(off["dh"]) > 1.0


def test_compensated_joints_bring_the_bent_arm_to_the_wanted_pose(finished, tmp_path):
    cell, folder = finished
    program = new_joints(8)
    wanted = replace(cell, arm=Arm(FANUC.table)).tool_poses(program, [NONE] * len(program))
    turned = Rotation.from_matrix(wanted[:, :3, :3]).as_quat(scalar_first=True)
    columns = [*POSE_NAMES, *Q_DEG]
    rows = pd.DataFrame(np.hstack([wanted[:, :3, 3], turned, program]), columns=columns)
    corrected = answered("compensate", folder, rows, tmp_path / "wanted.csv", "compliance")
    assert corrected["status"].str.startswith("converged").all()

    def off(joints: np.ndarray) -> np.ndarray:
        there = cell.tool_poses(joints, [GRIPPER] * len(joints))
        return np.linalg.norm(there[:, :3, 3] - wanted[:, :3, 3], axis=1)

    assert off(corrected[Q_DEG].to_numpy()).max() < 0.1
    assert np.median(off(program)) > 1.0

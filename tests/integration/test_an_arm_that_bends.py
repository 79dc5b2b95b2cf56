"""An arm whose joints give way to gravity: measured, fitted, selected, used, or told what is wrong.

Every arm here is bent and measured by `oracles.compliant_arm`, which shares no code with the
package. Truth is known, so estimates are held to the uncertainty stated with them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from command_line import call
from oracles import compliant_arm
from oracles.compliant_arm import Arm, Body, Described
from scipy.stats import chi2
from stages_by_hand import perform

from kinacc.tables.store import read

POSES = 60
NOISE_MM = 0.03
WEIGHT = 500.0  # mm per rad, the default of calibration.rotation_weight_mm_per_rad
BASE = compliant_arm.placed((0.02, -0.03, 0.7), (2600.0, -400.0, 350.0))
TOOL = compliant_arm.placed((0.3, -0.2, 0.5), (40.0, -25.0, 180.0))
NAME = "bent"

FANUC, MH180 = (compliant_arm.described(name) for name in ("fanuc_r2000ic_165f", "mh180"))
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

    ``at_rest``: bent until springs and gravity balance, and not to first order alone. ``base`` and
    ``tool`` (4, 4): the robot's base for the instrument, what it sees in the last DH frame.
    """

    robot: str
    arm: Arm
    joints_deg: np.ndarray
    payloads: Sequence[Body]
    at_rest: bool = False
    base: np.ndarray = field(default_factory=lambda: BASE)
    tool: np.ndarray = field(default_factory=lambda: TOOL)

    def dh_joints(self, joints_deg: np.ndarray) -> np.ndarray:
        return np.radians(joints_deg) * compliant_arm.described(self.robot).sign

    def tool_poses(self, joints_deg: np.ndarray, payloads: Sequence[Body]) -> np.ndarray:
        """Where the tool truly is for the instrument (n, 4, 4)."""
        bent = compliant_arm.flange_at_rest if self.at_rest else compliant_arm.flange
        at = zip(self.dh_joints(joints_deg), payloads, strict=True)
        return np.array([self.base @ bent(self.arm, q, load) @ self.tool for q, load in at])


def arm_in_a_cell(name: str, arm: Arm, seed: int, loads: Sequence[Body]) -> Cell:
    """An arm built a little off its drawing, visited all over its working range."""
    rng = np.random.default_rng(seed)
    low, high = compliant_arm.described(name).limits_deg.T
    low, high = np.maximum(low, -170.0), np.minimum(high, 170.0)
    joints_deg = low + rng.uniform(0.05, 0.95, (POSES, len(low))) * (high - low)
    built = compliant_arm.disturbed(arm, rng, hayati_joints=(2,))
    return Cell(name, built, joints_deg, [loads[i % len(loads)] for i in range(POSES)])


def written(path: Path, cell: Cell, seed: int, with_payload: bool = False) -> Path:
    """The file of a tracker that sees full poses, with noise."""
    rng = np.random.default_rng([seed, 1])
    names = [f"q{i}_deg" for i in range(1, 7)] + ["x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]
    names += ["payload_kg", "payload_x_mm", "payload_y_mm", "payload_z_mm"] * with_payload
    lines = [",".join(names)]
    seen = cell.tool_poses(cell.joints_deg, cell.payloads)
    for joints, pose, load in zip(cell.joints_deg, seen, cell.payloads, strict=True):
        turn = compliant_arm.turn_about(rng.normal(0.0, NOISE_MM / WEIGHT, 3))
        position = pose[:3, 3] + rng.normal(0.0, NOISE_MM, 3)
        row = [*joints, *position, *compliant_arm.quaternion(turn @ pose[:3, :3])]
        row += [load.mass_kg, *load.centre_mm] * with_payload
        lines.append(",".join(repr(float(value)) for value in row))
    path.write_text("\n".join(lines) + "\n")
    return path


def in_words(body: Body) -> dict:
    return {"mass_kg": body.mass_kg, "centre_mm": list(body.centre_mm)}


def configured(
    folder: Path,
    robot: str,
    compliance: dict,
    folds: int | None = None,
    calibration: dict = ESTIMATED,
) -> Path:
    """A configuration file beside the measured file."""
    file = {"path": str(folder / "poses.csv"), "orientation": {"kind": "quaternion"}}
    settings = {
        "measurements": {"folds": folds, **({} if folds else {"validation_fold": None})},
        "calibration": {"vec": {"order": 1}, **calibration, "compliance": compliance},
        "datasets": {NAME: {"robot": robot, "measurements": {"source": "file", "file": file}}},
    }
    path = folder / "cell.yaml"
    path.write_text(yaml.safe_dump(settings))
    return path


def made(artefact: str, config: Path) -> Path:
    """Results folder of the data set, after the stages that lead to an artefact.

    Without the check of the data, which takes longer than all fits and has tests of its own.
    """
    stages = ["measurements", "vec", "compliance", "dh", "residuals", "summary"]
    last = {"measurements": 1, "vec_model": 2, "compliance_model": 3, "dh_model": 4, "frames": 4}
    for name in stages[: last.get(artefact, len(stages))]:
        perform(name, [str(config)], config.parent / "results", NAME)
    return config.parent / "results" / NAME


def fanuc(seed: int, loads: Sequence[Body], compliance=BENT, gravity=(0.0, 0.0, -1.0)) -> Cell:
    """An arm whose maker states its masses."""
    arm = Arm(FANUC.table, FANUC_LINKS, compliance, gravity=gravity)
    return arm_in_a_cell("fanuc_r2000ic_165f", arm, seed, loads)


def mh180(seed: int, loads: Sequence[Body], compliance=BENT) -> Cell:
    """An arm nobody knows the masses of, as if they were one at its end."""
    return arm_in_a_cell("mh180", Arm(MH180.table, (), compliance, PER_LEVER), seed, loads)


def stated_masses(cell: Cell, **more: object) -> dict:
    return {
        "joints": sorted(cell.arm.compliance),
        "links": [in_words(body) for body in FANUC_LINKS],
        **more,
    }


def deviation(table: dict, covariance: dict, truth: dict[str, dict[int, float]]) -> float:
    """Squared deviation of estimates from what was planted, in units of the stated covariance.

    ``truth`` maps a column of ``compliance_model`` to its true values by joint. Chi-squared with
    one degree of freedom for each value, if the covariance is right.
    """
    names, error = [], []
    for column, planted in truth.items():
        for joint, value in planted.items():
            (at,) = np.flatnonzero(table["joint"] == joint)
            names.append(f"j{joint}.{column}")
            error.append(table[column][at] - value)
            std = table[f"std_{column}"][at]
            assert abs(error[-1]) < 4.0 * std, (names[-1], error[-1], std)
            assert std < 0.02 * value, "sixty poses determine this parameter far better"
    pairs = zip(covariance["parameter"], covariance["other"], strict=True)
    of = {
        frozenset(pair): value for pair, value in zip(pairs, covariance["covariance"], strict=True)
    }
    matrix = np.array([[of[frozenset((one, other))] for other in names] for one in names])
    stds = [table[f"std_{c}"][table["joint"] == j].item() for c, by in truth.items() for j in by]
    np.testing.assert_allclose(np.sqrt(np.diag(matrix)), stds, rtol=1e-9)
    return float(error @ np.linalg.solve(matrix, error))


def require_right_uncertainty(deviations: Sequence[float], of_each: int) -> None:
    """The sum over seeds in the middle 99 % of its distribution: neither modest nor boastful."""
    freedom = of_each * len(deviations)
    low, high = chi2.ppf([0.005, 0.995], freedom)
    assert low < sum(deviations) < high, (sum(deviations), low, high)


def tables_of(folder: Path, *names: str) -> list[dict]:
    return [read(folder / f"{name}.parquet") for name in names]


def estimated(folder: Path, cell: Cell, seed: int, settings: dict, columns: bool) -> list[dict]:
    """Model and covariance that the package makes of a measured cell."""
    written(folder / "poses.csv", cell, seed, columns)
    done = made("compliance_model", configured(folder, cell.robot, settings))
    return tables_of(done, "compliance_model", "compliance_covariance")


def test_stiffness_of_an_arm_of_known_masses_comes_back_within_its_uncertainty(tmp_path):
    deviations = []
    for seed in range(8):
        cell = fanuc(seed, (NONE, GRIPPER))
        folder = tmp_path / str(seed)
        folder.mkdir()
        found, covariance = estimated(folder, cell, seed, stated_masses(cell), columns=True)
        deviations.append(deviation(found, covariance, {"compliance_rad_per_nm": BENT}))
        assert np.isnan(found["lever_coefficient_rad_per_mm"]).all()
    require_right_uncertainty(deviations, 2)


def test_without_masses_one_coefficient_per_lever_comes_back(tmp_path):
    deviations = []
    for seed in range(4):
        folder = tmp_path / str(seed)
        folder.mkdir()
        found, covariance = estimated(
            folder, mh180(seed, (NONE,), {}), seed, {"joints": [2, 3]}, columns=False
        )
        truth = {"lever_coefficient_rad_per_mm": PER_LEVER}
        deviations.append(deviation(found, covariance, truth))
    require_right_uncertainty(deviations, 2)


def test_a_payload_that_changes_tells_stiffness_from_moment(tmp_path):
    heavy = Body(160.0, (30.0, -20.0, 200.0))
    deviations = []
    for seed in range(4):
        folder = tmp_path / str(seed)
        folder.mkdir()
        cell = mh180(seed, (NONE, GRIPPER, heavy))
        found, covariance = estimated(folder, cell, seed, {"joints": [2, 3]}, columns=True)
        truth = {"compliance_rad_per_nm": BENT, "lever_coefficient_rad_per_mm": PER_LEVER}
        deviations.append(deviation(found, covariance, truth))
    require_right_uncertainty(deviations, 4)
    (measured,) = tables_of(folder / "results" / NAME, "measurements")
    assert measured["payload_kg"].tolist() == [load.mass_kg for load in cell.payloads]
    assert measured["payload_z_mm"].tolist() == [load.centre_mm[2] for load in cell.payloads]


def selection(folder: Path) -> dict:
    """Held-out position rms in mm by model, and which one is ``selected``."""
    (table,) = tables_of(folder, "model_selection")
    chosen = str(table["model"][table["selected"] == 1].item())
    rms = dict(zip(map(str, table["model"]), table["held_out_rms_mm"].tolist(), strict=True))
    return {**rms, "selected": chosen}


@pytest.mark.parametrize("seed", range(3))
def test_an_arm_that_does_not_bend_keeps_the_plain_dh_model(tmp_path, seed):
    cell = fanuc(seed, (GRIPPER,), compliance={2: 0.0, 3: 0.0})
    written(tmp_path / "poses.csv", cell, seed)
    settings = stated_masses(cell, payload=in_words(GRIPPER))
    done = made("residuals", configured(tmp_path, cell.robot, settings, folds=3))
    found = selection(done)
    assert found["selected"] == "dh"
    assert found["compliance"] == pytest.approx(found["dh"], rel=0.1)
    (table,) = tables_of(done, "compliance_model")
    bending = np.isin(table["joint"], (2, 3))
    size = table["compliance_rad_per_nm"][bending] / table["std_compliance_rad_per_nm"][bending]
    assert np.all(np.abs(size) < 4.0)


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> tuple[Cell, Path]:
    """A bent arm that carries the same gripper everywhere, and its results."""
    folder = tmp_path_factory.mktemp("bent")
    cell = fanuc(21, (GRIPPER,))
    written(folder / "poses.csv", cell, 21)
    settings = stated_masses(cell, payload=in_words(GRIPPER))
    return cell, made("residuals", configured(folder, cell.robot, settings, folds=3))


def test_an_arm_that_bends_is_told_from_held_out_poses(finished):
    found = selection(finished[1])
    noise_mm = math.sqrt(3.0) * NOISE_MM
    assert found["selected"] == "compliance"
    assert found["dh"] > 10.0 * noise_mm
    assert 0.8 * noise_mm < found["compliance"] < 1.4 * noise_mm


def told_by(folder: Path) -> tuple[Arm, np.ndarray, np.ndarray]:
    """Arm, base and tool that tables alone describe, rebuilt by the oracle."""
    table, frames = tables_of(folder, "compliance_model", "frames")
    order = np.argsort(table["joint"])
    of = {name: values[order] for name, values in table.items()}
    rows = ("theta_offset_rad", "d_mm", "a_mm", "alpha_rad", "beta_rad")
    bends = {
        name: {i + 1: float(value) for i, value in enumerate(of[name]) if np.isfinite(value)}
        for name in ("compliance_rad_per_nm", "lever_coefficient_rad_per_mm")
    }
    centres = zip(of["link_mass_kg"], *(of[f"link_{axis}_mm"] for axis in "xyz"), strict=True)
    arm = Arm(
        tuple(zip(*(of[name].tolist() for name in rows), strict=True)),
        tuple(Body(mass, tuple(centre)) for mass, *centre in centres),
        bends["compliance_rad_per_nm"],
        bends["lever_coefficient_rad_per_mm"],
        tuple(of[f"gravity_{axis}"][0] for axis in "xyz"),
    )

    def placed(name: str) -> np.ndarray:
        mine = (frames["model"] == "compliance") & (frames["frame"] == name)
        values = {column: frames[column][mine] for column in frames}
        pose = np.eye(4)
        pose[:3, 3] = [values[f"{axis}_mm"].item() for axis in "xyz"]
        w, *vector = (values[f"q{part}"].item() for part in "wxyz")
        size = math.hypot(*vector)
        scale = 2.0 * math.atan2(size, w) / size if size else 0.0
        pose[:3, :3] = compliant_arm.turn_about([scale * each for each in vector])
        return pose

    return arm, placed("base"), placed("tool")


def new_joints(robot: Described, count: int) -> np.ndarray:
    """Reported joints (count, k) in degrees that no fit has seen."""
    low, high = np.maximum(robot.limits_deg, -150.0).T[0], np.minimum(robot.limits_deg, 150.0).T[1]
    share = np.random.default_rng(77).uniform(0.15, 0.85, (count, len(low)))
    return low + share * (high - low)


def csv_of(path: Path, names: Sequence[str], values: np.ndarray) -> Path:
    lines = [",".join(names), *(",".join(repr(float(x)) for x in row) for row in values)]
    path.write_text("\n".join(lines) + "\n")
    return path


JOINT_NAMES = [f"q{i}_deg" for i in range(1, 7)]
POSE_NAMES = ["x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]


def answered(command: str, folder: Path, given: Path, model: str, expected: int = 0) -> dict:
    """Columns of what a command writes for a file, in the instrument's frame."""
    out = given.with_name(f"{command}-{model}.parquet")
    words = (folder, given, "--model", model, "--frame", "instrument", "--out", out)
    done = call(command, *words)
    assert done.exit_code == expected, done.output
    import pyarrow.parquet

    return {
        name: np.array(column)
        for name, column in pyarrow.parquet.read_table(out).to_pydict().items()
    }


def test_predicted_poses_are_those_of_the_bent_arm(finished, tmp_path):
    cell, folder = finished
    joints = new_joints(FANUC, 12)
    truth = cell.tool_poses(joints, [GRIPPER] * len(joints))
    given = csv_of(tmp_path / "plan.csv", JOINT_NAMES, joints)
    by = {model: answered("predict", folder, given, model) for model in ("compliance", "dh")}
    off = {
        model: np.linalg.norm([found[f"{axis}_mm"] for axis in "xyz"] - truth[:, :3, 3].T, axis=0)
        for model, found in by.items()
    }
    assert np.all(off["compliance"] < 4.0 * by["compliance"]["std_position_mm"])
    assert np.max(off["compliance"]) < 0.1
    assert np.median(off["dh"]) > 1.0

    arm, base, tool = told_by(folder)
    for row, q in enumerate(cell.dh_joints(joints)):
        pose = base @ compliant_arm.flange(arm, q, GRIPPER) @ tool
        found = [by["compliance"][name][row] for name in POSE_NAMES]
        assert found[:3] == pytest.approx(pose[:3, 3], abs=1e-6)
        assert found[3:] == pytest.approx(compliant_arm.quaternion(pose[:3, :3]), abs=1e-9)


def test_compensated_joints_bring_the_bent_arm_to_the_wanted_pose(finished, tmp_path):
    cell, folder = finished
    program = new_joints(FANUC, 8)
    stiff = replace(cell, arm=Arm(FANUC.table))
    wanted = stiff.tool_poses(program, [NONE] * len(program))
    rows = [
        [*pose[:3, 3], *compliant_arm.quaternion(pose[:3, :3]), *joints]
        for pose, joints in zip(wanted, program, strict=True)
    ]
    given = csv_of(tmp_path / "wanted.csv", [*POSE_NAMES, *JOINT_NAMES], np.array(rows))
    found = answered("compensate", folder, given, "compliance")
    assert all(str(status).startswith("converged") for status in found["status"])
    corrected = np.array([found[name] for name in JOINT_NAMES]).T

    def off(joints: np.ndarray) -> np.ndarray:
        there = cell.tool_poses(joints, [GRIPPER] * len(joints))
        return np.linalg.norm(there[:, :3, 3] - wanted[:, :3, 3], axis=1)

    assert np.max(off(corrected)) < 0.1
    assert np.median(off(program)) > 1.0
    arm, base, tool = told_by(folder)
    for pose, q in zip(wanted, cell.dh_joints(corrected), strict=True):
        there = base @ compliant_arm.flange(arm, q, GRIPPER) @ tool
        assert there[:3, 3] == pytest.approx(pose[:3, 3], abs=1e-5)

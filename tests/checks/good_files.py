"""Good measurement files, measured and simulated, to plant faults in."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import shared_data
from scipy.spatial.transform import Rotation

from kinacc.checks.check import check
from kinacc.checks.configuration import load
from kinacc.kinematics import robot as robots
from kinacc.kinematics.robot import forward
from kinacc.measurements.reader import read

MEASURED = {name: f"ur10_tmac/series_{name[-1].upper()}.csv" for name in
            ("ur10_a", "ur10_b", "ur10_c", "ur10_d")}  # fmt: skip
MEASURED["fanuc"] = "fanuc_r2000ic/poses.csv"


@dataclass(frozen=True)
class File:
    """A file before it is written: a table, and what its data set says of it."""

    columns: pd.DataFrame
    robot: str
    orientation: str = "{kind: none}"
    mapping: str = "{}"

    def __len__(self):
        return len(self.columns)

    def but(self, **columns):
        """The file with other numbers in some columns."""
        return replace(self, columns=self.columns.assign(**columns))

    def rows(self, rows):
        """The file with these rows, in this order."""
        return replace(self, columns=self.columns.iloc[rows].reset_index(drop=True))

    def write(self, folder: Path, name: str = "file") -> Path:
        """The configuration beside the file, both written."""
        path, config = folder / f"{name}.csv", folder / f"{name}.yaml"
        self.columns.to_csv(path, index=False)
        config.write_text(
            f"datasets: {{{name}: {{robot: {self.robot}, measurements: {{source: file, file: "
            f"{{path: {path}, orientation: {self.orientation}, columns: {self.mapping}}}}}, "
            "calibration: {base_and_tool: estimated}, evaluation: {space: measured}}}\n"
        )
        return config

    def check(self, folder: Path):
        """What check-data finds in it."""
        settings = load((self.write(folder),))["file"]
        arm, section = robots.load(settings["robot"]), settings["measurements"]["file"]
        return check(read(section, arm, strict=False), section, arm)


def measured(name: str) -> File:
    """A measured file; the test is skipped where it is absent."""
    columns = pd.read_csv(shared_data.path_of(MEASURED[name])).astype(float)
    if name == "fanuc":
        return File(columns, "fanuc_r2000ic_165f", mapping="{pose: config}")
    return File(columns, "ur10", "{kind: euler, convention: XYZ, unit: deg}")


def simulated(
    robot="irb120",
    poses=120,
    noise_mm=0.05,
    targets=("",),
    turned=False,
    repeats=1,
    seed=0,
    share=0.6,
    off=1.0,
) -> File:
    """Readings of an arm that is ``off`` its description, by half a millimetre and a milliradian.

    ``share`` of the joints' ranges is used; ``turned`` adds rotation vectors.
    """
    rng, arm = np.random.default_rng(seed), robots.load(robot)
    errors = off * rng.normal(size=(4, arm.dh.joints)) * [[1e-3], [0.5], [0.5], [1e-3]]
    there = arm.dh.start.reshape(-1, 5) + np.pad(errors.T, ((0, 0), (0, 1)))
    arm = replace(arm, dh=arm.dh.with_parameters(there.ravel()))
    low, high = np.maximum(arm.q_min_rad, -np.pi), np.minimum(arm.q_max_rad, np.pi)
    middle, half = (low + high) / 2, (high - low) / 2 * share
    q = rng.uniform(middle - half, middle + half, (poses, len(low)))
    q = np.round(np.rad2deg(q), 5).repeat(repeats, axis=0)
    flange = forward(arm, np.deg2rad(q))
    base, place = Rotation.from_rotvec(rng.normal(size=3)), rng.uniform(-2000, 2000, 3)
    points = rng.uniform(-60, 60, (max(len(targets), 3), 3)) + np.array([0.0, 0.0, 120.0])
    columns = {f"q{i + 1}_deg": q[:, i] for i in range(q.shape[1])}
    if repeats > 1:
        columns["pose"] = np.arange(poses).repeat(repeats)
    for target, point in zip(targets, points, strict=False):
        at = base.apply(flange.position_mm + flange.rotation @ point) + place
        at = np.round(at + rng.normal(size=at.shape) * noise_mm, 5)
        prefix = f"{target}_" if target else ""
        columns |= {f"{prefix}{axis}_mm": at[:, i] for i, axis in enumerate("xyz")}
    if turned:
        turn = (
            base * Rotation.from_matrix(flange.rotation) * Rotation.from_rotvec(rng.normal(size=3))
        )
        turn = Rotation.from_rotvec(rng.normal(size=(len(q), 3)) * noise_mm * 1e-3) * turn
        degrees = np.round(turn.as_rotvec(degrees=True), 6)
        columns |= {f"r{axis}_deg": degrees[:, i] for i, axis in enumerate("xyz")}
    kind = "{kind: rotation_vector, unit: deg}" if turned else "{kind: none}"
    return File(pd.DataFrame(columns), robot, kind)

"""Good measurement files, measured and simulated, and the means to plant faults in them."""

import csv
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import shared_data

from kinacc.checks import check
from kinacc.checks.contradictions import load
from kinacc.checks.report import Report
from kinacc.geometry import exp_so3, log_so3
from kinacc.kinematics import robot as robots
from kinacc.kinematics.robot import forward
from kinacc.measurements.layout import Layout
from kinacc.measurements.reader import read

MEASURED = {
    "ur10_a": "ur10_tmac/series_A.csv",
    "ur10_b": "ur10_tmac/series_B.csv",
    "ur10_c": "ur10_tmac/series_C.csv",
    "ur10_d": "ur10_tmac/series_D.csv",
    "fanuc": "fanuc_r2000ic/poses.csv",
}


@dataclass(frozen=True)
class File:
    """A file before it is written: numbers by column, and what its data set says of it."""

    columns: dict[str, np.ndarray]
    robot: str
    orientation: str = "{kind: none}"
    mapping: str = "{}"

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def but(self, **columns) -> "File":
        """The file with other numbers in some columns."""
        return replace(self, columns=self.columns | columns)

    def rows(self, rows) -> "File":
        """The file with these rows, in this order."""
        return replace(self, columns={name: v[rows] for name, v in self.columns.items()})

    def write(self, folder: Path, name: str = "file") -> Path:
        """The configuration beside the file, both written."""
        path = folder / f"{name}.csv"
        with open(path, "w", newline="") as stream:
            out = csv.writer(stream)
            out.writerow(self.columns)
            cells = [["" if v != v else repr(float(v)) for v in c] for c in self.columns.values()]
            out.writerows(zip(*cells, strict=True))
        config = folder / f"{name}.yaml"
        config.write_text(
            f"datasets: {{{name}: {{robot: {self.robot}, measurements: {{source: file, file: "
            f"{{path: {path}, orientation: {self.orientation}, columns: {self.mapping}}}}}, "
            "calibration: {base_and_tool: estimated}, evaluation: {space: measured}}}\n"
        )
        return config

    def check(self, folder: Path) -> Report:
        """What check-data says of it."""
        config = load((self.write(folder),))["file"]
        arm = robots.load(config["robot"])
        section = config["measurements"]["file"]
        reading = read(section, arm, strict=False)
        return check.check(
            reading, Layout.of(section), arm, "file", section["path"], lambda each, _: each
        )


def measured(name: str) -> File:
    """A file of the measured ones, of which the tests are skipped where it is absent."""
    path = shared_data.path_of(MEASURED[name])
    with open(path, newline="") as stream:
        names, *rows = list(csv.reader(stream))
    values = np.array(rows, dtype=float).T
    columns = dict(zip(names, values, strict=True))
    if name == "fanuc":
        return File(columns, "fanuc_r2000ic_165f", mapping="{pose: config}")
    return File(columns, "ur10", "{kind: euler, convention: XYZ, unit: deg}")


def simulated(
    robot: str = "irb120",
    poses: int = 120,
    noise_mm: float = 0.05,
    targets: tuple[str, ...] = ("",),
    turned: bool = False,
    repeats: int = 1,
    seed: int = 0,
    share: float = 0.6,
) -> File:
    """Readings of an arm that is off its description by half a millimetre and a milliradian.

    ``share`` of the joints' ranges is used; ``turned`` adds rotation vectors.
    """
    rng = np.random.default_rng(seed)
    arm = robots.load(robot)
    vector = np.stack([arm.dh.theta_offset_rad, arm.dh.d_mm, arm.dh.a_mm, arm.dh.alpha_rad])
    off = rng.normal(size=vector.shape) * np.array([[1e-3], [0.5], [0.5], [1e-3]])
    there = replace(arm, dh=replace(arm.dh, **dict(
        zip(("theta_offset_rad", "d_mm", "a_mm", "alpha_rad"), vector + off, strict=True)
    )))  # fmt: skip
    low, high = np.maximum(arm.q_min_rad, -np.pi), np.minimum(arm.q_max_rad, np.pi)
    middle, half = (low + high) / 2, (high - low) / 2 * share
    q = rng.uniform(middle - half, middle + half, (poses, len(low)))
    q = np.round(np.rad2deg(q), 5).repeat(repeats, axis=0)
    flange = forward(there, np.deg2rad(q))
    base = exp_so3(rng.normal(size=3)), rng.uniform(-2000, 2000, 3)
    points = rng.uniform(-60, 60, (max(len(targets), 3), 3)) + np.array([0.0, 0.0, 120.0])
    columns = {f"q{i + 1}_deg": q[:, i] for i in range(q.shape[1])}
    if repeats > 1:
        columns["pose"] = np.arange(poses).repeat(repeats)
    for target, point in zip(targets, points, strict=False):
        at = flange.position_mm + flange.rotation @ point
        measured_mm = at @ base[0].T + base[1] + rng.normal(size=at.shape) * noise_mm
        prefix = f"{target}_" if target else ""
        columns |= {f"{prefix}{a}_mm": np.round(measured_mm[:, i], 5) for i, a in enumerate("xyz")}
    if turned:
        turn = base[0] @ flange.rotation @ exp_so3(rng.normal(size=3))
        turn = exp_so3(rng.normal(size=q[:, :3].shape) * noise_mm * 1e-3) @ turn
        degrees = np.rad2deg(log_so3(turn))
        columns |= {f"r{a}_deg": np.round(degrees[:, i], 6) for i, a in enumerate("xyz")}
    return File(columns, robot, "{kind: rotation_vector, unit: deg}" if turned else "{kind: none}")

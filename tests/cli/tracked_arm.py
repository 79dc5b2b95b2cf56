"""What an arm that is a little off did, as its controller and a laser tracker have it."""

from dataclasses import dataclass, replace

import numpy as np
from command_line import answer, call
from read_columns import Q_DEG as Q
from read_columns import XYZ_MM, joints_of, points_of, turns_of
from scipy.spatial.transform import Rotation

from kinacc.checks.configuration import load
from kinacc.kinematics import robot
from kinacc.measurements.intake import guess as guesses
from kinacc.measurements.reader import read

XYZ = ["X [mm]", "Y [mm]", "Z [mm]"]
NAMES = [*Q, *XYZ_MM]


@dataclass(frozen=True)
class Tracked:
    """Joints (n, 6) in deg as read back, points (n, 3) in mm and rotations of a target."""

    name: str
    q: np.ndarray
    point: np.ndarray
    turn: Rotation
    controller: np.ndarray


def tracked(name="ur10", poses=16, seed=4, digits=4):
    """A run of ``poses`` on the shipped robot ``name``, whose links are off by up to 0.5 mm."""
    arm, rng = robot.load(name), np.random.default_rng(seed)
    low, high = np.maximum(arm.q_min_rad, -1.8), np.minimum(arm.q_max_rad, 1.8)
    q = np.round(np.rad2deg(rng.uniform(0.9 * low, 0.9 * high, (poses, arm.dh.joints))), digits)
    off = replace(arm.dh, a_mm=arm.dh.a_mm + rng.uniform(-0.5, 0.5, arm.dh.a_mm.shape))
    nominal = robot.forward(arm, np.deg2rad(q))
    pose = robot.forward(replace(arm, dh=off), np.deg2rad(q))
    base = Rotation.from_euler("XYZ", [20, -30, 100], degrees=True)
    tip = pose.position_mm + pose.rotation @ np.array([40.0, -25.0, 120.0])
    point = base.apply(tip) + np.array([2000.0, -900.0, 300.0])
    point = np.round(point + rng.normal(0, 0.03, point.shape), 4)
    turn = base * Rotation.from_matrix(pose.rotation)
    return Tracked(name, q, point, turn, nominal.position_mm)


def table(names, *columns, mark=","):
    """Text of a file: names, then rows of columns, numbers with up to nine digits."""
    blocks = [np.asarray(each, dtype=object) for each in columns]
    blocks = [each[:, None] if each.ndim == 1 else each for each in blocks]
    rows = [
        mark.join(v if isinstance(v, str) else f"{float(v):.9g}" for v in row)
        for row in np.hstack(blocks)
    ]
    return "\n".join([mark.join(names), *rows]) + "\n"


def init_seen(folder, arm):
    """A file seen.csv of the arm, and what init makes of it beside it."""
    (folder / "seen.csv").write_text(table(NAMES, arm.q, arm.point))
    call("init", folder / "seen.csv", "--robot", "ur10", "--out", folder, code=0)


def quickened(path):
    """A configuration as init writes it, with models and folds that take no second; its text."""
    text = path.read_text().replace("order: auto", "order: 1").replace("folds: 5", "folds: 2")
    path.write_text(text)
    return text


def written(folder, **texts):
    """The files of these texts, named after their keywords: joints_csv is joints.csv."""
    paths = []
    for name, text in texts.items():
        path = folder / ".".join(name.rsplit("_", 1))
        path.write_text(text, encoding="utf-8")
        paths.append(path)
    return paths


def described(paths, *options):
    """What a run would read from the data set that init writes, and init's answer."""
    cell = paths[0].parent / "cell"
    words = ("--robot", "ur10", "--out", cell, "--name", "m", "--force", *options)
    told = answer("init", *paths, *words)
    return load((cell / "m.yaml",))["m"]["measurements"]["file"], told


def looked(paths, **answers):
    """What a run would read of the files, before the robot is tried on it, and notes."""
    guess = guesses.look(paths, answers)
    return guess.section, guess.notes


def refused(paths, *options):
    """What init says where it does not go on."""
    cell = paths[0].parent / "cell"
    done = call("init", *paths, "--robot", "ur10", "--out", cell, *options, code=2)
    assert not cell.exists()
    return done.output


def assert_read(section, arm, rows=None):
    """The run reads joints and points of these rows of the arm, in order; returns its columns."""
    rows = np.arange(len(arm.q)) if rows is None else np.asarray(rows)
    columns = read(section, robot.load(arm.name), strict=False).columns
    columns = {name: values[columns["target"] == "tool"] for name, values in columns.items()}
    np.testing.assert_allclose(np.rad2deg(joints_of(columns)), arm.q[rows], atol=1e-4)
    np.testing.assert_allclose(points_of(columns), arm.point[rows], atol=1e-3)
    return columns


def assert_turned(columns, arm):
    """The orientations are those of the target."""
    assert (turns_of(columns) * arm.turn.inv()).magnitude().max() < 1e-5

"""What the command line makes of a measured file: right, partial, asked, refused, wrong, crashed.

A file is read right where every reading that was made, and no other, arrives with its joints,
position, orientation and standard deviation, under one target per reflector and one pose per
configuration, and the described robot reaches the points. It is partial where what arrived is true
and something is left out, or a suspicion is named and the arm left as it was.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import yaml
from command_line import call
from scipy.spatial.transform import Rotation
from stages_by_hand import run_stage

RIGHT, PARTIAL, ASKED = "right", "partial", "asked"
REFUSED, WRONG, CRASHED = "refused", "wrong", "crashed"
RELATIVE = 1e-6
ROBOT, LEFT_OUT = "the robot as described", "are left out"
REACHED_MM = 15.0  # DH errors leave 1 to 3 mm; a wrong sign, unit or coupling leaves hundreds

# Words by which a message shows that it asks what the file leaves open.
WORDS = {
    "angle unit": r"gon\b|degree|\bdeg\b",
    "clock": r"clock|time",
    "euler convention": r"euler|convention|orientation",
    "horizontal angle": r"clockwise|horizontal|\bHz\b",
    "inches": r"inch|\(in\)",
    "joint unit": r"joint.*(unit|deg|rad)",
    "joints": r"joint",
    "key": r"\bkey\b|\btimes?\b|time stamp|order",
    "length unit": r"length|position.*(unit|mm|\bm\b)",
    "measurement": r"measure",
    "pulses": r"pulse",
    "quaternion order": r"quaternion|scalar|orientation",
    "reflector radius": r"radi(us|i)",
    "sheet": r"sheet",
    "sigma": r"sigma|standard deviation|\bk ?= ?[12]|coverage",
}
GIVEN = {"--robot", "--yes", "--json", "--out", "--name", "--help", "--force"}


@dataclass(frozen=True)
class Measured:
    """A measured file, or two, of ``foreign/``, and what a reader has to find: a row per reading.

    `joints_rad` (n, k) as the robot reports them; `points_mm` per target (n, 3), nan without a
    reading; `rotations` (n, 3, 3) of the first target or None; `std_mm` per target (n, 3) where
    stated. `questions`: what the file leaves open. `must_ask`: the same, where neither the file
    nor the numbers can answer. `any_frame`: the reader chooses the axes (angles and distance).
    `says`: what the answer has to mention, as a regular expression. Where `readable` is False the
    file may be refused: it lacks something, or nobody would blame a reader for saying no.
    """

    files: tuple[Path, ...]
    robot: str
    joints_rad: np.ndarray
    points_mm: dict[str, np.ndarray]
    rotations: np.ndarray | None = None
    std_mm: dict[str, np.ndarray] | None = None
    questions: frozenset[str] = frozenset()
    must_ask: frozenset[str] = frozenset()
    any_frame: bool = False
    readable: bool = True
    says: str = ""


FOREIGN = Path(__file__).parent / "foreign"
FILES = sorted(path.name for path in FOREIGN.iterdir())


def measured(name: str) -> Measured:
    """A file as a maker of instruments, robots or tables writes it, and its truth."""
    folder = FOREIGN / name
    told = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
    for key in ("joints_rad", "rotations"):
        told |= {key: np.array(told[key], dtype=float)} if key in told else {}
    for key in ("points_mm", "std_mm"):
        if key in told:
            told[key] = {target: np.array(each, dtype=float) for target, each in told[key].items()}
    for key in ("questions", "must_ask"):
        told[key] = frozenset(told.get(key, ()))
    told["files"] = tuple(folder / each for each in told["files"])
    if (folder / told["robot"]).is_file():
        told["robot"] = str(folder / told["robot"])
    return Measured(**told)


@dataclass(frozen=True)
class Score:
    """Outcome, the reason in a few words, and whether it will do."""

    outcome: str
    reason: str
    holds: bool


def score(measured: Measured, folder: Path) -> Score:
    """Describe and read a file through the command line, and compare with what is true."""
    words = ["--robot", measured.robot, "--yes", "--json", "--out", folder, "--name", "n"]
    described = call("init", *measured.files, *words)
    if described.exit_code != 0:
        return _not_read(measured, described, "init")
    read = run_stage("measurements", "--config", folder / "n.yaml", "--results", folder / "r")
    if read.exit_code != 0:
        return _not_read(measured, read, "run", asked=False)
    wrong = difference(measured, folder / "r" / "n")
    said = _without_paths(described.output + read.output, measured)
    if not wrong and not re.search(measured.says, said, re.IGNORECASE):
        return Score(PARTIAL if measured.readable else WRONG, "does not say so", False)
    if not wrong:
        return Score(RIGHT, "", True)
    told = ROBOT in wrong and re.search(r"joint_(coupling|sign|zero)", described.output)
    return Score(PARTIAL if told or LEFT_OUT in wrong else WRONG, wrong, False)


def _not_read(measured: Measured, result: object, command: str, asked: bool = True) -> Score:
    """Asked, refused or crashed, by exit code and message."""
    said = _without_paths(" ".join(result.output.split()), measured)
    if result.exit_code != 2:
        crash = repr(result.exception) if result.exception else said
        return Score(CRASHED, f"{command}, exit code {result.exit_code}: {crash[:150]}", False)
    reason = f"{command}: {said[:150]}"
    to_the_point = any(re.search(WORDS[q], said, re.IGNORECASE) for q in measured.questions)
    named = set(re.findall(r"--[a-z][a-z-]+", said)) & options() - GIVEN
    if not (asked and named):
        return Score(REFUSED, reason, to_the_point and not measured.readable)
    return Score(ASKED, f"{', '.join(sorted(named))}: {reason}", to_the_point)


def _without_paths(said: str, measured: Measured) -> str:
    """A message without the names of files, whose words are not the reader's."""
    for path in measured.files:
        said = said.replace(str(path), "FILE").replace(path.name, "FILE")
    return said.replace(str(measured.files[0].parent), "FOLDER")


@cache
def options() -> set[str]:
    """Options that `kinacc init` has."""
    return set(re.findall(r"--[a-z][a-z-]+", call("init", "--help").output))


def expected(measured: Measured) -> pd.DataFrame:
    """Readings that were made, one row each, with the columns of measurements.parquet."""
    frames = []
    for target, points in measured.points_mm.items():
        frame = pd.DataFrame(points, columns=["x_mm", "y_mm", "z_mm"])
        for joint, values in enumerate(measured.joints_rad.T, 1):
            frame[f"q{joint}"] = values
        std = np.full_like(points, np.nan)
        if measured.std_mm is not None:
            std = measured.std_mm[target]
        frame[["std_x_mm", "std_y_mm", "std_z_mm"]] = std
        frame["target"], frame["reading"] = target, range(len(frame))
        frames.append(frame)
    return pd.concat(frames).dropna(subset=["x_mm"]) if frames else pd.DataFrame()


def difference(measured: Measured, results: Path) -> str:
    """What is wrong with the readings as they arrived, or nothing."""
    found = pd.read_parquet(results / "measurements.parquet")
    true = expected(measured)
    if true.empty:
        return "read, although nothing was measured"
    if len(found) != len(true):
        return f"{len(found)} readings instead of {len(true)}"
    joints = [f"q{i + 1}" for i in range(measured.joints_rad.shape[1])]
    if [name for name in found.columns if re.fullmatch(r"q\d", name)] != joints:
        return "another number of joints"
    rows = _matched(measured, true, found, joints)
    if isinstance(rows, str):
        return rows
    found = found.iloc[rows].reset_index(drop=True)
    true = true.reset_index(drop=True)
    if not _same(found[joints], true[joints], 1e-9):
        return "joints differ"
    checks = (_labels_wrong, _rotations_wrong, _deviations_wrong)
    wrong = next(filter(None, (check(measured, true, found) for check in checks)), "")
    return wrong or _robot_wrong(found, joints, results)


def _same(found: pd.DataFrame, true: pd.DataFrame, floor: float) -> bool:
    """Whether numbers agree to the relative tolerance."""
    return np.allclose(found.to_numpy(float), true.to_numpy(float), rtol=RELATIVE, atol=floor)


def _matched(
    measured: Measured, true: pd.DataFrame, found: pd.DataFrame, joints: list[str]
) -> np.ndarray | str:
    """Row of `found` for each true reading, by position, or by joints where axes are free."""
    xyz = ["x_mm", "y_mm", "z_mm"]
    by = joints if measured.any_frame else xyz
    apart = np.abs(true[by].to_numpy()[:, None] - found[by].to_numpy(float)[None]).max(axis=2)
    rows = apart.argmin(axis=1)
    if len(set(rows)) != len(rows):
        return "positions are not those measured"
    seen, wanted = found[xyz].to_numpy(float)[rows], true[xyz].to_numpy()
    if measured.any_frame:
        turn, _ = Rotation.align_vectors(wanted - wanted.mean(0), seen - seen.mean(0))
        seen = turn.apply(seen - seen.mean(0)) + wanted.mean(0)
    if not np.allclose(seen, wanted, rtol=RELATIVE, atol=1e-3 if measured.any_frame else 1e-6):
        return f"positions differ by up to {np.abs(seen - wanted).max():.3g} mm"
    return rows


def _labels_wrong(measured: Measured, true: pd.DataFrame, found: pd.DataFrame) -> str:
    """One name per reflector, one pose per configuration, repeats told apart."""
    names = set(zip(true["target"], found["target"], strict=True))
    if not len(names) == true["target"].nunique() == found["target"].nunique():
        return "targets are mixed up"
    _, configuration = np.unique(measured.joints_rad, axis=0, return_inverse=True)
    places = configuration.ravel()[true["reading"]]
    poses = set(zip(places, found["pose"], strict=True))
    if not len(poses) == len(set(places)) == found["pose"].nunique():
        return "equal joints are different poses, or different ones the same"
    if found.duplicated(["pose", "target", "repeat"]).any():
        return "repeats are not told apart"
    return ""


def _rotations_wrong(measured: Measured, true: pd.DataFrame, found: pd.DataFrame) -> str:
    """Orientations of the first target."""
    quaternions = found[["qx", "qy", "qz", "qw"]].to_numpy(float)
    if measured.rotations is None:
        return "" if np.isnan(quaternions).all() else "orientations that were not measured"
    if np.isnan(quaternions).any():
        return f"orientations {LEFT_OUT}"
    seen = Rotation.from_quat(quaternions).as_matrix()
    wanted = measured.rotations[true["reading"]]
    return "" if np.allclose(seen, wanted, atol=RELATIVE) else "orientations differ"


def _deviations_wrong(measured: Measured, true: pd.DataFrame, found: pd.DataFrame) -> str:
    """Standard deviations: read where stated, and never taken where only a person knows."""
    names = ["std_x_mm", "std_y_mm", "std_z_mm"]
    read = found[names].to_numpy(float)
    if np.isnan(read).all():
        return f"standard deviations {LEFT_OUT}" if measured.std_mm is not None else ""
    if measured.must_ask:
        return "standard deviations taken without asking how many of them"
    if measured.std_mm is None:
        return "standard deviations that nobody stated"
    return "" if _same(found[names], true[names], 1e-9) else "standard deviations differ"


def _robot_wrong(found: pd.DataFrame, joints: list[str], results: Path) -> str:
    """Whether the arm as described reaches the points, with base and target free."""
    arm = yaml.safe_load(pd.read_parquet(results / "robot.parquet")["description"][0])
    first = found[found["target"] == found["target"].iloc[0]]
    rows = np.array(
        [[_number(row, key) for key in ("theta_offset", "d", "a", "alpha")] for row in arm["dh"]]
    )
    mapped = np.array(arm.get("joint_map") or np.diag([row.get("sign", 1) for row in arm["dh"]]))
    turned, moved = flange(rows, first[joints].to_numpy(float) @ mapped.T)
    off = reach_mm(turned, moved, first[["x_mm", "y_mm", "z_mm"]].to_numpy(float))
    return "" if off < REACHED_MM else f"{ROBOT} misses the points by {off:.0f} mm"


def flange(rows: np.ndarray, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (n, 3, 3) and position (n, 3) of the flange for DH joints (n, k)."""
    turned = np.tile(np.eye(3), (len(joints), 1, 1))
    moved = np.zeros((len(joints), 3))
    for row, angle in zip(np.asarray(rows, dtype=float), joints.T, strict=True):
        theta, d, a, alpha = angle + row[0], row[1], row[2], row[3]
        about_z = Rotation.from_rotvec(theta[:, None] * [0, 0, 1]).as_matrix()
        link = about_z @ np.array([a, 0.0, 0.0]) + np.array([0.0, 0.0, d])
        moved = moved + np.einsum("nij,nj->ni", turned, link)
        turned = turned @ about_z @ Rotation.from_euler("x", alpha).as_matrix()
    return turned, moved


def _number(row: dict[str, float], key: str) -> float:
    """A length in mm or an angle in rad of a row of a robot file."""
    factors = {"_deg": np.pi / 180, "_rad": 1.0, "_mm": 1.0, "_m": 1000.0}
    return next((row[key + unit] * by for unit, by in factors.items() if key + unit in row), 0.0)


def reach_mm(turned: np.ndarray, moved: np.ndarray, seen: np.ndarray) -> float:
    """Rms distance of the points from the arm's, over every base and place of the target."""
    target = np.zeros(3)
    for _ in range(60):
        reached = turned @ target + moved
        base, _ = Rotation.align_vectors(seen - seen.mean(0), reached - reached.mean(0))
        place = seen.mean(0) - base.apply(reached.mean(0))
        wanted = base.inv().apply(seen - place) - moved
        target = np.einsum("nij,ni->j", turned, wanted) / len(seen)
    left = base.apply(turned @ target + moved) + place - seen
    return float(np.sqrt((left**2).sum(axis=1).mean()))

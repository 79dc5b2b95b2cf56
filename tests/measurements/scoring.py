"""What the command line makes of a measured file, beside the readings that were made.

A file is read right where every reading that was made, and no other, arrives with its joints,
position, orientation and standard deviation, under one target per reflector and one pose per
configuration, and the described robot reaches the points.
"""

from __future__ import annotations

import json
import re
import warnings
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
from command_line import call
from read_columns import XYZ_MM
from scipy.spatial.transform import Rotation
from stages_by_hand import run_stages

from kinacc.calibration import fitting
from kinacc.calibration.observations import from_columns
from kinacc.errors import KinaccError
from kinacc.geometry import Pose, compose
from kinacc.kinematics import robot

RELATIVE = 1e-6
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
STD = ["std_x_mm", "std_y_mm", "std_z_mm"]
FOREIGN = Path(__file__).parent / "foreign"
FILES = sorted(path.name for path in FOREIGN.iterdir())


# What a truth leaves out.
USUAL = {"rotations": None, "std_mm": None, "questions": (), "any_frame": False, "readable": True}
USUAL |= {"says": ""}


def measured(name: str) -> SimpleNamespace:
    """A measured file, or two, of ``foreign/``, and what a reader has to find: a row per reading.

    `joints_rad` (n, k) as the robot reports them; `points_mm` per target (n, 3), nan without a
    reading; `rotations` (n, 3, 3) of the first target; `std_mm` per target (n, 3) where stated.
    `questions`: what the file leaves open. `any_frame`: the reader chooses the axes (angles and
    distance). `says`: what the answer has to mention. A file that is not `readable` may be refused.
    """
    folder = FOREIGN / name
    truth = USUAL | json.loads((folder / "truth.json").read_text(encoding="utf-8"))
    for key in ("points_mm", "std_mm"):
        truth[key] = {target: np.array(rows, float) for target, rows in (truth[key] or {}).items()}
    truth["joints_rad"] = np.array(truth["joints_rad"], dtype=float)
    truth["files"] = [folder / path for path in truth["files"]]
    if (folder / truth["robot"]).is_file():
        truth["robot"] = str(folder / truth["robot"])
    return SimpleNamespace(**truth)


def fault(measured: SimpleNamespace, folder: Path) -> str:
    """What is wrong with the answer of init and run; nothing where the file is read right, asked
    about what it leaves open, or refused where that may be."""
    words = ["--robot", measured.robot, "--json", "--out", folder, "--name", "n"]
    described = call("init", *measured.files, *words)
    if described.exit_code == 0:
        try:
            with warnings.catch_warnings(record=True) as told:
                warnings.simplefilter("always")
                run_stages(["measurements"], [folder / "n.yaml"], folder / "r")
        except KinaccError as error:
            return f"run: {error}"
        said = "\n".join([described.output, *(str(each.message) for each in told)])
        wrong = difference(measured, folder / "r" / "n")
        silent = not re.search(measured.says, said, re.IGNORECASE)
        return wrong or ("does not say so" if silent else "")
    said = " ".join(described.output.split())
    for path in measured.files:  # whose words are not the reader's
        said = said.replace(str(path), "").replace(path.name, "")
    asks = re.search(r"give --(?!robot)[a-z]", said) is not None
    to_the_point = any(re.search(WORDS[q], said, re.IGNORECASE) for q in measured.questions)
    if described.exit_code == 2 and to_the_point and (asks or not measured.readable):
        return ""
    return f"exit code {described.exit_code}: {said} {described.exception!r}"


def difference(measured: SimpleNamespace, results: Path) -> str:
    """What is wrong with the readings as they arrived, or nothing."""
    found = pd.read_parquet(results / "measurements.parquet")
    parts = []
    for target, points in measured.points_mm.items():
        part = pd.DataFrame(points, columns=XYZ_MM).assign(
            target=target, reading=range(len(points))
        )
        part[[f"q{i + 1}" for i in range(measured.joints_rad.shape[1])]] = measured.joints_rad
        part[STD] = measured.std_mm[target] if measured.std_mm else np.nan
        parts.append(part.dropna(subset=["x_mm"]))
    true = pd.concat(parts).reset_index(drop=True) if parts else pd.DataFrame()
    joints = [name for name in true if re.fullmatch(r"q\d", name)]
    if len(found) != len(true) or [n for n in found if re.fullmatch(r"q\d", n)] != joints:
        return f"{len(found)} readings of {len(true)}, or another number of joints"
    # Row of each true reading, by position, or by joints where axes are free.
    by = joints if measured.any_frame else XYZ_MM
    apart = np.abs(true[by].to_numpy()[:, None] - found[by].to_numpy(float)[None]).max(axis=2)
    found = found.iloc[apart.argmin(axis=1)].reset_index(drop=True)
    seen, wanted = found[XYZ_MM].to_numpy(float), true[XYZ_MM].to_numpy()
    if measured.any_frame:
        turn, _ = Rotation.align_vectors(wanted - wanted.mean(0), seen - seen.mean(0))
        seen = turn.apply(seen - seen.mean(0)) + wanted.mean(0)
    configuration = np.unique(measured.joints_rad, axis=0, return_inverse=True)[1].ravel()
    true["pose"] = configuration[true["reading"]]
    checks = {
        "positions": len({*apart.argmin(axis=1)}) == len(true)
        and np.allclose(seen, wanted, RELATIVE, 1e-3 if measured.any_frame else 1e-6),
        "joints": np.allclose(found[joints].to_numpy(float), true[joints], RELATIVE, 1e-9),
        "targets": _same_groups(true["target"], found["target"]),
        "poses": _same_groups(true["pose"], found["pose"]),
        "repeats": not found.duplicated(["pose", "target", "repeat"]).any(),
        "orientations": _rotations_right(measured, true, found),
        "standard deviations": np.allclose(
            found[STD].to_numpy(float), true[STD].to_numpy(float), RELATIVE, 1e-9, equal_nan=True
        ),
        "reach of the robot as described": _reach_mm(found, results) < REACHED_MM,
    }
    return ", ".join(name for name, right in checks.items() if not right)


def _same_groups(true: pd.Series, found: pd.Series) -> bool:
    """Whether two columns part the rows into the same groups."""
    pairs = {*zip(true, found, strict=True)}
    return len(pairs) == true.nunique() == found.nunique()


def _rotations_right(measured: SimpleNamespace, true: pd.DataFrame, found: pd.DataFrame) -> bool:
    quaternions = found[["qx", "qy", "qz", "qw"]].to_numpy(float)
    if measured.rotations is None or np.isnan(quaternions).any():
        return measured.rotations is None and bool(np.isnan(quaternions).all())
    seen = Rotation.from_quat(quaternions).as_matrix()
    return np.allclose(seen, np.array(measured.rotations)[true["reading"]], atol=RELATIVE)


def _reach_mm(found: pd.DataFrame, results: Path) -> float:
    """Rms distance of the points from those of the arm, base and targets fitted."""
    text = pd.read_parquet(results / "robot.parquet")["description"][0]
    arm = robot.of_text(text, "arm.yaml")
    seen = from_columns(found, arm)
    frames = fitting.fit_frames(seen, arm.dh, rotation_weight_mm_per_rad=500.0)
    targets = Pose(*(part[seen.target] for part in frames.targets))
    reached = compose(frames.base, compose(arm.dh.pose(seen.at), targets))
    return float(np.sqrt(np.mean((reached.position_mm - seen.position_mm) ** 2) * 3.0))

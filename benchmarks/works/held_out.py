"""Errors held out

Mean error of positions that a fit has not seen, beside the time of a fit: the UR5 grid of
``examples/data``, 1,000 positions, each of five random folds predicted by a fit to the others.
kinacc's is its DH model, with base and tool.

robotkinecal fits a product of exponentials. It needs numpy below 2, hence an environment by itself,
and measures its fits there, without the start of Python. Order and prior of the VEC model are
chosen without the fold in question before fits are timed.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Sequence
from functools import partial
from importlib.metadata import version
from operator import attrgetter
from typing import NamedTuple

import numpy as np
import pandas as pd
from harness import ROOT, Contender, Work

from kinacc.api import read_measurements
from kinacc.calibration.models import Estimator, estimators, fit_all
from kinacc.calibration.observations import Observations, from_columns
from kinacc.calibration.residuals import errors
from kinacc.kinematics.dh import DHModel
from works.processes import folder

GRID = ROOT / "examples" / "data" / "ur5_gts" / "published_grid.csv"
PYTHON = ROOT / ".venv-robotkinecal" / "bin" / "python"


class Held(NamedTuple):
    """Mean held-out error, and seconds of CPU time of all fits where another process has them."""

    error_mm: float
    seconds: float = 0.0


def works(smoke: bool) -> list[Work]:
    """DH beside VEC and robotkinecal; in smoke size at a stated order."""
    grid = pd.read_csv(GRID)
    table = grid.filter(like="joint_").set_axis([f"q{i}_deg" for i in range(1, 7)], axis=1)
    for axis in "xyz":
        table[f"{axis}_mm"] = grid[f"{axis}_t"] + grid[f"{axis}_dif"]
    path = folder() / "grid.csv"
    table.to_csv(path, index=False)
    settings = {"measurements": {"folds": 5, "validation_fold": None}}
    if smoke:
        settings["calibration"] = {"vec": {"order": 2, "prior": "stated"}}
    read = read_measurements(path, robot=str(ROOT / "examples/ur5.robot.yaml"), settings=settings)
    seen = from_columns(read.table, read.robot)
    kinds = estimators(read.settings["calibration"], read.robot, seen)
    contenders = [
        Contender(name, version("kinacc"), _kinacc(seen, kinds[kind]))
        for name, kind in (("kinacc", "dh"), ("kinacc VEC", "vec"))
    ]
    if PYTHON.exists():
        locked = (ROOT / "requirements" / "robotkinecal.txt").read_text()
        installed = re.search(r"^robotkinecal==(\S+)", locked, re.MULTILINE)[1]
        run = partial(_robotkinecal, seen, read.robot.dh)
        contenders.append(Contender("robotkinecal", installed, run, attrgetter("seconds")))
    error_mm = attrgetter("error_mm")
    name = "DH fit, 800 positions"
    return [Work(name, "fit", 5, contenders, _agree, error_mm=error_mm, seconds=60.0)]


def _kinacc(seen: Observations, estimator: Estimator):
    tables = estimator.choices(seen)

    def run() -> Held:
        error_mm = np.empty(len(seen))
        for fold in range(5):
            out = seen.fold == fold
            fits = fit_all(seen.select(~out), [estimator.chosen(tables, fold)])
            held_out = errors(fits, seen.select(out))[f"{estimator.kind}_vs_measured"]
            error_mm[out] = np.linalg.norm(held_out[:, :3], axis=1)
        return Held(float(error_mm.mean()))

    return run


def _robotkinecal(seen: Observations, arm: DHModel) -> Held:
    given = folder() / "given.npz"
    dh = np.stack([arm.theta_offset_rad, arm.d_mm, arm.a_mm, arm.alpha_rad], axis=1)
    np.savez(given, q_rad=seen.q_rad, position_mm=seen.position_mm, fold=seen.fold, dh=dh)
    found = given.with_name("found.npz")
    script = ROOT / "benchmarks" / "robotkinecal_folds.py"
    subprocess.run([PYTHON, script, given, found], check=True, stdout=subprocess.DEVNULL)
    with np.load(found) as held:
        errors_mm = np.linalg.norm(held["predicted_mm"] - seen.position_mm, axis=1)
        return Held(float(errors_mm.mean()), float(held["seconds"]))


def _agree(outputs: Sequence[Held]) -> None:
    """robotkinecal has the freedoms of the DH model: the same error to 1 %; VEC is no worse."""
    dh, vec, *others = (held.error_mm for held in outputs)
    np.testing.assert_allclose(others, dh, rtol=0.01)
    assert vec < dh, f"{vec} mm, DH {dh} mm"

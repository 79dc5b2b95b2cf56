"""Order and prior of a VEC model chosen held out, and the residual tables of five folds.

*Limit of a choice.* Its folds are held out alone and by twos: 15 sets to train on. Each is reduced
to three diagonals for every order and shape of prior, 2/3 n^3 products for n unknowns (36 times
the order): 67 thousand million of them up to order 40, three quarters of these for 40 and for 28.
The limit has them at the rate of this machine's matrix products. Half of each reduction does not
reach that: it reads what is left of the matrix once for every column, and of the highest orders
that is more than a core's cache holds. Searches that high orders do not pay for end at 12.

*Limit of residual tables.* One look at every pose for each fold and model: forming a Gram matrix.
"""

from __future__ import annotations

import csv
import functools
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import project
from harness import ROOT, Contender, Work

DATA = ROOT / "examples" / "data"
PAIRS = 15
SAME, TOLERANCE_MM = 1e-9, 1e-4
NOTES = {
    "order auto, high orders pay": (
        "2.5 to 2.7 times as fast, exact; three quarters of the time are reductions to three"
        " diagonals (LAPACK's dsytrd), at two fifths of the rate of matrix products. Tried and no"
        " faster: reduction to a band first by products alone, as what is left of the band costs"
        " what that saves; Cholesky factors of the highest order, whose leading blocks give lower"
        " ones, as every width of a prior needs some at each order's own residual variance. Orders"
        " are not pruned further than the search did: on the UR10 and the UR5 the highest ones are"
        " chosen or close to it"
    ),
    "residuals of five folds": (
        "about twice as fast: fits of fewer looks at the poses, the nominal arm placed once a fold."
        " What is left is one Gram matrix after another of each fold, three a VEC fit, and the"
        " variance of its residuals found by repeated inverses. Not tried: Gram matrices of single"
        " folds about the delivered models, added up for each share of them"
    ),
}


def works(smoke: bool) -> list[Work]:
    """Choices on two arms and the residual tables of a third."""
    rate = _products_per_s(64 if smoke else 512)
    limit = 1e9 * PAIRS * sum(2.0 / 3.0 * n**3 for n in _reduced()) / rate
    own = (Contender("kinacc", "this"),)
    return [
        Work("order auto, high orders pay", "choice", 1, own, _same_choices, {"today": 3.0},
             limit, f"reductions at {rate / 1e9:.0f} thousand million products a second",
             today=measured_arm),
        Work("order auto, search ends at 12", "choice", 1, own, _same_choices, {"today": 3.0},
             today=smooth_arm),
        Work("residuals of five folds", "table", 1, own, _same_residuals, {"today": 3.0},
             today=residuals),
    ]  # fmt: skip


def measured_arm(smoke: bool) -> Callable[[], object]:
    """The choice for 1,000 positions of a UR5, whose errors are wavy."""
    lines = [",".join([*(f"q{i}_deg" for i in range(1, 7)), "x_mm", "y_mm", "z_mm"])]
    with (DATA / "ur5_gts" / "published_grid.csv").open() as file:
        for row in list(csv.DictReader(file))[: 120 if smoke else None]:
            place = [float(row[f"{axis}_t"]) + float(row[f"{axis}_dif"]) for axis in "xyz"]
            lines.append(",".join([*(row[f"joint_{i}"] for i in range(1, 7)), *map(repr, place)]))
    return _choosing(lines, str(ROOT / "examples" / "ur5.robot.yaml"), 2 if smoke else 40)


def smooth_arm(smoke: bool) -> Callable[[], object]:
    """The choice for 1,000 positions of an arm with errors of a slow wave."""
    return _choosing(wavy("irb120", 100 if smoke else 1000), "irb120", 2 if smoke else 40)


def wavy(arm: str, poses: int) -> list[str]:
    """Lines of a file of positions of an arm that is off by a wave of its first joints."""
    from kinacc.kinematics import robot

    draw = np.random.default_rng(3)
    q = draw.uniform(-1.2, 1.2, (poses, 6))
    place = robot.forward(robot.load(arm), q).position_mm + draw.normal(0.0, 0.05, (poses, 3))
    rows = np.hstack([q, place + 0.3 * np.sin(2.0 * q[:, :3])])
    head = ",".join([*(f"q{i}_rad" for i in range(1, 7)), "x_mm", "y_mm", "z_mm"])
    return [head, *(",".join(f"{value:.9f}" for value in row) for row in rows)]


def settings_of(path: Path, robot: str, vec: str, orientation: str = "{kind: none}") -> Mapping:
    """Settings of a data set of this file, base and tool estimated."""
    from kinacc.workflow.contradictions import load

    own = path.with_suffix(".yaml")
    own.write_text(
        f"datasets:\n  own:\n    robot: {robot}\n    evaluation: {{space: measured}}\n"
        f"    measurements:\n      source: file\n"
        f"      file: {{path: {path}, orientation: {orientation}}}\n"
        f"    calibration:\n      base_and_tool: estimated\n      vec: {vec}\n"
        "      dh: {fit_to: measurements, hayati_joints: auto}\n"
    )
    return load([own])["own"]


def chooser(lines: Sequence[str], robot_name: str, highest: int) -> Callable[[], Mapping]:
    """What chooses order and prior for the poses of a file's lines: the table ``vec_orders``."""
    from kinacc.calibration import models
    from kinacc.kinematics import robot
    from kinacc.workflow import calibration_settings
    from kinacc.workflow.stages import measurements

    path = project.folder() / "own.csv"
    path.write_text("\n".join([*lines, ""]))
    vec = f"{{order: auto, prior: chosen, order_highest: {highest}}}"
    settings = settings_of(path, robot_name, vec)
    arm = robot.load(settings["robot"])
    every, _ = calibration_settings.observed(measurements.run({}, settings), arm)
    estimator = models.estimators(settings["calibration"], arm, every)["vec"]
    return lambda: estimator.choices(every)["vec_orders"]


def _choosing(lines: Sequence[str], robot_name: str, highest: int) -> Callable[[], object]:
    choose = chooser(lines, robot_name, highest)
    names = ("order", "prior_std_mm", "prior_decay", "chosen", "held_out_rms_mm")

    def run() -> list[np.ndarray]:
        table = choose()
        return [np.asarray(table[name], dtype=float) for name in names]

    return run


def residuals(smoke: bool) -> Callable[[], object]:
    """Residual tables of a UR10's 632 poses by models of order 10 and their five refits."""
    from kinacc.workflow.in_memory import RUNS

    path = project.folder() / "own.csv"
    lines = (DATA / "ur10_tmac" / "series_D.csv").read_text().splitlines()
    path.write_text("\n".join([*(lines[:100] if smoke else lines), ""]))
    order, turn = 1 if smoke else 10, "{kind: euler, convention: XYZ, unit: deg}"
    vec = f"{{order: {order}, prior_std_mm: 0.3, prior_std_mrad: 0.3, prior_decay: 0.7}}"
    settings, tables = settings_of(path, "ur10", vec, turn), {}
    for stage in ("measurements", "vec", "dh"):
        tables |= RUNS[stage](tables, settings)
    run = functools.partial(RUNS["residuals"], tables, settings)
    return lambda: np.asarray(run()["residuals"]["rms"])


def _same_choices(found: Sequence[object]) -> None:
    first, *others = found
    for other in others:
        for one, another in zip(first, other, strict=True):
            np.testing.assert_allclose(one, another, rtol=SAME)


def _same_residuals(found: Sequence[object]) -> None:
    for other in found[1:]:
        np.testing.assert_allclose(found[0], other, atol=TOLERANCE_MM)


def _reduced() -> list[int]:
    """Unknowns of every reduction of one set trained on: each order under each shape of prior."""
    from kinacc.calibration.selection import ORDERS, Grid, chosen_priors

    grid = Grid(ORDERS, chosen_priors(1e-3))
    return [36 * n for n in ORDERS for _ in {prior.decay for prior in grid.priors_of(n)}]


def _products_per_s(size: int) -> float:
    """Products a second, each with a sum, of this machine's matrix products, the best of three."""
    one = np.ones((size, size))
    taken = []
    for _ in range(3):
        begin = time.perf_counter()
        one @ one
        taken.append(time.perf_counter() - begin)
    return size**3 / min(taken)

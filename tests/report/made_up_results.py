"""Small tables of a calibration that was never fitted, as sections of a report read them."""

from __future__ import annotations

import numpy as np
from parsed import read

from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.kinematics.robot import Robot
from kinacc.tables.allowed import ERRORS

TRAVEL_RAD = np.pi / 2  # either way; of the sliding joint 100 mm
SLIDES = np.array([False, False, False, True])


def robot(slides: bool = False) -> Robot:
    """Four joints that turn, or three and one that slides."""
    lengths = np.array([300.0, 0.0, 0.0, 100.0]), np.array([0.0, 500.0, 400.0, 0.0])
    angles = np.array([np.pi / 2, 0.0, np.pi / 2, 0.0]), np.zeros(4)
    prismatic = SLIDES & slides
    limit = np.where(prismatic, 100.0, TRAVEL_RAD)
    model = DHModel(np.zeros(4), *lengths, *angles, prismatic)
    return Robot("made up", model, -limit, limit, np.eye(4), "nobody's catalogue")


def measurements(joints, repeats: int = 1, **columns) -> dict:
    """Readings of one target at joints (n, 4); ``columns`` replace or add some."""
    joints = np.repeat(np.atleast_2d(np.asarray(joints, dtype=float)), repeats, axis=0)
    count = len(joints)
    found = {
        "pose": np.arange(count) // repeats,
        **{f"q{n + 1}": joints[:, n] for n in range(4)},
        **{f"s{n + 1}": np.zeros(count, np.int8) for n in range(4)},
        "target": np.full(count, "tool", dtype=object),
        **{f"{axis}_mm": np.zeros(count) for axis in "xyz"},
        "qw": np.ones(count),
        **{f"q{axis}": np.zeros(count) for axis in "xyz"},
        "repeat": np.arange(count) % repeats,
        "subset": np.full(count, "train", dtype=object),
        "fold": np.zeros(count),
        "session": np.full(count, None, dtype=object),
        **{f"std_{axis}_mm": np.full(count, np.nan) for axis in "xyz"},
        "row": np.arange(count) + 2.0,
    }
    return found | columns


def check(*findings: tuple) -> dict:
    """A ``data_check`` of findings: kind, level, what, lines, fix, accepted, rows."""
    names = ("finding", "level", "what", "lines", "fix", "accepted", "rows")
    rows = list(zip(*findings, strict=True)) or [()] * len(names)
    return {name: np.array(row, dtype=object) for name, row in zip(names, rows, strict=True)}


def identified(**told: tuple) -> dict:
    """``dh_identified`` of every DH parameter; ``told``: status, std and statement of some.

    Names are written with two underscores for the point: j1__d_mm.
    """
    rows = []
    for name in robot().dh.names:
        plain = ("fixed", np.nan, "not fitted") if "beta" in name else ("identified", 0.1, None)
        rows.append((name, *told.pop(name.replace(".", "__"), plain)))
    rows += [(name.replace("__", "."), *each) for name, each in told.items()]
    names = ("parameter", "status", "std", "statement")
    found = dict(zip(names, zip(*rows, strict=True), strict=True))
    text = {name: np.array(found[name], dtype=object) for name in names}
    return text | {"std": np.array(found["std"], dtype=float)}


def covariance(names: list[str], matrix) -> dict:
    """``dh_covariance`` of a matrix; parameters of no variance have no correlation."""
    matrix = np.asarray(matrix, dtype=float)
    first, second = np.tril_indices(len(names))
    std = np.where(np.diag(matrix) > 0.0, np.sqrt(np.diag(matrix)), np.nan)
    called = np.array(names, dtype=object)
    return {
        "parameter": called[first],
        "other": called[second],
        "covariance": matrix[first, second],
        "correlation": (matrix / np.outer(std, std))[first, second],
    }


def dh_model(change=None, std=0.1) -> dict:
    """``dh_model``: nominal plus ``change`` by column (4,), all of one ``std``."""
    nominal, change = robot().dh, change or {}
    found = {"joint": np.arange(1, 5)}
    for name in PARAMETERS:
        found[name] = getattr(nominal, name) + np.asarray(change.get(name, 0.0))
        found[f"std_{name}"] = np.full(4, std)
    return found


def vec_model(order: int = 2, **coefficients: float) -> dict:
    """``vec_model`` over all travel; ``coefficients`` by name: j1__eps_z__2."""
    rows = []
    for joint in range(1, 5):
        for error in ERRORS:
            for n in range(order + 1):
                rows.append((joint, error, 0, n, coefficients.get(f"j{joint}__{error}__{n}", 0.0)))
    names = ("joint", "error", "direction", "order", "coefficient")
    found = {
        name: np.array(each) for name, each in zip(names, zip(*rows, strict=True), strict=True)
    }
    at = found["joint"] - 1
    found |= {name: getattr(robot().dh, name)[at] for name in PARAMETERS}
    span = {"q_min_rad": np.full(len(at), -TRAVEL_RAD), "q_max_rad": np.full(len(at), TRAVEL_RAD)}
    return found | span | {"std": np.full(len(at), np.nan), "error": found["error"].astype(object)}


def orders(*rows: tuple) -> dict:
    """``vec_orders`` of fold, order, log evidence, that less the best, and whether chosen."""
    fold, order, evidence, less, chosen = (np.array(each) for each in zip(*rows, strict=True))
    return {
        "fold": fold.astype(float),
        "order": order,
        "prior_std_mm": np.full(len(rows), 0.3),
        "prior_std_mrad": np.full(len(rows), 0.4),
        "prior_decay": np.full(len(rows), 0.7),
        "log_evidence": evidence.astype(float),
        "log_evidence_less": less.astype(float),
        "chosen": chosen,
    }


def selection(gain: float = 0.05, error: float = 0.01, selected: str = "vec") -> dict:
    """``model_selection`` of DH and VEC; all NaN where nothing was held out."""
    known = np.isfinite(gain)
    return {
        "model": np.array(["dh", "vec"], dtype=object),
        "selected": np.array([selected == "dh", selected == "vec"], dtype=int),
        "held_out_rms_mm": np.array([0.4, 0.3]) if known else np.full(2, np.nan),
        "mean_of_folds_mm": np.array([0.41, 0.31]) if known else np.full(2, np.nan),
        "gain_mm2": np.array([0.0 if known else np.nan, gain]),
        "gain_std_error_mm2": np.array([0.0 if known else np.nan, error]),
        "configurations": np.full(2, 40.0 if known else np.nan),
    }


def pose_errors(estimate: str = "cross_validated", rows: int = 2, **mean_mm: float) -> dict:
    """``pose_errors`` of some rows, each model off by its ``mean_mm`` along x."""
    sizes = {"nominal": 1.0, "dh": 0.4, "vec": 0.3} | mean_mm
    count = rows * len(sizes)
    return {
        "comparison": np.repeat([f"{model}_vs_measured" for model in sizes], rows).astype(object),
        "estimate": np.full(count, estimate, dtype=object),
        "row": np.tile(np.arange(rows), len(sizes)),
        "ex_mm": np.repeat(list(sizes.values()), rows),
        **{f"e{axis}_mm": np.zeros(count) for axis in "yz"},
        **{f"r{axis}_mrad": np.full(count, np.nan) for axis in "xyz"},
    }


def everything() -> dict:
    """All tables that the sections on a calibration read."""
    joints = TRAVEL_RAD * np.array([[-0.5, 0, 0, 0], [0.5, 0.1, -0.2, 0.3]])
    return {
        "measurements": measurements(joints),
        "data_check": check(),
        "dh_identified": identified(),
        "dh_covariance": covariance(["j1.a_mm", "j2.a_mm"], [[1.0, 0.5], [0.5, 1.0]]),
        "dh_model": dh_model(),
        "vec_model": vec_model(),
        "vec_orders": orders((np.nan, 2, np.nan, np.nan, 1)),
        "model_selection": selection(),
        "pose_errors": pose_errors(),
    }


def table(section, caption: str):
    """The one table of a section whose caption begins so."""
    (found,) = (each for each in read(section).tables if each.caption.startswith(caption))
    return found


def words(section) -> str:
    """All paragraphs of a section."""
    return "\n".join(read(section).paragraphs)

"""Sections of a data set's page on its fits: residuals, data, parameters, selection."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from kinacc.calibration import noise, summary
from kinacc.calibration.identifiability import (
    FIXED,
    IDENTIFIED,
    POORLY_DETERMINED,
    PRIOR,
    UNDETERMINED,
    listed,
    parameter_name,
    weak,
)
from kinacc.calibration.misfit import in_words, misfit, misfits
from kinacc.calibration.model_comparison import STANDARD_ERRORS
from kinacc.calibration.uncertainty import is_angle
from kinacc.config.error_models import MEASURED, NOMINAL, PLAINEST, Comparison, model_name
from kinacc.deployment.folder import uncertainty
from kinacc.figures import checked_data, joint_errors
from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.kinematics.robot import Robot
from kinacc.kinematics.vec import VECModel
from kinacc.measurements.row_names import RowNames
from kinacc.report import charts
from kinacc.report.page import Part, records
from kinacc.report.summarise import compliance
from kinacc.tables.allowed import ERRORS, FINDING_LEVELS, LEFT_OUT, SUBSETS
from kinacc.tables.columns import Columns

_WORST = 10
_MOST_POINTS = 12_000  # drawn one by one; of more rows every n-th is, and all of the largest
_CLOSE = 0.95  # |correlation| of two parameters that make up for each other
_STATUSES = {
    IDENTIFIED: "determined by the poses",
    PRIOR: "known beforehand (prior)",
    UNDETERMINED: "undetermined",
    FIXED: "fixed",
}
Tables = Mapping[str, Columns]


def residuals(tables: Tables, robot: Robot) -> Part:
    """Position errors of every row before and after calibration."""
    measurements, best = tables["measurements"], summary.selected(tables["model_selection"])
    errors = _position_errors(tables)
    held_out = bool((np.asarray(tables["pose_errors"]["estimate"]) == "cross_validated").any())
    large = float(errors[best].quantile(summary.LARGE_SHARE))
    worst = errors.sort_values(best, ascending=False, kind="stable")[:_WORST]
    step = -(-len(errors) // _MOST_POINTS)
    drawn = errors.loc[np.union1d(errors.index[::step], worst.index)].copy()
    names = _row_names(measurements)
    drawn.insert(0, "name", [names[row] for row in drawn.index])
    drawn.insert(0, "order", drawn.index)
    joints = []
    for n, slides in enumerate(robot.dh.prismatic, start=1):
        joints.append(f"J{n}, {'mm' if slides else 'deg'}")
        joint = np.asarray(measurements[f"q{n}"], dtype=float)[drawn.index]
        drawn[joints[-1]] = joint if slides else np.rad2deg(joint)
    for axis in "xyz":
        drawn[axis] = np.asarray(measurements[f"{axis}_mm"], dtype=float)[drawn.index]
    labels = {model: model_name(model) for model in errors}
    labels[best] += ", selected"
    values = {
        "count": len(errors),
        "held_out": held_out,
        "selected": model_name(best),
        "share": summary.LARGE_SHARE,
        "large_mm": large,
        "labels": labels,
        "sizes": [
            {"model": labels[model], "mean": size.mean(), "largest": size.max()}
            for model, size in errors.items()
        ],
        "worst": [{"name": names[row], **errors.loc[row].to_dict()} for row in worst.index],
    }
    shown = {model: labels[model] for model in (NOMINAL, best)}
    chart = charts.residuals(drawn, shown, joints, large)
    return Part("residuals", values, charts={"rows": chart})


def _position_errors(tables: Tables) -> pd.DataFrame:
    """Position errors in mm by row and model, at rows that every model was tried on."""
    table = tables["pose_errors"]
    estimate = np.asarray(table["estimate"])
    held_out = "cross_validated" if (estimate == "cross_validated").any() else "train"
    size = np.linalg.norm([table[f"e{axis}_mm"] for axis in "xyz"], axis=0)
    known = pd.DataFrame({"row": table["row"], "comparison": table["comparison"], "mm": size})
    known = known[estimate == held_out].pivot(index="row", columns="comparison", values="mm")
    models = (NOMINAL, *map(str, tables["model_selection"]["model"]))
    wanted = {Comparison(MEASURED, model).name: model for model in models}
    return known[list(wanted)].rename(columns=wanted).dropna()


def _row_names(measurements: Columns) -> list[str]:
    """Name of every row: its line in the file, else its pose."""
    names = RowNames.of_columns(measurements)
    targets = np.asarray(measurements["target"]).astype(str)
    several = len(set(targets)) > 1
    pairs = zip(measurements["row"], measurements["pose"], targets, strict=True)
    return [
        (names.one(int(line)) if line == line else f"pose {pose}")
        + (f", {target}" if several else "")
        for line, pose, target in pairs
    ]


def data(tables: Tables, robot: Robot) -> Part:
    """The measured file and the findings of its check."""
    measurements, check = tables["measurements"], tables.get("data_check")
    low, high = summary.covered(measurements, robot)
    joints = []
    for n, slides in enumerate(robot.dh.prismatic):
        scale = 1.0 if slides else 180.0 / np.pi
        ends = {"low": low[n], "high": high[n], "least": robot.q_min_rad[n],
                "most": robot.q_max_rad[n]}  # fmt: skip
        joint = {name: scale * float(value) for name, value in ends.items()}
        share = (joint["high"] - joint["low"]) / (joint["most"] - joint["least"])
        joints.append({"joint": n + 1, "unit": "mm" if slides else "deg", "share": share, **joint})
    findings = [each for each in records(check or {}) if each["finding"] != LEFT_OUT]
    std = np.array([measurements[f"std_{axis}_mm"] for axis in "xyz"], dtype=float)
    stated = std[:, np.isfinite(std).all(axis=0)]
    values = {
        "arm": robot,
        "measured": bool(np.isfinite(np.asarray(measurements["row"], dtype=float)).any()),
        "checked": check is not None,
        "findings": sorted(findings, key=lambda each: FINDING_LEVELS.index(each["level"])),
        "excluded": _excluded(tables),
        "selected": model_name(summary.selected(tables["model_selection"])),
        "left_out": summary.left_out(check),
        "readings": len(measurements["pose"]),
        "poses": len(np.unique(measurements["pose"])),
        "fitted": int(np.sum(np.asarray(measurements["subset"]) == SUBSETS[0])),
        "turned": int(np.isfinite(np.asarray(measurements["qw"], dtype=float)).sum()),
        "targets": pd.Series(measurements["target"]).astype(str).value_counts().to_dict(),
        "sessions": pd.Series(measurements["session"]).fillna("").value_counts().to_dict(),
        "noise": noise.of_measurements(measurements, robot),
        "stated": (stated.shape[1], np.median(stated, axis=1)) if stated.size else None,
        "joints": joints,
    }
    return Part("data", values, figures={"coverage": checked_data.coverage(joints)})


def _excluded(tables: Tables) -> list[dict]:
    """Rows that the configuration excludes, with the errors of a model not fitted to them."""
    table = tables.get("excluded_rows")
    if table is None:
        return []
    names = RowNames.of_columns({**table, "row": table["line"]})
    found = summary.excluded_errors(table, summary.selected(tables["model_selection"]))
    return [
        {"row": names.one(line), "reason": reason, "size": error_mm}
        for line, reason, error_mm in found
    ]


def identifiability(tables: Tables, robot: Robot) -> Part:
    """Parameters that the poses do not determine, and those known only together."""
    told = tables["dh_identified"]
    open_directions = listed(told)
    weak_directions = weak(open_directions)
    status = list(told["status"])
    pairs = pd.DataFrame(dict(tables["dh_covariance"]))
    pairs = pairs[pairs["parameter"] != pairs["other"]].dropna(subset="correlation")
    pairs = pairs.sort_values("correlation", key=abs, ascending=False, kind="stable")
    every = []
    for row in records(told):
        scale, unit = (1e3, "mrad") if is_angle(str(row["parameter"])) else (1.0, "mm")
        std = f"{scale * row['std']:.3g} {unit}" if np.isfinite(row["std"]) else None
        every.append(row | {"called": parameter_name(str(row["parameter"])), "known": std})
    values = {
        "parameters": len(status),
        "counts": {words: status.count(each) for each, words in _STATUSES.items()},
        "weak": weak_directions,
        "always": [text for text in open_directions if not text.endswith(POORLY_DETERMINED)],
        "spread_deg": summary.flange_spread_deg(tables["measurements"], robot)
        if weak_directions
        else None,
        "rank": _rank(tables.get("dh_fit")),
        "close": int((pairs["correlation"].abs() >= _CLOSE).sum()),
        "limit": _CLOSE,
        "pairs": [
            {
                "first": parameter_name(str(each["parameter"])),
                "second": parameter_name(str(each["other"])),
                "correlation": each["correlation"],
            }
            for each in pairs[:_WORST].to_dict("records")
        ],
        "every": every,
        "deviations": in_words([misfit(tables, robot, "dh")]),
    }
    return Part("identifiability", values)


def _rank(fit: Columns | None) -> dict | None:
    """Number of fitted directions, the limit, and singular values over the largest."""
    if fit is None:
        return None
    quantity, value = np.asarray(fit["quantity"]), np.asarray(fit["value"], dtype=float)
    share = value[quantity == "singular_value"]
    if not len(share):
        return None
    rank, threshold = (value[quantity == name][0] for name in ("rank", "rank_threshold"))
    if not rank:
        return None
    return {"rank": int(rank), "threshold": threshold, "share": share / share[0]}


def parameters(tables: Tables, robot: Robot) -> Part:
    """DH parameters against nominal, and what the VEC model adds to them."""
    model = VECModel.from_columns(tables["vec_model"], robot.dh.prismatic)
    joints, values, std = vec_errors(tables, model, robot)
    largest: list[dict] = [{"joint": f"joint {n + 1}"} for n in range(model.joints)]
    for joint, error in np.ndindex(values.shape[:2]):
        at = int(np.argmax(np.abs(values[joint, error])))
        spread = std[joint, error, at]
        sure = f" ± {spread:.3f}" if np.isfinite(spread) else ""
        largest[joint][ERRORS[error]] = f"{values[joint, error, at]:+.3f}{sure}"
    shown = {
        "fitted": int(np.sum(np.asarray(tables["measurements"]["subset"]) == SUBSETS[0])),
        "selected": model_name(summary.selected(tables["model_selection"])),
        "deviations": in_words(misfits(tables, robot)),
        "parameters": dh_parameters(tables["dh_model"], tables["dh_identified"], robot),
        "bending": list(compliance(tables.get("compliance_model"))),
        "order": model.order,
        "banded": bool(np.isfinite(std).any()),
        "errors": {name: "mm" if name.startswith("delta") else "mrad" for name in ERRORS},
        "largest": largest,
        "offsets": [each for each in records(tables["vec_model"]) if each["direction"]],
    }
    units = ["mm" if slides else "deg" for slides in robot.dh.prismatic]
    return Part(
        "parameters", shown, figures={"errors": joint_errors.draw(joints, values, std, units)}
    )


def dh_parameters(model: Columns, told: Columns, robot: Robot) -> list[dict]:
    """Every DH parameter: ``nominal`` and ``calibrated`` in deg or mm, changes in mrad or mm.

    The angle beta is left out of joints that have none.
    """
    status = dict(zip(told["parameter"], told["status"], strict=True))
    fitted = DHModel.from_columns(model, robot.dh.prismatic)
    order = np.argsort(model["joint"], kind="stable")
    found = []
    for joint, column in np.ndindex(fitted.joints, len(PARAMETERS)):
        parameter = PARAMETERS[column]
        name = f"j{joint + 1}.{parameter}"
        known = str(status.get(name, FIXED))
        values = [float(getattr(of, parameter)[joint]) for of in (robot.dh, fitted)]
        if parameter == "beta_rad" and known == FIXED and not any(values):
            continue
        angle = is_angle(name)
        scale = 1e3 if angle else 1.0
        nominal, calibrated = np.rad2deg(values) if angle else values
        found.append(
            {
                "called": parameter_name(name),
                "status": known,
                "nominal": nominal,
                "calibrated": calibrated,
                "of": "deg" if angle else "mm",
                "difference": scale * (values[1] - values[0]),
                "std": scale * float(np.asarray(model[f"std_{parameter}"])[order][joint]),
                "unit": "mrad" if angle else "mm",
            }
        )
    return found


def vec_errors(
    tables: Tables, model: VECModel, robot: Robot, count: int = 121
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors of every joint that no DH table and no neighbouring joint can take over.

    Returns
    -------
    Positions (k, count) in deg or mm, errors (k, 6, count) in mm and mrad, and their standard
    deviations, NaN where the covariance is unknown.
    """
    at = np.linspace(-1.0, 1.0, count)
    low, high = model.domain
    joints = 0.5 * (low + high)[:, None] + 0.5 * (high - low)[:, None] * at
    prismatic = np.asarray(robot.dh.prismatic)
    basis = np.polynomial.chebyshev.chebvander(at, model.order)
    known = uncertainty(tables, "vec")
    place = {} if known is None else {name: i for i, name in enumerate(known.names)}
    values = np.empty((model.joints, len(ERRORS), count))
    std = np.full(values.shape, np.nan)
    for joint, error in np.ndindex(values.shape[:2]):
        scale = 1.0 if ERRORS[error].startswith("delta") else 1e3
        shared = _shared(ERRORS[error], joints[joint], bool(prismatic[joint]))
        own = scale * (basis - shared @ np.linalg.lstsq(shared, basis, rcond=None)[0])
        values[joint, error] = own @ model.coefficients[joint, error]
        names = [f"j{joint + 1}.{ERRORS[error]}.{n}" for n in range(basis.shape[1])]
        if known is not None and all(name in place for name in names):
            mine = [place[name] for name in names]
            variance = np.einsum("mi,ij,mj->m", own, known.covariance[np.ix_(mine, mine)], own)
            std[joint, error] = np.sqrt(np.maximum(variance, 0.0))
    return np.where(prismatic[:, None], joints, np.rad2deg(joints)), values, std


def _shared(error: str, joint: np.ndarray, slides: bool) -> np.ndarray:
    """Functions (m, f) of a joint (m,) that neighbouring frames can take over from its error.

    A constant change of the frame before the joint is a constant error; one of the frame behind it
    is, seen from before, constant along and about the axis and turns with the joint across it.
    """
    constant = np.ones_like(joint)
    if error.endswith("z") or (slides and error.startswith("eps")):
        return constant[:, None]
    turning = (joint,) if slides else (np.cos(joint), np.sin(joint))
    return np.stack([constant, *turning], axis=1)


def selection(tables: Tables, why: str) -> Part:
    """``model_selection`` and ``vec_orders``; ``why`` one model is selected."""
    choice = tables["model_selection"]
    orders = pd.DataFrame(dict(tables.get("vec_orders", {})))
    chosen, tried = orders, orders
    if len(orders):
        chosen = orders[orders["chosen"] == 1]
        tried = orders[orders["fold"].isna() & orders["log_evidence"].notna()]
        tried = tried.sort_values("order", kind="stable")
    models = []
    for each in records(choice):
        order = tables.get(f"{each['model']}_model", {}).get("order")
        plain = each["model"] == PLAINEST or not np.isfinite(each["gain_mm2"])
        gain = np.nan if plain else each["gain_mm2"]
        error = np.nan if plain else each["gain_std_error_mm2"]
        row = {
            "name": model_name(str(each["model"])),
            "order": None if order is None else int(np.max(order)),
            "gain": gain,
            "error": error,
            "times": gain / error if error > 0.0 else np.nan,
        }
        models.append(each | row | ({"remark": "selected"} if each["selected"] else {}))
    values = {
        "configurations": np.nanmax(np.asarray(choice["configurations"], float), initial=0.0),
        "why": why,
        "standard_errors": STANDARD_ERRORS,
        "plainest": model_name(PLAINEST),
        "models": models,
        "stated": not len(orders) or not chosen["log_evidence"].notna().any(),
        "tried": [
            each | ({"remark": "← chosen"} if each["chosen"] else {})
            for each in tried.to_dict("records")
        ],
        "chosen": chosen.to_dict("records"),
    }
    return Part("selection", values)

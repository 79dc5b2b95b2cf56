"""Sections of a data set's page on its fits: residuals, data, parameters, selection."""

from __future__ import annotations

import numpy as np
import pandas as pd

from kinacc.calibration import noise
from kinacc.calibration import summary as figures
from kinacc.calibration.identifiability import (
    FIXED,
    IDENTIFIED,
    PRIOR,
    UNDETERMINED,
    parameter_name,
)
from kinacc.calibration.misfit import in_words, misfit, misfits
from kinacc.calibration.residuals import STANDARD_ERRORS
from kinacc.calibration.uncertainty import scale_of, scaled_unit, unit_of
from kinacc.config.error_models import MEASURED, NOMINAL, PLAINEST, Comparison, model_name
from kinacc.deployment.folder import uncertainty
from kinacc.figures.calibration import draw_joint_errors
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.robot import Robot
from kinacc.kinematics.vec import VECModel
from kinacc.measurements.row_names import RowNames
from kinacc.report import charts, terminal
from kinacc.report.page import Part
from kinacc.report.summary import CalibrationSummary
from kinacc.tables.allowed import ERRORS
from kinacc.tables.columns import Columns, Tables

_WORST = 10
_MOST_POINTS = 12_000  # drawn one by one; of more rows every n-th is, and all of the largest
_PLACES = 121  # of a joint, at which errors are drawn
_CLOSE = 0.95  # |correlation| of two parameters that make up for each other
_STATUSES = {
    IDENTIFIED: "determined by the poses",
    PRIOR: "known beforehand (prior)",
    UNDETERMINED: "undetermined",
    FIXED: "fixed",
}


def residuals(tables: Tables, summary: CalibrationSummary) -> Part:
    """Position errors of every row before and after calibration."""
    best = summary.selected
    errors = _position_errors(tables, "cross_validated" if summary.is_held_out else "train")
    large_mm = summary.best.quantile_99
    labels = {model: model_name(model) for model in errors}
    labels[best] += ", selected"
    names = RowNames.of_columns(tables["measurements"])
    measured = pd.DataFrame(tables["measurements"])
    measured = measured.rename(columns={f"{axis}_mm": axis for axis in "xyz"})
    measured["name"] = [
        f"pose {pose}" if np.isnan(line) else names.one(int(line))
        for line, pose in zip(measured["row"].astype(float), measured["pose"], strict=True)
    ]
    if summary.targets > 1:
        measured["name"] += ", " + measured["target"].astype(str)
    joints = [f"J{n}, {unit}" for n, unit in enumerate(summary.joint_ranges["unit"], start=1)]
    for n, name in enumerate(joints, start=1):
        scale = 180.0 / np.pi if name.endswith("deg") else 1.0
        measured[name] = scale * measured[f"q{n}"].astype(float)
    rows = errors.join(measured[["name", *joints, *"xyz"]]).assign(order=errors.index)
    worst = rows.sort_values(best, ascending=False, kind="stable")[:_WORST]
    drawn = rows.loc[np.union1d(rows.index[:: -(-len(rows) // _MOST_POINTS)], worst.index)]
    shown = {model: labels[model] for model in (NOMINAL, best)}
    values = {
        "s": summary,
        "share": figures.LARGE_SHARE,
        "large_mm": large_mm,
        "labels": labels,
        "sizes": summary.position_errors.assign(model=labels),
        "worst": worst,
    }
    return Part(
        "residuals", values, charts={"rows": charts.residuals(drawn, shown, joints, large_mm)}
    )


def _position_errors(tables: Tables, estimate: str) -> pd.DataFrame:
    """Position errors in mm by row and model, at rows that every model was tried on."""
    table = pd.DataFrame(tables["pose_errors"])
    table["mm"] = np.linalg.norm(table[["ex_mm", "ey_mm", "ez_mm"]], axis=1)
    table = table[table["estimate"] == estimate]
    table = table.pivot(index="row", columns="comparison", values="mm")
    models = (NOMINAL, *map(str, tables["model_selection"]["model"]))
    names = {Comparison(MEASURED, model).name: model for model in models}
    return table[list(names)].rename(columns=names).dropna()


def data(tables: Tables, robot: Robot, summary: CalibrationSummary) -> Part:
    """The measured file and the findings of its check."""
    measurements = pd.DataFrame(tables["measurements"])
    std = measurements[[f"std_{axis}_mm" for axis in "xyz"]].astype(float).dropna()
    values = {
        "s": summary,
        "source": robot.source,
        "turned": int(measurements["qw"].notna().sum()),
        "targets": measurements["target"].astype(str).value_counts().to_dict(),
        "sessions": measurements["session"].fillna("").value_counts().to_dict(),
        "noise": noise.of_measurements(tables["measurements"], robot),
        "stated": (len(std), std.median().tolist()) if len(std) else None,
    }
    return Part("data", values)


def identifiability(tables: Tables, robot: Robot, summary: CalibrationSummary) -> Part:
    """Parameters that the poses do not determine, and those known only together."""
    table = pd.DataFrame(tables["dh_identified"])
    pairs = pd.DataFrame(tables["dh_covariance"])
    pairs = pairs[pairs["parameter"] != pairs["other"]].dropna(subset="correlation")
    pairs = pairs.sort_values("correlation", key=abs, ascending=False, kind="stable")
    table["unit"] = table["parameter"].map(scaled_unit)
    table["std"] /= table["parameter"].map(scale_of)
    table["called"] = table["parameter"].map(parameter_name)
    table["statement"] = table["statement"].fillna("")
    for column in ("parameter", "other"):
        pairs[column] = pairs[column].map(parameter_name)
    counts = table["status"].map(_STATUSES).value_counts()
    rank, known = None, pd.DataFrame(tables["dh_fit"]).set_index("quantity")["value"].astype(float)
    if "singular_value" in known and known["rank"]:
        share = known.loc[["singular_value"]].to_numpy()
        limit = known["rank_threshold"]
        rank = {"rank": int(known["rank"]), "threshold": limit, "share": share / share[0]}
    values = {
        "s": summary,
        "counts": counts.reindex(_STATUSES.values(), fill_value=0).to_dict(),
        "rank": rank,
        "close": int((pairs["correlation"].abs() >= _CLOSE).sum()),
        "limit": _CLOSE,
        "pairs": pairs[:_WORST],
        "every": table,
        "deviations": in_words([misfit(tables, robot, "dh")]),
    }
    return Part("identifiability", values)


def parameters(tables: Tables, robot: Robot, summary: CalibrationSummary) -> Part:
    """DH parameters against nominal, and what the VEC model adds to them."""
    model = VECModel.from_columns(tables["vec_model"], robot.dh)
    joints, errors, std = vec_errors(tables, model, robot)
    offsets = pd.DataFrame(tables["vec_model"])
    values = {
        "s": summary,
        "deviations": in_words(misfits(tables, robot)),
        "parameters": dh_parameters(tables["dh_model"], tables["dh_identified"], robot),
        "order": model.order,
        "banded": bool(np.isfinite(std).any()),
        "offsets": offsets[offsets["direction"] != 0],
    }
    figure = draw_joint_errors(joints, errors, std, [*summary.joint_ranges["unit"]])
    return Part("parameters", values, figures={"errors": figure})


def dh_parameters(model: Columns, identified: Columns, robot: Robot) -> pd.DataFrame:
    """Every DH parameter: ``nominal`` and ``calibrated`` in deg or mm, changes in mrad or mm.

    The angle beta is left out of joints that have none.
    """
    fitted = DHModel.from_columns(model, robot.dh)
    table = pd.DataFrame({"parameter": fitted.names, "nominal": robot.dh.start})
    table["calibrated"] = fitted.start
    known = pd.DataFrame(identified, columns=["parameter", "status", "std"])
    table = table.merge(known, "left")
    table["status"] = table["status"].fillna(FIXED)
    table["called"] = table["parameter"].map(parameter_name)
    is_zero = (table[["nominal", "calibrated"]] == 0.0).all(axis=1)
    unused = table["parameter"].str.endswith("beta_rad") & (table["status"] == FIXED) & is_zero
    angle = table["parameter"].map(unit_of) == "rad"
    scale = np.where(angle, 1e3, 1.0)
    table["difference"] = (table["calibrated"] - table["nominal"]) * scale
    table["std"] *= scale
    table.loc[angle, ["nominal", "calibrated"]] *= 180.0 / np.pi
    table["of"], table["unit"] = np.where(angle, "deg", "mm"), np.where(angle, "mrad", "mm")
    return table[~unused]


def vec_errors(
    tables: Tables, model: VECModel, robot: Robot
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors of every joint that no DH table and no neighbouring joint can take over.

    Returns
    -------
    Positions (k, m) in deg or mm, errors (k, 6, m) in mm and mrad, and their standard
    deviations, NaN where the covariance is unknown.
    """
    joints = np.linspace(*model.domain, _PLACES, axis=1)
    prismatic = robot.dh.prismatic
    basis = np.polynomial.chebyshev.chebvander(np.linspace(-1.0, 1.0, _PLACES), model.order)
    known, covariance = uncertainty(tables, "vec"), pd.DataFrame()
    if known is not None:
        covariance = pd.DataFrame(known.covariance, index=known.names, columns=known.names)
    values = np.empty((model.joints, len(ERRORS), _PLACES))
    std = np.empty(values.shape)
    for joint, error in np.ndindex(values.shape[:2]):
        scale = 1.0 if ERRORS[error].startswith("delta") else 1e3
        shared = _shared(ERRORS[error], joints[joint], bool(prismatic[joint]))
        rest = scale * (basis - shared @ np.linalg.lstsq(shared, basis, rcond=None)[0])
        values[joint, error] = rest @ model.coefficients[joint, error]
        names = [f"j{joint + 1}.{ERRORS[error]}.{n}" for n in range(basis.shape[1])]
        part = covariance.reindex(index=names, columns=names).to_numpy(float)
        variance = np.einsum("mi,ij,mj->m", rest, part, rest)
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


def selection(tables: Tables, summary: CalibrationSummary) -> Part:
    """``model_selection`` and ``vec_orders``."""
    models = pd.DataFrame(tables["model_selection"])
    gains = ["gain_mm2", "gain_std_error_mm2"]
    models.loc[models["model"] == PLAINEST, gains] = np.nan
    models["times"] = models["gain_mm2"] / models["gain_std_error_mm2"].replace(0.0, np.nan)
    models["order"] = summary.selection["order"].astype(float)
    models["name"] = models["model"].map(model_name)
    models["remark"] = np.where(models["selected"] == 1, "selected", "")
    columns = ("fold", "order", "log_evidence", "chosen", "prior_std_mm")
    tried = pd.DataFrame(tables.get("vec_orders", dict.fromkeys(columns, ())))
    tried["remark"] = np.where(tried["chosen"] == 1, "← chosen", "")
    compared = tried[tried["fold"].isna() & tried["log_evidence"].notna()]
    values = {
        "configurations": models["configurations"].fillna(0.0).max(),
        "why": terminal.selection(summary),
        "standard_errors": STANDARD_ERRORS,
        "plainest": model_name(PLAINEST),
        "models": models,
        "tried": compared.sort_values("order", kind="stable"),
        "chosen": tried[tried["chosen"] == 1].drop(columns="remark"),
    }
    return Part("selection", values)

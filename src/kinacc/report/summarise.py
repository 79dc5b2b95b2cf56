"""Summaries of calibrations from the tables of results folders, and the stage ``summary``."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from kinacc.calibration import identifiability, misfit
from kinacc.calibration import summary as figures
from kinacc.calibration.summary import Tolerance
from kinacc.campaign import of_calibration
from kinacc.campaign.beside_results import PLAN, of_results
from kinacc.config.error_models import ERROR_MODELS, MEASURED, PLAINEST, Comparison
from kinacc.config.records import Settings
from kinacc.deployment import applicability
from kinacc.deployment import folder as results
from kinacc.errors import InputError, Problem, input_error, refuse
from kinacc.kinematics.robot import Robot
from kinacc.measurements.folds import configurations_of
from kinacc.measurements.row_names import RowNames
from kinacc.report.rendering import history_sentence
from kinacc.report.summary import CalibrationSummary
from kinacc.tables import sums
from kinacc.tables.allowed import FINDING_LEVELS, LEFT_OUT, SUBSETS, VERDICTS
from kinacc.tables.columns import Columns, Tables
from kinacc.tables.contract import columns_of

OPTIONAL = (
    *(f"{kind}_model" for kind in ERROR_MODELS),
    *("summary", "data_check", "excluded_rows", "vec_orders", "claims", "history"),
)
# Tables that the page needs, and those that it shows where they are there.
PAGE_TABLES = (*figures.TABLES, "dh_model", "vec_model", "residuals", "worst_rows", "summary")
_STUDIED = (
    *("accuracy_map", "assessment_points", "study", "study_summary", "readings", "histories"),
    "claims",
)
ON_PAGE = (
    *OPTIONAL,
    *(f"{kind}_{part}" for kind in ERROR_MODELS for part in ("fit", "covariance")),
    *_STUDIED,
)
_ESTIMATES = {"cross_validated": "held_out", "train": "training"}
_STATISTICS = ("n", "mean", "quantile_99", "largest")
_DAY_OF_A_LINE = re.compile(r"-(\d{4}-\d{2}-\d{2})$")


def summarise(
    folder: Path | str,
    tables: Tables | None = None,
    campaigns: Sequence[Path] | None = None,
    outdated: str = "",
) -> CalibrationSummary:
    """What the calibration in a results folder is worth.

    Parameters
    ----------
    folder
        Results folder of a data set.
    tables
        Its tables; where they are not given, those in ``folder`` but for the ones of a study or a
        history that were made from other tables than those now there.
    campaigns
        Folders of campaigns on it, sought where they are not given.
    outdated
        Why its tables are outdated, stated in the summary.

    Raises
    ------
    InputError
        Where a table is missing or damaged.
    """
    folder = Path(folder)
    if tables is None:
        old = made_of_others(folder) - {"summary", "data_check"}
        optional = [name for name in OPTIONAL if name not in old]
        tables = results.read_tables(folder, needed=figures.TABLES, optional=optional)
    arm, selected = results.robot_of(tables), figures.selected(tables["model_selection"])
    name, made = folder.resolve().name, folder / "model_selection.parquet"
    written = ""
    if made.is_file():
        written = datetime.fromtimestamp(made.stat().st_mtime, UTC).date().isoformat()
    places = of_results(folder) if campaigns is None else campaigns
    campaign, remarks = of_calibration.newest(name, selected, tables, places)
    measurements, noted = tables["measurements"], findings(tables.get("data_check"))
    is_unused = noted["finding"] == LEFT_OUT
    fits = misfit.misfits(tables, arm)
    listed = identifiability.listed(tables["dh_identified"])
    always = (text for text in listed if not text.endswith(identifiability.POORLY_DETERMINED))
    configuration = configurations_of(measurements)
    errors = figures.error_statistics(tables["pose_errors"], configuration)
    errors = errors.drop(columns="comparison")
    errors["estimate"] = errors["estimate"].map(_ESTIMATES)
    turned = (errors["quantity"] == "orientation") & (errors["reference"] == MEASURED)
    rows = np.asarray(measurements.get("row", [np.nan]), dtype=float)
    synthetic = not np.isfinite(rows).any()
    stated_mm = [measurements[f"std_{axis}_mm"] for axis in "xyz"]
    return CalibrationSummary(
        name=name,
        folder=str(folder),
        written=written,
        measured=_measured(name, tables.get("history")),
        robot=arm.name,
        synthetic=synthetic,
        readings=len(measurements["pose"]),
        poses=len(np.unique(measurements["pose"])),
        targets=len(np.unique(np.asarray(measurements["target"]).astype(str))),
        fitted=int(np.sum(np.asarray(measurements["subset"]) == SUBSETS[0])),
        frames_fitted=figures.frames_are_fitted(tables["frames"]),
        full_pose=bool(turned.any()),
        selected=selected,
        errors=errors,
        selection=_selection(tables),
        joint_ranges=joint_ranges(measurements, arm),
        share_measured=_fact(tables, "like_measured"),
        flange_spread_deg=figures.flange_spread_deg(measurements, arm),
        unidentifiable=tuple(always),
        poorly_determined=tuple(identifiability.weak(listed)),
        checked="data_check" in tables,
        findings=noted[~is_unused],
        left_out=tuple(noted["text"][is_unused]),
        excluded=excluded(tables),
        compliance=compliance(tables.get("compliance_model")),
        noise_mm=fits[0].noise.per_axis_mm,
        stated_noise_mm=float(np.sqrt(np.mean(np.square(stated_mm)))),
        held_out_over_noise={fit.model: fit.ratio for fit in fits},
        campaign=campaign,
        remarks=remarks,
        tolerance=tolerance_of(tables),
        claims=_claims(tables["claims"]) if synthetic and "claims" in tables else None,
        history=history_sentence(pd.DataFrame(tables["history"])) if "history" in tables else "",
        outdated=outdated,
        next_steps=_next_steps(str(folder), selected, campaign),
    )


def made_of_others(folder: Path) -> set[str]:
    """Tables made from others than those now there; of the tables of a study all or none."""
    old = {Path(name).stem for name in sums.outdated(folder)}
    studied = {name for name in _STUDIED if (folder / f"{name}.parquet").is_file()}
    return old if old.isdisjoint(studied) else old | studied


def data_set_folders(folders: Iterable[Path]) -> list[Path]:
    """Results folders of data sets among the ``folders`` and inside them, by name.

    Parameters
    ----------
    folders
        Results folders, or folders of these.

    Returns
    -------
    list of Path
        Each data set once.

    Raises
    ------
    InputError
        With each folder that holds none.
    """
    places: list[Path] = []
    problems = []
    for folder in folders:
        inside = (
            [folder]
            if any(folder.glob("*.parquet"))
            else sorted(filter(Path.is_dir, folder.glob("[!.]*")))
        )
        with_results = [path for path in inside if not (path / PLAN).is_file()]
        places += with_results
        if not with_results:
            fix = "calibrate a data set: kinacc calibrate FILE.yaml"
            problems.append(Problem(str(folder), "holds no results", "results of data sets", fix))
    refuse(problems)
    return list(dict.fromkeys(places))


def summarise_all(
    folders: Sequence[Path], outdated: str = ""
) -> list[CalibrationSummary | Problem]:
    """The summary of every results folder, or why it has none.

    Parameters
    ----------
    folders
        Results folders of data sets.
    outdated
        Why their tables are outdated, see ``summarise``.

    Returns
    -------
    list of CalibrationSummary or Problem
        In the order of the folders.
    """
    summaries: list[CalibrationSummary | Problem] = []
    for folder in folders:
        path = folder / "summary.parquet"
        try:
            if path.is_file() and path.name in sums.outdated(folder):
                what = "was made from other tables than those now beside it"
                raise input_error(str(path), what, fix=sums.remake(path))
            summaries.append(summarise(folder, outdated=outdated))
        except InputError as error:
            text = str(error.problems[0]).removeprefix(f"{folder}: ")
            summaries.append(Problem(str(folder), text))
    return summaries


def run(inputs: Tables, settings: Settings) -> Tables:
    """The stage ``summary``: figures of a calibration, one a row."""
    arm = results.robot_of(inputs)
    calibration = results.calibration(inputs)
    share = applicability.share_of_box(calibration, *figures.covered(inputs["measurements"], arm))
    known = summarise(Path("results"), inputs, campaigns=())
    rows = [
        *(
            ("data", "measurements", name, float(getattr(known, name)), "1")
            for name in ("readings", "poses", "targets", "fitted", "synthetic")
        ),
        *_error_rows(known.errors),
        ("like_measured", "ranges of all joints", "share", share, "1"),
    ]
    section = settings.get("tolerance")
    if section and section["mm"] is not None:
        rows.append(("tolerance", section["of"], "allowed", float(section["mm"]), "mm"))
    return {"summary": columns_of("summary", rows)}


def _error_rows(errors: pd.DataFrame) -> Iterable[tuple[Any, ...]]:
    """Errors by model, and differences of models; orientations where they are held out."""
    for row in errors.to_dict("records"):
        topic, item = f"{row['estimate']}_error", row["model"]
        if row["reference"] != MEASURED:
            topic = f"{'held_out_' * (row['estimate'] == 'held_out')}model_difference"
            item += f"_vs_{row['reference']}"
        if row["quantity"] == "orientation":
            if topic != "held_out_error":
                continue
            topic = "held_out_orientation_error"
        for name in _STATISTICS:
            yield topic, item, name, float(row[name]), "1" if name == "n" else row["unit"]


def _selection(tables: Tables) -> pd.DataFrame:
    names = ["model", "selected", "held_out_rms_mm", "gain_mm2", "gain_std_error_mm2"]
    choice = pd.DataFrame(tables["model_selection"])[names].astype({"selected": bool})
    rows = choice.to_dict("records")
    for row in rows:
        order = tables.get(f"{row['model']}_model", {}).get("order")
        tried = np.unique(tables.get(f"{row['model']}_orders", {}).get("order", ()))
        row["order"] = None if order is None else int(np.max(order))
        row["highest_order_tried"] = int(tried[-1]) if len(tried) > 1 else None
    return pd.DataFrame(rows, dtype=object)


def joint_ranges(measurements: Columns, arm: Robot) -> pd.DataFrame:
    """Measured range and limits of every joint, deg or mm, and the share of its travel."""
    slides = np.asarray(arm.dh.prismatic)
    scale = np.where(slides, 1.0, 180.0 / np.pi)
    low, high = figures.covered(measurements, arm)
    ends = {"low": low, "high": high, "least": arm.q_min_rad, "most": arm.q_max_rad}
    table = pd.DataFrame({"joint": np.arange(1, len(low) + 1)} | ends)
    table[[*ends]] *= scale[:, None]
    table["unit"] = np.where(slides, "mm", "deg")
    table["share"] = (high - low) / (arm.q_max_rad - arm.q_min_rad)
    return table


def findings(check: Columns | None) -> pd.DataFrame:
    """Findings of the data check, the gravest first, and parts of the file that are not used."""
    names = ["finding", "level", "rows", "what", "lines", "fix", "accepted"]
    table = pd.DataFrame(check or {}, columns=names).rename(columns={"what": "text"}).fillna("")
    table["is_open"] = (table["level"] != FINDING_LEVELS[-1]) & (table["accepted"] == "")
    return table.sort_values(
        "level", key=lambda levels: levels.map(FINDING_LEVELS.index), kind="stable"
    )


def excluded(tables: Tables) -> pd.DataFrame:
    """Rows that the configuration excludes, with errors of a model that was not fitted to them."""
    names = ["line", "where", "reason", "error_mm"]
    if (columns := tables.get("excluded_rows")) is None:
        return pd.DataFrame(columns=names)
    rows, table = RowNames.of_columns({**columns, "row": columns["line"]}), pd.DataFrame(columns)
    selected = Comparison(MEASURED, figures.selected(tables["model_selection"])).name
    table = table[table["comparison"] == selected].sort_values("line", kind="stable")
    error_mm = np.linalg.norm(table[["ex_mm", "ey_mm", "ez_mm"]], axis=1)
    return table.assign(where=table["line"].map(rows.one), error_mm=error_mm)[names]


def compliance(model: Columns | None) -> pd.DataFrame:
    """Joints that bend, of a table ``compliance_model``: coefficients and standard deviations."""
    values = ["compliance_rad_per_nm", "lever_coefficient_rad_per_mm"]
    columns = ["joint", *values, *(f"std_{name}" for name in values)]
    return pd.DataFrame(model or {}, columns=columns).dropna(how="all", subset=columns[1:])


def _fact(tables: Tables, topic: str, column: str = "value") -> Any:
    """What the table ``summary`` states on a topic, None where nothing."""
    known = pd.DataFrame(tables.get("summary", {"topic": ()}))
    rows = known[known["topic"] == topic]
    return rows[column].iloc[0] if len(rows) else None


def tolerance_of(tables: Tables) -> Tolerance | None:
    """The tolerance that the table ``summary`` states.

    Parameters
    ----------
    tables
        Tables of a results folder by name.

    Returns
    -------
    Tolerance or None
        In mm, with the statistic it is about; None without one.
    """
    mm = _fact(tables, "tolerance")
    return None if mm is None else Tolerance(float(mm), str(_fact(tables, "tolerance", "item")))


def _claims(claims: Columns) -> dict[str, Any]:
    table = pd.DataFrame(claims)
    table = table[~table["used_to_choose"].astype(bool)]  # these chose a reading: no evidence
    counts = table["verdict"].value_counts().reindex(VERDICTS, fill_value=0)
    agree, differ, open_ = counts.tolist()
    differing = tuple(table["claim"][table["verdict"] == VERDICTS[1]])
    return {"agree": agree, "differ": differ, "not_comparable": open_, "differing": differing}


def _measured(name: str, history: Columns | None) -> str:
    """Day of a line of a series, or of the newest line; empty without a series."""
    if history is not None:
        return str(max(history["date"]))
    day = _DAY_OF_A_LINE.search(name)
    return day[1] if day else ""


def _next_steps(folder: str, model: str, campaign: Any) -> dict[str, str]:
    place = shlex.quote(folder)
    option = "" if model == PLAINEST else f" --model {model}"
    start = f"kinacc campaign start check --calibration {place} --noise-mm NOISE --budget 300"
    bound = "bound the largest error; NOISE is the standard deviation of a reading in mm"
    first = {bound: start}
    if campaign is not None:
        first = {"the campaign": campaign.next_command}
    return first | {
        "a robot program, corrected": f"kinacc compensate {place} --program PROGRAM -o CORRECTED",
        "files of the model for simulators": f"kinacc export {place}{option} --out exported",
        "values to enter into the controller: kuka, abb, fanuc, ur, yaskawa, staubli or ros": (
            f"kinacc export {place} --for CONTROLLER --out pendant"
        ),
    }

"""Summaries of calibrations from the tables of results folders, and the stage ``summary``."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pandas as pd

from kinacc.calibration import identifiability, misfit
from kinacc.calibration import summary as figures
from kinacc.calibration.summary import Tolerance
from kinacc.campaign import journal, of_calibration
from kinacc.campaign.of_calibration import Sought
from kinacc.config.error_models import ERROR_MODELS, MEASURED, PLAINEST
from kinacc.deployment import applicability
from kinacc.deployment import folder as results
from kinacc.errors import InputError, Problem, refuse
from kinacc.kinematics import robot
from kinacc.kinematics.robot import Robot
from kinacc.measurements.row_names import RowNames
from kinacc.report.history_lines import sentence
from kinacc.report.summary import (
    CalibrationSummary,
    Claims,
    ExcludedRow,
    Finding,
    JointCompliance,
    JointRange,
    ModelErrors,
    NextStep,
    Selection,
)
from kinacc.tables import store, sums
from kinacc.tables.allowed import FINDING_LEVELS, LEFT_OUT, SUBSETS, VERDICTS
from kinacc.tables.columns import Columns
from kinacc.tables.contract import columns_of

HELD_OUT_TOPICS = {"cross_validated": "held_out", "train": "training"}
OPTIONAL = (
    *(f"{kind}_model" for kind in ERROR_MODELS),
    *("summary", "data_check", "excluded_rows", "vec_orders", "accuracy_map"),
    *("assessment_points", "claims", "history"),
)
# Tables that the page needs, and those that it shows where they are there.
PAGE_TABLES = (*figures.TABLES, "dh_model", "vec_model", "residuals", "worst_rows", "summary")
ON_PAGE = (
    *OPTIONAL,
    *(f"{kind}_{what}" for kind in ERROR_MODELS for what in ("fit", "covariance")),
    *("study", "study_summary", "readings", "histories"),
)
_NOTE = FINDING_LEVELS[-1]
Tables = Mapping[str, Columns]


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
        Its tables, read from ``folder`` where they are not given.
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
        tables = results.read_tables(folder, needed=figures.TABLES, optional=OPTIONAL)
    arm = robot.of_text(str(tables["robot"]["description"][0]), "robot.parquet")
    name = folder.resolve().name
    places = journal.of_results(folder) if campaigns is None else campaigns
    sought = of_calibration.sought(name, tables, places)
    measurements, best = tables["measurements"], figures.selected(tables["model_selection"])
    fits = misfit.misfits(tables, arm)
    listed = identifiability.listed(tables["dh_identified"])
    weak = identifiability.weak(listed)
    rows = np.asarray(measurements.get("row", [np.nan]), dtype=float)
    synthetic = not np.isfinite(rows).any()
    errors = tuple(_errors(tables["pose_errors"]))
    return CalibrationSummary(
        name=name,
        folder=str(folder),
        written=_written(folder),
        robot=arm.name,
        synthetic=synthetic,
        readings=len(measurements["pose"]),
        poses=len(np.unique(measurements["pose"])),
        targets=len(np.unique(np.asarray(measurements["target"]).astype(str))),
        fitted=int(np.sum(np.asarray(measurements["subset"]) == SUBSETS[0])),
        frames_fitted=figures.frames_are_fitted(tables["frames"]),
        full_pose=any(
            (each.quantity, each.reference) == ("orientation", MEASURED) for each in errors
        ),
        selected=best,
        errors=errors,
        selection=tuple(_selection(tables)),
        joint_ranges=tuple(_ranges(measurements, arm)),
        share_measured=_fact(tables, "like_measured"),
        flange_spread_deg=figures.flange_spread_deg(measurements, arm),
        unidentifiable=tuple(
            text for text in listed if not text.endswith(identifiability.POORLY_DETERMINED)
        ),
        poorly_determined=tuple(weak),
        checked="data_check" in tables,
        findings=tuple(_findings(tables.get("data_check"))),
        left_out=tuple(figures.left_out(tables.get("data_check"))),
        excluded=tuple(_excluded(tables.get("excluded_rows"), best)),
        compliance=tuple(compliance(tables.get("compliance_model"))),
        noise_mm=fits[0].noise.per_axis_mm,
        held_out_over_noise={each.model: each.ratio for each in fits},
        campaign=sought.status,
        remarks=sought.remarks,
        tolerance=tolerance_of(tables),
        claims=_claims(tables) if synthetic else None,
        other_errors=_other_errors(tables),
        history=sentence(tables["history"]) if "history" in tables else "",
        outdated=outdated,
        next_steps=tuple(_next_steps(folder, tables, arm, sought)),
    )


def data_set_folders(folders: Iterable[Path]) -> list[Path]:
    """Results folders of data sets among the ``folders`` and inside them, by name.

    Raises InputError for each folder that holds none.
    """
    found: dict[Path, None] = {}
    problems = []
    for folder in folders:
        if not folder.is_dir():
            what = "is not a folder" if folder.exists() else "no such folder"
            fix = "name the folder of all results, or of one data set"
            problems.append(Problem(str(folder), what, fix=fix))
            continue
        if (folder / journal.PLAN).is_file():
            status = shlex.join(["kinacc", "campaign", "status", str(folder)])
            fix = f"run {status}, or name its results folder"
            problems.append(Problem(str(folder), "is a campaign, not a results folder", fix=fix))
            continue
        inside = [folder] if any(folder.glob("*.parquet")) else sorted(folder.iterdir())
        own = [
            each
            for each in inside
            if each.is_dir() and each.name[0] != "." and not (each / journal.PLAN).is_file()
        ]
        found |= dict.fromkeys(own)
        if not own:
            fix = "calibrate one: kinacc calibrate FILE.yaml"
            problems.append(Problem(str(folder), "holds no results", "results of data sets", fix))
    refuse(problems)
    return list(found)


def summarise_all(folders: Sequence[Path]) -> list[CalibrationSummary | Problem]:
    """The summary of every results folder, or why it has none."""
    campaigns = journal.of_each(folders)
    found: list[CalibrationSummary | Problem] = []
    for folder in folders:
        try:
            path = folder / "summary.parquet"
            if path.is_file() and path.name in sums.outdated(folder):
                what = "was made from other tables than those now beside it"
                raise InputError(Problem(str(path), what, fix=store.remake(path)))
            found.append(summarise(folder, campaigns=campaigns[folder]))
        except InputError as error:
            found.append(error.problems[0])
    return found


def run(inputs: Tables, settings: Mapping) -> dict[str, Columns]:
    """The stage ``summary``: figures of a calibration, one a row."""
    arm = robot.of_text(str(inputs["robot"]["description"][0]), "robot.parquet")
    calibration = results.calibration(inputs, arm)
    share = applicability.share_of_box(calibration, *figures.covered(inputs["measurements"], arm))
    known = summarise(Path("results"), inputs, campaigns=())
    rows = [
        ("robot", known.robot, "name", np.nan, None, known.robot),
        ("robot", "base and tool", "fitted", float(known.frames_fitted), "1", None),
        *(
            ("data", "measurements", name, float(getattr(known, name)), "1", None)
            for name in ("readings", "poses", "targets", "fitted", "synthetic")
        ),
        *(
            (topic, str(number), "statement", np.nan, None, text)
            for topic in ("left_out", "unidentifiable", "poorly_determined")
            for number, text in enumerate(getattr(known, topic), 1)
        ),
        *(
            ("check", each.finding, each.level, float(each.rows), "1", each.text)
            for each in known.findings
        ),
        *(
            ("excluded_rows", each.where, "error", each.error_mm, "mm", each.reason)
            for each in known.excluded
        ),
        *(row for each in known.errors for row in _error_rows(each)),
        *(row for each in known.selection for row in _selection_rows(each)),
        *(
            ("range", f"joint {each.joint}", name, float(getattr(each, name)), unit, None)
            for each in known.joint_ranges
            for name, unit in (("low", each.unit), ("high", each.unit), ("share", "1"))
        ),
        ("like_measured", "ranges of all joints", "share", share, "1", None),
    ]
    if known.flange_spread_deg is not None:
        rows.append(("one_way", "flange", "farthest_off", known.flange_spread_deg, "deg", None))
    section = settings.get("tolerance")
    if section and section["mm"] is not None:
        rows.append(("tolerance", section["of"], "allowed", float(section["mm"]), "mm", None))
    return {"summary": columns_of("summary", rows)}


def _error_rows(each: ModelErrors) -> list[tuple]:
    quantity = "" if each.quantity == "position" else "orientation_"
    topic = f"{each.estimate}_{quantity}error"
    item = each.model
    if each.reference != MEASURED:
        topic = "held_out_model_difference" if each.estimate == "held_out" else "model_difference"
        item = f"{each.model}_vs_{each.reference}"
    if quantity and (each.reference != MEASURED or each.estimate != "held_out"):
        return []
    return [
        (topic, item, name, float(getattr(each, name)), "1" if name == "n" else each.unit, None)
        for name in ("n", "mean", "quantile_99", "largest")
    ]


def _selection_rows(each: Selection) -> list[tuple]:
    numbers = [
        ("selected", float(each.selected), "1"),
        ("held_out_rms", each.held_out_rms_mm, "mm"),
        ("gain", each.gain_mm2, "mm^2"),
        ("gain_std_error", each.gain_std_error_mm2, "mm^2"),
    ]
    low, high = each.held_out_orders or (None, None)
    orders = {
        "order": each.order,
        "low_order_held_out": low,
        "high_order_held_out": high,
        "highest_order_tried": each.highest_order_tried,
    }
    numbers += [(name, float(value), "1") for name, value in orders.items() if value is not None]
    return [("selection", each.model, name, value, unit, None) for name, value, unit in numbers]


def _errors(pose_errors: Mapping) -> Iterable[ModelErrors]:
    for row in figures.error_statistics(pose_errors).itertuples(index=False):
        estimate = HELD_OUT_TOPICS[row.estimate]
        yield ModelErrors(
            *(row.model, row.reference, estimate, row.quantity, row.unit, int(row.n)),
            *(float(row.mean), float(row.quantile_99), float(row.largest)),
        )


def _selection(tables: Tables) -> Iterable[Selection]:
    choice = pd.DataFrame(dict(tables["model_selection"]))
    for row in choice.itertuples(index=False):
        model = str(row.model)
        order = tables.get(f"{model}_model", {}).get("order")
        known = (bool(row.selected), float(row.held_out_rms_mm), float(row.gain_mm2))
        found = Selection(model, *known, float(row.gain_std_error_mm2))
        if order is None:
            yield found
            continue
        held_out = tried = None
        if (orders := tables.get(f"{model}_orders")) is not None:
            number = np.asarray(orders["order"], dtype=int)
            folds = np.isfinite(np.asarray(orders["fold"], dtype=float))
            chosen = number[folds & (np.asarray(orders["chosen"], dtype=float) == 1)]
            held_out = (int(chosen.min()), int(chosen.max())) if len(chosen) else None
            tried = int(number.max()) if len(np.unique(number)) > 1 else None
        yield Selection(
            model, *known, found.gain_std_error_mm2, int(np.max(order)), held_out, tried
        )


def _ranges(measurements: Mapping, arm: Robot) -> Iterable[JointRange]:
    travel = arm.q_max_rad - arm.q_min_rad
    for joint, (low, high) in enumerate(zip(*figures.covered(measurements, arm), strict=True)):
        slides = bool(arm.dh.prismatic[joint])
        scale, unit = (1.0, "mm") if slides else (180.0 / np.pi, "deg")
        share = float((high - low) / travel[joint])
        yield JointRange(joint + 1, float(scale * low), float(scale * high), unit, share)


def _findings(table: Mapping | None) -> Iterable[Finding]:
    """Findings of the data check, suspicions before notes."""
    rows = range(len(table["finding"])) if table is not None else ()
    order = [i for i in rows if table["finding"][i] != LEFT_OUT]
    for i in sorted(order, key=lambda i: table["level"][i] == _NOTE):
        texts = (str(table[name][i] or "") for name in ("what", "lines", "fix", "accepted"))
        level = str(table["level"][i])
        yield Finding(str(table["finding"][i]), level, int(table["rows"][i]), *texts)


def _excluded(table: Mapping | None, model: str) -> Iterable[ExcludedRow]:
    if table is not None:
        names = RowNames.of_columns({**table, "row": table["line"]})
        for line, reason, error_mm in figures.excluded_errors(table, model):
            yield ExcludedRow(line, names.one(line), reason, error_mm)


def compliance(table: Mapping | None) -> Iterator[JointCompliance]:
    """Joints that bend by a table ``compliance_model``."""
    names = [each for each in JointCompliance.__dataclass_fields__ if each != "joint"]
    for i in range(len(table["joint"])) if table is not None else ():
        values = [float(table[name][i]) for name in names]
        if np.isfinite(values).any():
            yield JointCompliance(int(table["joint"][i]), *values)


def _fact(tables: Tables, topic: str) -> float | None:
    """The number that the table ``summary`` states on a topic."""
    known = tables.get("summary")
    values = [] if known is None else known["value"][np.asarray(known["topic"]) == topic]
    return float(values[0]) if len(values) else None


def tolerance_of(tables: Tables) -> Tolerance | None:
    """The tolerance that the table ``summary`` states."""
    mm = _fact(tables, "tolerance")
    if mm is None:
        return None
    known = tables["summary"]
    return Tolerance(mm, str(known["item"][np.asarray(known["topic"]) == "tolerance"][0]))


def _claims(tables: Tables) -> Claims | None:
    if "claims" not in tables:
        return None
    table = pd.DataFrame(dict(tables["claims"]))
    table = table[~table["used_to_choose"].astype(bool)]  # these chose a reading: no evidence
    counts = [int((table["verdict"] == each).sum()) for each in VERDICTS]
    agree, differ, open_ = counts
    return Claims(agree, differ, open_, tuple(table.loc[table["verdict"] == VERDICTS[1], "claim"]))


def _other_errors(tables: Tables) -> dict[str, float]:
    """Largest difference of the DH model from the VEC model, mm, by population."""
    found = {}
    if (points := tables.get("assessment_points")) is not None:
        found[f"{len(points['point'])} operating points"] = float(np.max(points["true_error_mm"]))
    if (cells := tables.get("accuracy_map")) is not None:
        largest = np.asarray(cells["position_max_mm"], dtype=float)
        if np.isfinite(largest).any():
            reached = int(np.isfinite(largest).sum())
            found[f"accuracy map of {reached} cells"] = float(np.nanmax(largest))
    return found


def _written(folder: Path) -> str:
    path = folder / "model_selection.parquet"
    if not path.is_file():
        return ""
    return datetime.fromtimestamp(path.stat().st_mtime, UTC).date().isoformat()


def _next_steps(folder: Path, tables: Tables, arm: Robot, sought: Sought) -> Iterable[NextStep]:
    place = shlex.quote(str(folder))
    if sought.status is not None:
        yield NextStep("continue the campaign", sought.status.next_command)
    else:
        yield NextStep(
            "bound the largest error; NOISE is the standard deviation of a reading in mm",
            f"kinacc campaign start check --calibration {place} --noise-mm NOISE --budget 300",
        )
    yield NextStep(
        "a robot program, corrected",
        f"kinacc compensate {place} --program PROGRAM -o CORRECTED",
    )
    chosen = results.calibration(tables, arm).choice
    model = "" if chosen == PLAINEST else f" --model {chosen}"
    yield NextStep(
        "files of the model for simulators",
        f"kinacc export {place}{model} --out exported",
    )
    yield NextStep(
        "values to enter into the controller: kuka, abb, fanuc, ur, yaskawa, staubli or ros",
        f"kinacc export {place} --for CONTROLLER --out pendant",
    )

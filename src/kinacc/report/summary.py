"""What the calibration in a results folder is worth: one record for terminal, JSON, table, page."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pandas as pd

from kinacc.assess.conformity import UNDECIDED
from kinacc.assess.statement import CANDIDATES, Statement
from kinacc.calibration import identifiability, misfit
from kinacc.calibration import summary as figures
from kinacc.calibration.summary import Tolerance
from kinacc.campaign import journal, of_calibration, tolerance
from kinacc.campaign.of_calibration import Sought
from kinacc.campaign.status import CampaignStatus
from kinacc.config.error_models import ERROR_MODELS, MEASURED, NOMINAL, PLAINEST, model_name
from kinacc.deployment import applicability
from kinacc.deployment import folder as results
from kinacc.errors import InputError, Problem, refuse
from kinacc.kinematics import robot
from kinacc.kinematics.robot import Robot
from kinacc.measurements.row_names import RowNames
from kinacc.report.history_lines import sentence
from kinacc.tables import store, sums
from kinacc.tables.allowed import FINDING_LEVELS, LEFT_OUT, SUBSETS, VERDICTS
from kinacc.tables.columns import Columns
from kinacc.tables.contract import columns_of

BOUND, HELD_OUT = "bound", "held-out"  # statistics that a verdict is by
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
STATISTICS = {"mean": "mean", f"{figures.LARGE_SHARE:.0%}": "quantile_99", "largest": "largest"}
_TOLERANCE_OF = {BOUND: "bound", HELD_OUT: "quantile_99"}
_DAY = 10  # characters of a time
_NOTE = FINDING_LEVELS[-1]
Tables = Mapping[str, Columns]


@dataclass(frozen=True)
class ModelErrors:
    """Errors of a model over ``n`` rows that every model was tried on.

    ``reference`` is ``measured`` or the model it is compared with; ``estimate`` is ``held_out`` or
    ``training``; ``quantity`` is position (mm) or orientation (mrad).
    """

    model: str
    reference: str
    estimate: str
    quantity: str
    unit: str
    n: int
    mean: float
    quantile_99: float
    largest: float


@dataclass(frozen=True)
class Selection:
    """How a model did in the selection: see ``model_selection``; ``order`` of a VEC model."""

    model: str
    selected: bool
    held_out_rms_mm: float
    gain_mm2: float
    gain_std_error_mm2: float
    order: int | None = None
    held_out_orders: tuple[int, int] | None = None
    highest_order_tried: int | None = None

    @property
    def label(self) -> str:
        """The model's name with its order."""
        if self.order is None:
            return model_name(self.model)
        low, high = self.held_out_orders or (self.order, self.order)
        folds = f" (held out: {low} to {high})" if low < high else ""
        most = ", the highest tried" if self.order == self.highest_order_tried else ""
        return f"{model_name(self.model)}, order {self.order}{folds}{most}"


@dataclass(frozen=True)
class JointRange:
    """Measured range of a joint (deg or mm) and its share of the joint's travel."""

    joint: int
    low: float
    high: float
    unit: str
    share: float


@dataclass(frozen=True)
class Finding:
    """A finding of the data check; ``accepted`` is the reason given in the configuration."""

    finding: str
    level: str
    rows: int
    text: str
    lines: str
    fix: str
    accepted: str

    @property
    def is_open(self) -> bool:
        """Whether it is a suspicion that nobody accepted."""
        return self.level != _NOTE and not self.accepted


@dataclass(frozen=True)
class ExcludedRow:
    """A row that the configuration excludes, and its error by the selected model."""

    line: int
    where: str
    reason: str
    error_mm: float


@dataclass(frozen=True)
class JointCompliance:
    """How a joint bends; a value that was not fitted is NaN."""

    joint: int
    compliance_rad_per_nm: float
    std_compliance_rad_per_nm: float
    lever_coefficient_rad_per_mm: float
    std_lever_coefficient_rad_per_mm: float


@dataclass(frozen=True)
class LargestError:
    """Bounds of the calibration's campaign on the largest error; NaN where none is stated."""

    campaign: str
    model: str
    point: str
    target: str
    candidates: int
    readings: int
    budget: int
    recorded: str
    value_mm: float
    lower_mm: float
    upper_mm: float
    confidence: float
    excepted: int
    tolerance_mm: float | None
    statement: str
    conditions: str
    against: tuple[str, ...]
    noise: Mapping[str, str]
    next_command: str


@dataclass(frozen=True)
class Verdict:
    """Whether an error is within a tolerance: accept, reject or undecided, and why.

    ``source`` of the tolerance is empty where a command was given it.
    """

    verdict: str
    reason: str
    tolerance_mm: float
    source: str = ""


@dataclass(frozen=True)
class NextStep:
    """A command to go on with, and its purpose."""

    purpose: str
    command: str


@dataclass(frozen=True)
class Claims:
    """Number of the paper's claims by verdict, without those that chose a reading of the paper."""

    agree: int
    differ: int
    not_comparable: int
    differing: tuple[str, ...]


@dataclass(frozen=True)
class CalibrationSummary:
    """What the calibration of one data set is worth.

    Positions in mm, orientations in mrad. ``errors`` holds every population; ``share_measured`` is
    the share of the box of the joint ranges that lies near measured poses (None where the table
    ``summary`` does not state it); ``flange_spread_deg`` is None unless the flange points in one
    direction; ``held_out_over_noise`` is NaN where the noise is unknown.
    """

    name: str
    folder: str
    written: str
    robot: str
    synthetic: bool
    readings: int
    poses: int
    targets: int
    fitted: int
    frames_fitted: bool
    full_pose: bool
    selected: str
    errors: tuple[ModelErrors, ...]
    selection: tuple[Selection, ...]
    joint_ranges: tuple[JointRange, ...]
    share_measured: float | None
    flange_spread_deg: float | None
    unidentifiable: tuple[str, ...]
    poorly_determined: tuple[str, ...]
    checked: bool
    findings: tuple[Finding, ...]
    left_out: tuple[str, ...]
    excluded: tuple[ExcludedRow, ...]
    compliance: tuple[JointCompliance, ...]
    noise_mm: float
    held_out_over_noise: Mapping[str, float]
    largest_error: LargestError | None
    remarks: tuple[str, ...]
    tolerance: Tolerance | None
    claims: Claims | None
    other_errors: Mapping[str, float]
    history: str
    outdated: str
    next_steps: tuple[NextStep, ...]

    @property
    def is_held_out(self) -> bool:
        """Whether poses were held out."""
        return any(each.estimate == "held_out" for each in self.errors)

    def position_errors(self) -> dict[str, ModelErrors]:
        """Position errors against measurements by model, held out where poses were."""
        estimate = "held_out" if self.is_held_out else "training"
        return {
            each.model: each
            for each in self.errors
            if (each.reference, each.estimate, each.quantity) == (MEASURED, estimate, "position")
        }

    def orientation_errors(self) -> dict[str, ModelErrors]:
        """Held-out orientation errors by model, empty for positions only."""
        return {
            each.model: each
            for each in self.errors
            if (each.reference, each.estimate, each.quantity)
            == (MEASURED, "held_out", "orientation")
        }

    @property
    def best(self) -> ModelErrors:
        """Position errors of the selected model."""
        return self.position_errors()[self.selected]

    def error_table(self) -> pd.DataFrame:
        """Errors of every model at the rows of ``best``: model, then statistics by name and unit.

        The index holds the models; numbers are texts of three significant digits.
        """
        turned, rows = self.orientation_errors(), {}
        for model, errors in self.position_errors().items():
            row = {"model": self.label(model)}
            for part in filter(None, (errors, turned.get(model))):
                for name, key in STATISTICS.items():
                    row[f"{name}, {part.unit}"] = size(getattr(part, key))
            rows[model] = row
        return pd.DataFrame.from_dict(rows, orient="index").fillna("")

    def label(self, model: str) -> str:
        """A model's name with its order, or with the frames that were fitted."""
        if model == NOMINAL:
            return "nominal, base and tool fitted" if self.frames_fitted else NOMINAL
        return next(each.label for each in self.selection if each.model == model)

    def verdict(self, by: str, tolerance_mm: float | None = None) -> Verdict | None:
        """The verdict ``by`` the bound of the campaign or by held-out errors.

        Without ``tolerance_mm`` the campaign's tolerance counts, then that of the configuration
        where it is about the same statistic; None where there is none.
        """
        found, source = self.largest_error, ""
        if tolerance_mm is None and found is not None and by == BOUND:
            tolerance_mm, source = found.tolerance_mm, tolerance.OF_CAMPAIGN
        if tolerance_mm is None and self.tolerance and self.tolerance.of == _TOLERANCE_OF[by]:
            tolerance_mm, source = self.tolerance.mm, tolerance.OF_CONFIGURATION
        if tolerance_mm is None:
            return None
        if by == HELD_OUT:
            judged = tolerance.by_held_out(
                Tolerance(tolerance_mm, _TOLERANCE_OF[by]), self._held_out()
            )
        elif found is None:
            judged = UNDECIDED, "no campaign bounds the largest error"
        else:
            bounds = (found.value_mm, found.lower_mm, found.upper_mm, found.confidence)
            said = Statement(CANDIDATES, *bounds, excepted=found.excepted)
            judged = tolerance.by_bound(tolerance_mm, said, bool(found.against))
        return Verdict(*judged, tolerance_mm, source)

    def of_configuration(self) -> Verdict | None:
        """The verdict on the tolerance of the configuration, by the statistic it names."""
        if self.tolerance is None:
            return None
        if self.tolerance.of == "bound":
            return self.verdict(BOUND, self.tolerance.mm)
        judged = tolerance.by_held_out(self.tolerance, self._held_out())
        return Verdict(*judged, self.tolerance.mm, tolerance.OF_CONFIGURATION)

    def _held_out(self) -> dict[str, float]:
        best = self.best
        if not self.is_held_out:
            return {}
        return {"n": best.n, "mean": best.mean, "quantile_99": best.quantile_99}


def size(value: float) -> str:
    """A number with three significant digits, without an exponent."""
    if not math.isfinite(value) or value == 0.0:
        return f"{value:.3g}"
    return f"{value:.{max(0, 2 - math.floor(math.log10(abs(value))))}f}"


def read_tables(
    folder: Path | str,
    needed: Sequence[str] = figures.TABLES,
    optional: Sequence[str] = OPTIONAL,
) -> dict[str, Columns]:
    """The tables of a results folder. Raises InputError naming every ``needed`` one missing."""
    folder = Path(folder)
    if not any((folder / f"{name}.parquet").is_file() for name in needed):
        fix = "kinacc calibrate FILE.yaml makes one"
        what = "holds no calibration" if folder.is_dir() else "no such folder"
        raise InputError(Problem(str(folder), what, fix=fix))
    refuse(
        Problem(str(folder / f"{name}.parquet"), "no such file", fix="run the workflow first")
        for name in needed
        if not (folder / f"{name}.parquet").is_file()
    )
    paths = {name: folder / f"{name}.parquet" for name in dict.fromkeys((*needed, *optional))}
    return {name: store.read(path) for name, path in paths.items() if path.is_file()}


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
    tables = read_tables(folder) if tables is None else tables
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
        largest_error=_largest(sought.status),
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


def _largest(found: CampaignStatus | None) -> LargestError | None:
    if found is None:
        return None
    bound = found.of_all
    return LargestError(
        campaign=found.folder,
        model=found.model,
        point=found.point,
        target=bound.about,
        candidates=found.candidates,
        readings=found.readings,
        budget=found.budget,
        recorded=found.recorded[:_DAY],
        value_mm=bound.value_mm,
        lower_mm=bound.lower_mm,
        upper_mm=bound.upper_mm,
        confidence=bound.confidence,
        excepted=bound.excepted,
        tolerance_mm=bound.tolerance_mm,
        statement=bound.text,
        conditions=found.assumes,
        against=(*found.against, *found.overruled),
        noise=found.noise,
        next_command=found.next_command,
    )


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

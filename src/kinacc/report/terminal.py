"""The summary of a calibration as text, and the table of many."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from rich.console import Console
from rich.table import Table

from kinacc.assess.conformity import UNDECIDED
from kinacc.calibration.summary import LARGE_SHARE, TABLES
from kinacc.config.error_models import NOMINAL, PLAINEST, model_name
from kinacc.deployment.folder import read_tables
from kinacc.errors import Problem, as_seen
from kinacc.report.summarise import OPTIONAL, summarise, summarise_all
from kinacc.report.summary import BOUND, STATISTICS, CalibrationSummary, Verdict, size

FEW = 4  # data sets whose summaries are printed one after another
WIDTH = 100
_MOST = 3  # findings, rows and parameters without --verbose
_FEW_SHARE = 0.01
_DAY = 10  # characters of a time
_ENTER = "Harmless. Known values can be entered (calibration.dh.parameters, calibration.frames)."


class _Console(Console):
    """A console whose reader may have gone: the command ends as others do then."""

    def on_broken_pipe(self) -> None:
        """Leave the error to the command."""
        raise BrokenPipeError


def screen(width: int | None = None) -> Console:
    """The standard output, as wide as the terminal by default."""
    return _Console(file=sys.stdout, width=width, highlight=False, markup=False, emoji=False)


def print_summary(
    summary: CalibrationSummary,
    verbose: bool = False,
    by: str = BOUND,
    tolerance_mm: float | None = None,
) -> None:
    """Print half a page on one calibration, with the verdict ``by`` a statistic; see ``verdict``.

    ``verbose``: every finding, parameter and population of errors.
    """
    console = screen(WIDTH)
    console.print(as_seen(about(summary)), soft_wrap=True)
    for text in headline(summary, by, tolerance_mm):
        console.print(as_seen(text))
    console.print()
    console.print(_error_table(summary, verbose))
    grid = Table.grid(padding=(0, 2))
    grid.add_column(no_wrap=True)
    grid.add_column(overflow="fold")
    for topic, texts in notes(summary, None if verbose else _MOST).items():
        for i, text in enumerate(texts):
            grid.add_row("" if i else topic, as_seen(text))
    console.print(grid)
    for step in summary.next_steps:
        console.print(f"{step.purpose[:1].upper()}{step.purpose[1:]}:")
        console.print(f"  {step.command}", soft_wrap=True)


def print_summaries(folders: Sequence[Path], without: Sequence[str] = ()) -> None:
    """Print half a page each for a few results folders, a table for many.

    ``without``: tables of an earlier run to leave out.
    """
    if len(folders) > FEW:
        print_fleet(fleet_table(summarise_all(folders), BOUND), BOUND)
        return
    for folder in folders:
        tables = read_tables(folder, needed=TABLES, optional=OPTIONAL)
        shown = {name: table for name, table in tables.items() if name not in without}
        print()
        print_summary(summarise(folder, shown))


def about(summary: CalibrationSummary) -> str:
    """The data set, its robot and its readings, in a line."""
    kind = "full pose" if summary.full_pose else "positions only"
    source = "synthetic arm" if summary.synthetic else "measured"
    readings = f"{counted(summary.readings, 'reading')} of {counted(summary.targets, 'target')}"
    name = summary.name if summary.name == summary.robot else f"{summary.name} ({summary.robot})"
    return f"{name}: {readings} at {counted(summary.poses, 'pose')}, {kind}, {source}"


def headline(
    summary: CalibrationSummary, by: str = BOUND, tolerance_mm: float | None = None
) -> list[str]:
    """The answer: errors before and after, then the verdicts."""
    best, nominal = summary.best, summary.position_errors()[NOMINAL]
    where = "held-out" if summary.is_held_out else "fitted"
    texts = [
        f"Mean position error at {best.n} {where} {'readings' if best.n > 1 else 'reading'}: "
        f"{size(best.mean)} mm ({summary.label(NOMINAL)}: {size(nominal.mean)} mm)."
        + (" Includes reading noise." if not summary.synthetic else "")
    ]
    if summary.outdated:
        texts.insert(0, f"OUTDATED: {summary.outdated}. Run kinacc calibrate again.")
    if not summary.is_held_out:
        texts.append("No pose was held out: errors at other poses are larger.")
    elif best.mean >= nominal.mean:
        texts.append(
            f"The {model_name(best.model)} model is not better than the nominal one: measure more "
            "poses, or correct the data."
        )
    if summary.history:
        texts.append(f"History: {summary.history}.")
    campaign = summary.campaign
    if campaign is None:
        texts.append("Largest error of the robot: not assessed (no campaign).")
    else:
        texts.append(f"Campaign {campaign.folder}: {campaign.of_all.text}")
    verdicts = [summary.verdict(by, tolerance_mm)]
    if tolerance_mm is None:
        verdicts.append(summary.of_configuration())
    for each in dict.fromkeys(filter(None, verdicts)):
        source = f" ({each.source})" if each.source else ""
        texts.append(f"Tolerance {each.tolerance_mm:g} mm{source}: {each.verdict}, {each.reason}.")
    return texts


def notes(summary: CalibrationSummary, most: int | None) -> dict[str, list[str]]:
    """Texts by topic; at most ``most`` findings, rows and parameters each, all for None."""
    suspicions = [_finding(each) for each in summary.findings if each.is_open]
    remarks = [_finding(each) for each in summary.findings if not each.is_open]
    check = _first(suspicions, most) or ["nothing suspicious" if summary.checked else "not run"]
    rows = [
        f"{each.where}: {each.reason}"
        + (f" ({size(each.error_mm)} mm)" if math.isfinite(each.error_mm) else "")
        for each in summary.excluded
    ]
    status, campaign = summary.campaign, [*summary.remarks]
    if status is not None:
        campaign += [status.assumes] if status.assumes else []
        campaign += [*summary.doubts, f"{status.readings} of {status.budget} readings"]
        if status.model != summary.selected:
            campaign.append(f"About the {model_name(status.model)} model, which is not selected.")
    claims = summary.claims
    told = {
        "Paper's claims": []
        if claims is None
        else [
            f"{claims.agree} agree, {claims.differ} differ, {claims.not_comparable} not comparable",
            *_first(list(claims.differing), most),
        ],
        "Not used": _first(list(summary.left_out), most),
        "Data check": [*check, *_first(remarks, most)],
        "Excluded rows": _first(rows, most),
        "Selection": [selection(summary)],
        "Joint compliance": [_compliance(each) for each in summary.compliance],
        "Measured range": _ranges(summary),
        "Poorly determined": _poorly_determined(summary, most),
        "Unidentifiable": summary.unidentifiable
        and [*_first(list(summary.unidentifiable), most), _ENTER],
        "Noise": _noise(summary),
        "Model difference": [
            f"{size(mm)} mm at most, DH to VEC, {where}"
            for where, mm in summary.other_errors.items()
        ],
        "Campaign": campaign,
    }
    return {topic: texts for topic, texts in told.items() if texts}


def selection(summary: CalibrationSummary) -> str:
    """Which model was selected, by which figures."""
    chosen = {each.model: each for each in summary.selection}
    best = chosen.pop(summary.selected)
    name = model_name(best.model)
    if not chosen:
        return f"{name} is the only model."
    if not summary.is_held_out:
        return f"{name} selected: no pose was held out to compare models."
    others = ", ".join(
        f"{model_name(each.model)} {size(each.held_out_rms_mm)} mm" for each in chosen.values()
    )
    compared = best if best.model != PLAINEST else next(iter(chosen.values()))
    gain, error = abs(compared.gain_mm2), compared.gain_std_error_mm2
    return (
        f"{name} selected: held-out rms {size(best.held_out_rms_mm)} mm, {others} (mean squares "
        f"differ by {gain:.3g} mm^2, standard error {error:.2g})."
    )


def fleet_table(
    found: Sequence[CalibrationSummary | Problem], by: str, tolerance_mm: float | None = None
) -> pd.DataFrame:
    """One row a calibration: errors in mm, the bound of its campaign, the verdict."""
    rows = []
    for each in found:
        if isinstance(each, Problem):
            place = each.where.removesuffix("/summary.parquet")
            row: dict[str, object] = {"data_set": place.rpartition("/")[2], "folder": place}
            rows.append(row | {"verdict": UNDECIDED, "reason": str(each)})
            continue
        best, status = each.best, each.campaign
        bound = status.of_all if status else None
        judged = each.verdict(by, tolerance_mm) or Verdict("", "", math.nan)
        row = {
            "data_set": each.name,
            "verdict": judged.verdict,
            "model": each.selected,
            "held_out_mean_mm": best.mean if each.is_held_out else math.nan,
            "held_out_99_mm": best.quantile_99 if each.is_held_out else math.nan,
            "held_out_largest_mm": best.largest if each.is_held_out else math.nan,
            "held_out_rows": best.n if each.is_held_out else 0,
            "bound_mm": bound.upper_mm if bound else math.nan,
            "lower_mm": bound.lower_mm if bound else math.nan,
            "confidence": bound.confidence if bound else math.nan,
            "campaign_date": status.recorded[:_DAY] if status else "",
            "file_date": each.written,
            "tolerance_mm": judged.tolerance_mm,
            "reason": judged.reason,
            "open_findings": sum(finding.is_open for finding in each.findings),
            "campaign": status.folder if status else "",
            "bound_of": f"{bound.about}, {status.point}" if status else "",
            "assumptions": status.assumes if status else "",
            "remarks": "; ".join([*each.remarks, *each.doubts]),
            "robot": each.robot,
            "folder": each.folder,
        }
        rows.append(row)
    return pd.DataFrame(rows)


def print_fleet(table: pd.DataFrame, by: str) -> None:
    """Print the table of many calibrations, then reasons and remarks of each."""
    console = screen(WIDTH)
    shown = {
        "data_set": "data set",
        "verdict": "verdict",
        "bound_mm": "bound mm",
        "confidence": "confidence",
        "model": "model",
        "held_out_mean_mm": "mean mm",
        "held_out_99_mm": f"{LARGE_SHARE:.0%} mm",
        "held_out_largest_mm": "largest mm",
        "file_date": "date",
    }
    table = table.reindex(columns=[*dict.fromkeys([*table.columns, *shown, "reason", "remarks"])])
    counts = table["verdict"].replace("", pd.NA).value_counts().to_dict()
    told = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    console.print(
        counted(len(table), "calibration") + (f": {told}, by {by}" if told else ""), highlight=False
    )
    shown = {
        name: head
        for name, head in shown.items()
        if (table[name].notna() & (table[name] != "")).any()
    }
    grid = Table(box=None, pad_edge=False)
    for name, head in shown.items():
        grid.add_column(
            head, justify="right" if pd.api.types.is_numeric_dtype(table[name]) else "left"
        )
    for _, row in table.iterrows():
        grid.add_row(*(_cell(row[name], name) for name in shown))
    console.print(grid)
    console.print("Position errors of the selected model at held-out poses.")
    for column in ("reason", "remarks"):
        told = table[column].notna() & (table[column].astype(str) != "")
        for text, group in table[told].groupby(column, sort=False):
            names = ", ".join(group["data_set"][:_MOST])
            more = f" and {len(group) - _MOST} more" if len(group) > _MOST else ""
            console.print(as_seen(f"{names}{more}: {text}"), soft_wrap=True)


def counted(number: float, noun: str) -> str:
    """``1 pose``, ``2 poses``."""
    return f"{number:.0f} {noun}{'' if number == 1 else 's'}"


def _cell(value: object, name: str) -> str:
    if isinstance(value, float):
        if math.isnan(value):
            return ""
        return f"{value:.0%}" if name == "confidence" else f"{value:.3f}"
    return as_seen(str(value)) if value is not None else ""


def _error_table(summary: CalibrationSummary, verbose: bool) -> Table:
    table = Table(box=None, pad_edge=False)
    where = "Held-out" if summary.is_held_out else "Training"
    table.add_column(f"{where} errors ({counted(summary.best.n, 'reading')})", no_wrap=True)
    errors = summary.error_table()
    for name in errors.columns[1:]:
        table.add_column(name.replace(", ", "\n"), justify="right", no_wrap=True)
    table.add_column("", no_wrap=True)
    for model, row in errors.iterrows():
        table.add_row(*map(as_seen, row), "<- selected" if model == summary.selected else "")
    if verbose:
        for each in summary.errors:
            if each.quantity != "position" or each in summary.position_errors().values():
                continue
            of = "" if each.reference == "measured" else f" to {model_name(each.reference)}"
            called = f"{each.estimate.replace('_', '-')}: {model_name(each.model)}{of}"
            table.add_row(called, *(size(getattr(each, key)) for key in STATISTICS.values()))
    return table


def _finding(each) -> str:
    name = each.finding.replace("_", " ")
    lines = "" if not each.lines or each.lines in each.text else f" ({each.lines})"
    accepted = f"; accepted: {each.accepted}" if each.accepted else ""
    remedy = f" -> {each.fix}" if each.fix and each.is_open else ""
    return f"{name}: {each.text}{lines}{accepted}{remedy}"


def _compliance(each) -> str:
    parts = []
    for name, per in (
        ("compliance_rad_per_nm", "N m"),
        ("lever_coefficient_rad_per_mm", "mm of lever"),
    ):
        value, std = getattr(each, name), getattr(each, f"std_{name}")
        if math.isfinite(value):
            spread = f" +- {1e6 * std:.3g}" if math.isfinite(std) else " (std unknown)"
            parts.append(f"{1e6 * value:.4g}{spread} urad per {per}")
    product = " (product with the weight: masses are not stated)" if len(parts) == 1 else ""
    return f"joint {each.joint}: {', '.join(parts)}{product}"


def _ranges(summary: CalibrationSummary) -> list[str]:
    parts = [
        f"J{each.joint} {each.low:.0f} to {each.high:.0f} {each.unit} ({each.share:.0%} of travel)"
        for each in summary.joint_ranges
    ]
    share = summary.share_measured
    if share is None:
        return ["; ".join(parts)]
    many = f"About {share:.0%}" if share >= _FEW_SHARE else f"Fewer than {_FEW_SHARE:.0%}"
    return [
        f"{many} of joint combinations within these ranges lie near a measured pose. Errors "
        "elsewhere may be larger.",
        "; ".join(parts),
    ]


def _poorly_determined(summary: CalibrationSummary, most: int | None) -> list[str]:
    if not summary.poorly_determined:
        return []
    texts = _first(list(summary.poorly_determined), most)
    spread = summary.flange_spread_deg
    if spread is not None:
        return [
            *texts,
            f"The flange z axis has the same direction in all poses (within {spread:.2g} deg). "
            "Tilt the wrist and measure more poses.",
        ]
    return [
        *texts,
        "Measure different poses (kinacc plan-poses) or enter a known value (calibration.frames).",
    ]


def _noise(summary: CalibrationSummary) -> list[str]:
    valid = "Standard deviations of parameters are valid given the model."
    if not summary.noise_mm > 0.0:
        return [f"unknown: no configuration was measured twice. {valid}"]
    ratios = summary.held_out_over_noise.items()
    over = (f"{model_name(model)} {each:.3g}" for model, each in ratios if math.isfinite(each))
    ratio = f"Held-out error over noise ({size(summary.noise_mm)} mm): {', '.join(over)}."
    return [f"{size(summary.noise_mm)} mm per axis. {ratio} {valid}"]


def _first(texts: list[str], most: int | None) -> list[str]:
    if most is None or len(texts) <= most:
        return texts
    return [*texts[:most], f"and {len(texts) - most} more (--verbose)"]

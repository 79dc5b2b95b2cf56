"""Thresholds of a configuration held to the tables of a run."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.assess.statement import ACCEPT, REJECT
from kinacc.config.values import did_you_mean
from kinacc.errors import InputError, first_few
from kinacc.gate import chance
from kinacc.gate.outcome import FAILED, PASSED, UNDECIDED, WARNED, Outcome
from kinacc.gate.values import Figure, RunTables, cell, figure, sample
from kinacc.report.history_lines import sentence
from kinacc.tables import sums
from kinacc.tables.allowed import FINDING_LEVELS, FIRST, HOLDS, LEFT_OUT, RECALIBRATE

Gate = Mapping[str, Any]
# What a configuration calls a verdict, and the verdict.
_MEANT = {"fail": FAILED, "warn": WARNED, "pass": UNDECIDED}


def judged(
    results: Path,
    configurations: Mapping[str, Mapping[str, Any]],
    accepted: Path | None,
    broken: Collection[str] = (),
) -> Iterator[Outcome]:
    """The outcome of every gate of every data set, in the order of the configuration.

    ``configurations``: full settings by data set, whose results stand in folders of their names
    below ``results``, as those of the accepted run do below ``accepted`` (None without one). Gates
    of ``broken`` data sets, whose files do not hold, are undecided.
    """
    for name, full in configurations.items():
        tables = RunTables(results / name)
        before = RunTables(accepted / name) if accepted else None
        for gate in full["gates"]:
            if name in broken:
                says = "not checked: files of the data set fail their check"
                yield Outcome(name, gate["name"], _kind(gate), UNDECIDED, says)
            else:
                yield of_gate(gate, tables, full["tolerance"]["mm"], before)


def of_gate(
    gate: Gate, tables: RunTables, tolerance_mm: float | None, accepted: RunTables | None
) -> Outcome:
    """The outcome of one gate by the ``tables`` of a data set; a missing table is a failure."""
    try:
        if gate["kind"] == "value":
            results = _value(gate, figure(gate["value"], tables, gate), tolerance_mm)
        elif gate["kind"] == "table":
            results = _value(gate, cell(tables, gate), tolerance_mm)
        elif gate["kind"] == "against":
            results = _change(gate, tables, accepted)
        elif gate["kind"] == "campaign":
            results = _campaign(gate, tables, tolerance_mm)
        else:
            of = {"claims": _claims, "suspicions": _suspicions, "history": _history}
            results = of[gate["kind"]](gate, tables)
    except InputError as error:
        first = error.problems[0]
        results = _found(FAILED, f"{first.where} {first.what}", first.fix)
    verdict, fix = results.verdict, results.fix
    if verdict == UNDECIDED:
        verdict = _MEANT[gate["undecided"]]
        fix = fix or "measure more poses, or set undecided: warn"
    if verdict == FAILED:
        verdict = _MEANT[gate["on_fail"]]
    return replace(
        results,
        dataset=tables.folder.name,
        name=gate["name"],
        kind=_kind(gate),
        verdict=verdict,
        fix="" if verdict == PASSED else fix,
    )


def _kind(gate: Gate) -> str:
    return "change" if gate["kind"] == "against" else str(gate["kind"])


def _found(verdict: str, says: str, fix: str = "", **figures: Any) -> Outcome:
    """What a gate found, before it is known whose gate it is."""
    return Outcome("", "", "", verdict, says, fix, figures)


def _value(gate: Gate, results: Figure, tolerance_mm: float | None) -> Outcome:
    limits: Mapping[str, Any] = gate["limit"] or {"at_most": tolerance_mm}
    ((key, limit),) = limits.items()
    word = "at_least" if key.startswith("at_least") else "at_most"
    allowed = f"{word.replace('_', ' ')} {results.worded(limit)} allowed"
    allowed += "" if gate["limit"] else " (the tolerance of the configuration)"
    figures: dict[str, Any] = {f"value{results.key}": results.size, f"{word}{results.key}": limit}
    figures |= {"of": results.called, **results.about}
    held = results.size <= limit if word == "at_most" else results.size >= limit
    if results.open and (held or np.isnan(results.size)):
        return _found(
            UNDECIDED, f"undecided: {results.called}: {results.open}; {allowed}", **figures
        )
    says = f"{results.called} is {results.worded(results.size)}; {allowed}"
    fix = f"off by {results.worded(abs(results.size - limit))}"
    return _found(PASSED if held else FAILED, says, fix, **figures)


def _change(gate: Gate, tables: RunTables, accepted: RunTables | None) -> Outcome:
    if accepted is None or not accepted.folder.is_dir():
        fix = 'accept one: kinacc check-results RESULTS --accept FOLDER --reason ".."'
        return _found(FAILED, f"no accepted run of {tables.folder.name}", fix)
    name, confidence, (allowed,) = gate["value"], gate["beyond_chance"], gate["limit"].values()
    now, before = (figure(name, item, gate) for item in (tables, accepted))
    first, second = (sample(name, item, gate) for item in (tables, accepted))
    measured, measured_before = (
        sums.stated(item.folder).get("measurements.parquet") for item in (tables, accepted)
    )
    paired = measured is not None and measured == measured_before
    results = chance.change(name.rpartition(".")[2], first, second, paired, confidence)
    figures = {
        f"value{now.key}": now.size,
        f"accepted{now.key}": before.size,
        f"worse_by{now.key}": results.difference,
        f"worse_by_at_least{now.key}": results.least,
        f"allowed{now.key}": allowed,
        "beyond_chance": confidence,
        "of": now.called,
        "paired": int(paired),
        "accepted_rows": before.about["rows"],
        **now.about,
    }
    says = (
        f"{now.called} is {now.worded(now.size)}, in the accepted run {before.worded(before.size)};"
        f" {now.worded(allowed)} worse is allowed"
    )
    if results.open:
        return _found(UNDECIDED, f"undecided: {says}; {results.open}", **figures)
    if results.least != results.difference:
        poses = f"{first.count}" if paired else f"{first.count} and {second.count}"
        says += f"; at least {now.worded(results.least)} worse"
        says += f" ({confidence:.4g} confidence, {poses} poses)"
    fix = f"kinacc check-results --against {accepted.folder.parent} lists what changed"
    return _found(FAILED if results.least > allowed else PASSED, says, fix, **figures)


def _campaign(gate: Gate, tables: RunTables, tolerance_mm: float | None) -> Outcome:
    from kinacc.campaign.folder import open_
    from kinacc.report.summarise import summarise
    from kinacc.report.summary import BOUND

    place = Path(gate["campaign"])
    open_(place)  # raises where it cannot be used
    summary = summarise(tables.folder, campaigns=[place])
    status = summary.campaign
    allowed = tolerance_mm if gate["tolerance_mm"] is None else gate["tolerance_mm"]
    judged_as = summary.verdict(BOUND, allowed)
    if status is None or judged_as is None:
        fix = f"begin one on it: kinacc campaign start FOLDER --calibration {tables.folder}"
        return _found(FAILED, "; ".join(summary.remarks), fix)
    known, confidence = status.of_all, gate["confidence"]
    figures = {"tolerance_mm": allowed, "campaign": status.folder, "readings": status.readings}
    says = f"campaign {place}: {judged_as.verdict}, {judged_as.reason}"
    if np.isfinite(known.upper_mm):
        figures |= {"lower_mm": known.lower_mm, "confidence": known.confidence}
        figures["bound_mm"] = known.upper_mm
        says += (
            f"; the largest error is at most {known.upper_mm:.3f} mm with "
            f"{known.confidence:.0%} confidence, {allowed:g} mm allowed"
        )
        if confidence is not None and known.confidence < confidence - 1e-9:
            says = f"campaign {place} has {known.confidence:.0%} confidence"
            says += f", {confidence:.0%} asked for"
            fix = "begin a campaign with that confidence, or ask for the campaign's"
            return _found(FAILED, says, fix, **figures)
    says = "; ".join([says, *summary.remarks, *summary.doubts])
    verdict = {ACCEPT: PASSED, REJECT: FAILED}.get(judged_as.verdict, UNDECIDED)
    return _found(verdict, says, f"kinacc campaign status {place}", **figures)


def _claims(gate: Gate, tables: RunTables) -> Outcome:
    table = tables["claims"].set_index("claim")
    excepted, fix = gate["except"], f"kinacc show {tables.folder} claims"
    if unknown := [item for item in excepted if item not in table.index]:
        fix = did_you_mean(unknown[0], table.index) or fix
        return _found(FAILED, f"except names no claim: {first_few(unknown)}", fix)
    # Sentences that chose a reading of the paper are no evidence.
    verdict = table["verdict"][~table["used_to_choose"].astype(bool)]
    state = verdict.mask(verdict.index.isin(excepted), verdict + ", though excepted")
    names = {text: state.index[state == text] for text in state.unique()}
    differ, agree = (int((verdict == text).sum()) for text in ("differs", "agrees"))
    remaining = len(names.get("differs", ()))
    says = [f"{agree} of {len(verdict)} claims agree"]
    says += [f"{text}: {first_few(list(of))}" for text, of in names.items() if text != "agrees"]
    figures = {"claims": len(verdict), "agree": agree, "differ": differ}
    return _found(
        FAILED if remaining else PASSED,
        "; ".join(says),
        fix,
        **figures,
        differ_not_excepted=remaining,
    )


def _suspicions(gate: Gate, tables: RunTables) -> Outcome:
    measurements = tables["measurements"]
    if "row" not in measurements or measurements["row"].isna().all():
        return _found(PASSED, "simulated measurements: no file to check", suspicions=0)
    table = tables["data_check"]
    table = table[(table["finding"] != LEFT_OUT) & (table["level"] != FINDING_LEVELS[-1])]
    known = table["accepted"].fillna("").astype(bool)
    remaining = table if gate["suspicions"] == "none" else table[~known]
    says = f"{len(remaining)} suspicions" + (f", {known.sum()} accepted" if known.any() else "")
    if len(remaining):
        says += f": {first_few(list(remaining['finding'] + ': ' + remaining['what']), 3)}"
    fix = "correct the file, or give a reason in data_check.accept and set suspicions: known"
    verdict = FAILED if len(remaining) else PASSED
    return _found(verdict, says, fix, suspicions=len(table), accepted=int(known.sum()))


def _history(gate: Gate, tables: RunTables) -> Outcome:
    table = tables["history"]
    last = table.iloc[-1]
    names = ("moved_mm", "chance_mm", "beyond_mm", "probability")
    verdicts = {FIRST: PASSED, HOLDS: PASSED, RECALIBRATE: FAILED}
    verdict = verdicts.get(str(last["verdict"]), UNDECIDED)
    fix = "" if verdict == UNDECIDED else "calibrate the arm anew, or find out what moved"
    says = f"{last['series']}: {sentence({name: table[name].to_numpy() for name in table})}"
    figures = {name: float(last[name]) for name in names}
    return _found(verdict, says, fix, **figures, lines=len(table))

"""Thresholds of a configuration held to the tables of a run."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.assess.conformity import ACCEPT, REJECT
from kinacc.config.gate_rules import LIMITS, limit_key, limited
from kinacc.config.values import nearest
from kinacc.errors import InputError, first_few
from kinacc.gate import chance
from kinacc.gate.outcome import FAILED, PASSED, UNDECIDED, WARNED, Outcome
from kinacc.gate.values import Figure, RunTables, cell, figure, sample
from kinacc.report.history_lines import sentence
from kinacc.tables import sums
from kinacc.tables.allowed import FINDING_LEVELS, FIRST, HOLDS, LEFT_OUT, RECALIBRATE

Gate = Mapping[str, Any]
Figures = Mapping[str, Any]
_ROUNDING = 1e-9
_MORE = "measure more poses, or set undecided: warn"
# What a configuration calls a verdict, and the verdict.
_NONE: Figures = {}
_MEANT = {"fail": FAILED, "warn": WARNED, "pass": UNDECIDED}


def _found(verdict: str, says: str, fix: str = "", figures: Figures = _NONE) -> Outcome:
    """What a gate found, before it is known whose gate it is."""
    return Outcome("", "", "", verdict, says, fix, figures)


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
        tables = None if name in broken else RunTables(results / name)
        before = None if accepted is None else RunTables(accepted / name)
        for gate in full["gates"]:
            yield of_gate(gate, name, tables, full["tolerance"], before)


def of_gate(
    gate: Gate,
    dataset: str,
    tables: RunTables | None,
    tolerance: Mapping[str, Any],
    accepted: RunTables | None,
) -> Outcome:
    """The outcome of one gate; a missing table is a failure. ``tables`` are None if they fail."""
    kind = "change" if gate["kind"] == "against" else gate["kind"]
    if tables is None:
        says = "not checked: files of the data set fail their check"
        return Outcome(dataset, gate["name"], kind, UNDECIDED, says)
    try:
        if gate["kind"] == "value":
            word, limit, subset = limited(gate, tolerance["mm"])
            results = _value(figure(gate["value"], tables, gate), word, limit, subset)
        elif gate["kind"] == "table":
            word = LIMITS[gate[LIMITS[0]] is None]
            results = _value(cell(tables, gate), word, gate[word])
        elif gate["kind"] == "against":
            results = _change(gate, dataset, tables, accepted)
        elif gate["kind"] == "campaign":
            results = _campaign(gate, dataset, tables, tolerance)
        else:
            of = {"claims": _claims, "suspicions": _suspicions, "history": _history}
            results = of[gate["kind"]](gate, tables)
    except InputError as error:
        first = error.problems[0]
        results = _found(FAILED, f"{first.where} {first.what}", first.fix)
    verdict, fix = results.verdict, results.fix
    if verdict == UNDECIDED:
        verdict, fix = _MEANT[gate["undecided"]], fix or _MORE
    if verdict == FAILED:
        verdict = _MEANT[gate["on_fail"]]
    fix = "" if verdict == PASSED else fix
    return replace(results, dataset=dataset, name=gate["name"], kind=kind, verdict=verdict, fix=fix)


def _value(results: Figure, word: str, limit: float, subset: bool = True) -> Outcome:
    owner = "" if subset else " (the tolerance of the configuration)"
    asked = f"{word.replace('_', ' ')} {results.worded(limit)} allowed{owner}"
    figures = {
        f"value{results.key}": results.size,
        f"{word}{results.key}": limit,
        "of": results.called,
    }
    figures |= results.about
    held = results.size <= limit if word == LIMITS[0] else results.size >= limit
    if results.open and (held or np.isnan(results.size)):
        says = f"undecided: {results.called}: {results.open}; {asked}"
        return _found(UNDECIDED, says, figures=figures)
    says = f"{results.called} is {results.worded(results.size)}; {asked}"
    fix = f"off by {results.worded(abs(results.size - limit))}"
    return _found(PASSED if held else FAILED, says, fix, figures)


def _change(gate: Gate, dataset: str, tables: RunTables, accepted: RunTables | None) -> Outcome:
    if accepted is None or not accepted.folder.is_dir():
        fix = 'accept one: kinacc check-results RESULTS --accept FOLDER --reason ".."'
        return _found(FAILED, f"no accepted run of {dataset}", fix)
    name, asked, allowed = gate["value"], gate["beyond_chance"], gate[limit_key("allow", gate)]
    now, before = (figure(name, item, gate) for item in (tables, accepted))
    first, second = (sample(name, item, gate) for item in (tables, accepted))
    digest = sums.stated(tables.folder).get("measurements.parquet")
    paired = digest is not None and digest == sums.stated(accepted.folder).get(
        "measurements.parquet"
    )
    results = chance.change(name.rpartition(".")[2], first, second, paired, asked)
    figures = {
        f"value{now.key}": now.size,
        f"accepted{now.key}": before.size,
        f"worse_by{now.key}": results.difference,
        f"worse_by_at_least{now.key}": results.least,
        f"allowed{now.key}": allowed,
        "beyond_chance": asked,
        "of": now.called,
        "paired": int(paired),
        "accepted_rows": before.about["rows"],
        **now.about,
    }
    worse = "worse" if results.difference >= 0.0 else "better"
    by = now.worded(abs(results.difference))
    says = (
        f"{now.called} is {now.worded(now.size)}, {by} {worse} than "
        f"the accepted run's {before.worded(before.size)}; {now.worded(allowed)} worse is allowed"
    )
    if results.open:
        return _found(UNDECIDED, f"undecided: {says}; {results.open}", "", figures)
    if results.least != results.difference:
        poses = f"{first.count} poses of the same measurements"
        poses = poses if paired else f"{first.count} and {second.count} poses"
        says += f"; at least {now.worded(results.least)} worse ({asked:.4g} confidence, {poses})"
    fix = f"kinacc check-results --against {accepted.folder.parent} lists what changed"
    return _found(FAILED if results.least > allowed else PASSED, says, fix, figures)


def _campaign(gate: Gate, dataset: str, tables: RunTables, tolerance: Mapping[str, Any]) -> Outcome:
    from kinacc.campaign.folder import open_
    from kinacc.report.summarise import summarise
    from kinacc.report.summary import BOUND

    place = Path(gate["campaign"])
    open_(place)  # raises where it cannot be used
    summary = summarise(tables.folder, campaigns=[place])
    status = summary.campaign
    if status is None:
        fix = f"begin one on it: kinacc campaign start FOLDER --calibration {tables.folder}"
        return _found(FAILED, "; ".join(summary.remarks), fix)
    allowed = tolerance["mm"] if gate["tolerance_mm"] is None else gate["tolerance_mm"]
    judged_as = summary.verdict(BOUND, allowed)
    assert judged_as is not None  # a tolerance is given
    known = status.of_all
    figures = {"tolerance_mm": allowed, "campaign": status.folder, "readings": status.readings}
    says = f"campaign {place}: {judged_as.verdict}, {judged_as.reason}"
    if np.isfinite(known.upper_mm):
        figures |= {name: getattr(known, name) for name in ("lower_mm", "confidence")}
        figures["bound_mm"] = known.upper_mm
        says += (
            f"; the largest error is at most {known.upper_mm:.3f} mm with "
            f"{known.confidence:.0%} confidence, {allowed:g} mm allowed"
        )
        asked = gate["confidence"]
        if asked is not None and known.confidence < asked - _ROUNDING:
            says = f"campaign {place} has {known.confidence:.0%} confidence, {asked:.0%} asked for"
            fix = "begin a campaign with that confidence, or ask for the campaign's"
            return _found(FAILED, says, fix, figures)
    says = "; ".join([says, *summary.remarks, *summary.doubts])
    verdict = {ACCEPT: PASSED, REJECT: FAILED}.get(judged_as.verdict, UNDECIDED)
    return _found(verdict, says, f"kinacc campaign status {place}", figures)


def _claims(gate: Gate, tables: RunTables) -> Outcome:
    table = tables["claims"].set_index("claim")
    excepted = gate["except"]
    unknown = [item for item in excepted if item not in table.index]
    if unknown:
        close = [near for item in unknown if (near := nearest(item, tuple(table.index)))]
        fix = f"did you mean {first_few(close)}?" if close else "kinacc show RESULTS claims"
        return _found(FAILED, f"except names no claim: {first_few(unknown)}", fix)
    # Sentences that chose a reading of the paper are no evidence.
    verdict = table["verdict"][~table["used_to_choose"].astype(bool)]
    known = verdict.index.isin(excepted)
    lists = {
        "differ, not excepted": verdict.index[(verdict == "differs") & ~known],
        "differ, excepted": verdict.index[(verdict == "differs") & known],
        "not comparable": verdict.index[~verdict.isin(["agrees", "differs"])],
        "excepted, though they agree": verdict.index[(verdict == "agrees") & known],
    }
    agree, (remaining, differ, *_) = int((verdict == "agrees").sum()), map(len, lists.values())
    says = [f"{agree} of {len(verdict)} claims agree"]
    says += [f"{text}: {first_few(list(names))}" for text, names in lists.items() if len(names)]
    figures = {"claims": len(verdict), "agree": agree, "differ": remaining + differ,
               "differ_not_excepted": remaining}  # fmt: skip
    fix = f"kinacc show {tables.folder} claims"
    return _found(FAILED if remaining else PASSED, "; ".join(says), fix, figures)


def _suspicions(gate: Gate, tables: RunTables) -> Outcome:
    measurements = tables["measurements"]
    if "row" not in measurements or measurements["row"].isna().all():
        return _found(PASSED, "simulated measurements: no file to check", "", {"suspicions": 0})
    table = tables["data_check"]
    table = table[(table["finding"] != LEFT_OUT) & (table["level"] != FINDING_LEVELS[-1])]
    known = table["accepted"].fillna("").astype(bool)
    remaining = table if gate["suspicions"] == "none" else table[~known]
    figures = {"suspicions": len(table), "accepted": int(known.sum())}
    says = f"{len(remaining)} suspicions" + (f", {known.sum()} accepted" if known.any() else "")
    if len(remaining):
        says += f": {first_few(list(remaining['finding'] + ': ' + remaining['what']), 3)}"
    fix = "correct the file, or give a reason in data_check.accept and set suspicions: known"
    return _found(FAILED if len(remaining) else PASSED, says, fix, figures)


def _history(gate: Gate, tables: RunTables) -> Outcome:
    table = tables["history"]
    columns = {name: table[name].to_numpy() for name in table}
    last = table.iloc[-1]
    figures = {name: float(last[name]) for name in ("moved_mm", "chance_mm", "beyond_mm")}
    figures |= {"probability": float(last["probability"]), "lines": len(table)}
    verdicts = {FIRST: PASSED, HOLDS: PASSED, RECALIBRATE: FAILED}
    verdict = verdicts.get(str(last["verdict"]), UNDECIDED)
    fix = "" if verdict == UNDECIDED else "calibrate the arm anew, or find out what moved"
    return _found(verdict, f"{last['series']}: {sentence(columns)}", fix, figures)

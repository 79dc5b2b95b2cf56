"""Thresholds of a configuration held to the tables of a run."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.assess.statement import ACCEPT, REJECT
from kinacc.config.values import did_you_mean
from kinacc.errors import InputError
from kinacc.gate import chance
from kinacc.gate.outcome import FAILED, PASSED, UNDECIDED, WARNED, Outcome
from kinacc.gate.values import Figure, RunTables, cell, figure, same_measurements
from kinacc.report.rendering import history_sentence, lines
from kinacc.tables.allowed import FINDING_LEVELS, FIRST, HOLDS, RECALIBRATE

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
                yield Outcome(name, gate["name"], gate["kind"], UNDECIDED, says)
            else:
                yield of_gate(gate, tables, full["tolerance"]["mm"], before)


def of_gate(
    gate: Gate, tables: RunTables, tolerance_mm: float | None, accepted: RunTables | None
) -> Outcome:
    """The outcome of one gate by the ``tables`` of a data set; a missing table is a failure."""
    kind, tolerated = gate["kind"], {"at_most": tolerance_mm}
    try:
        match kind:
            case "value":
                result = _limited(figure(tables, gate), gate["limit"] or tolerated)
            case "table":
                result = _limited(cell(tables, gate), gate["limit"])
            case "against":
                result = _against(gate, tables, accepted)
            case "campaign":
                result = _campaign(gate, tables, tolerance_mm)
            case "claims":
                result = _claims(gate, tables)
            case "suspicions":
                result = _suspicions(gate, tables)
            case _:
                result = _history(tables)
        facts = {**result.figures, **result.facts}
        says = "".join(lines("gate.txt", kind=kind, gate=gate, **facts))
    except InputError as error:
        first = error.problems[0]
        result, says = Found(FAILED, first.fix), f"{first.where} {first.what}"
    verdict, fix = result.verdict, result.fix
    if verdict == UNDECIDED:
        verdict = _MEANT[gate["undecided"]]
        fix = fix or "measure more poses, or set undecided: warn"
    if verdict == FAILED:
        verdict = _MEANT[gate["on_fail"]]
    fix = "" if verdict == PASSED else fix
    return Outcome(tables.folder.name, gate["name"], kind, verdict, says, fix, result.figures)


@dataclass(frozen=True)
class Found:
    """What a gate found: its verdict, a remedy, figures, and facts of which a template tells."""

    verdict: str
    fix: str = ""
    figures: Mapping[str, Any] = field(default_factory=dict)
    facts: Mapping[str, Any] = field(default_factory=dict)


def _limited(result: Figure, limits: Mapping[str, Any]) -> Found:
    """A figure held to its one limit."""
    ((key, limit),) = limits.items()
    word = "at_least" if key.startswith("at_least") else "at_most"
    held = result.size >= limit if word == "at_least" else result.size <= limit
    undecided = bool(result.open) and (held or np.isnan(result.size))
    verdict = UNDECIDED if undecided else PASSED if held else FAILED
    figures = {f"value{result.key}": result.size, f"{word}{result.key}": limit, **result.about}
    facts = {"figure": result, "limit": limit, "word": word, "undecided": undecided}
    return Found(verdict, "", figures, facts)


def _against(gate: Gate, tables: RunTables, accepted: RunTables | None) -> Found:
    if accepted is None or not accepted.folder.is_dir():
        fix = 'accept one: kinacc check-results RESULTS --accept FOLDER --reason ".."'
        return Found(FAILED, fix, facts={"no_run": tables.folder.name})
    (allowed,), confidence = gate["limit"].values(), gate["beyond_chance"]
    now, before = (figure(item, gate) for item in (tables, accepted))
    assert now.errors is not None  # the configuration takes figures of errors alone
    assert before.errors is not None
    paired = same_measurements(tables.folder, accepted.folder)
    statistic = gate["value"].rpartition(".")[2]
    results = chance.change(statistic, now.errors, before.errors, paired, confidence)
    figures = {
        f"value{now.key}": now.size,
        f"accepted{now.key}": before.size,
        f"worse_by{now.key}": results.difference,
        f"worse_by_at_least{now.key}": results.least,
        f"allowed{now.key}": allowed,
        "beyond_chance": confidence,
        "paired": int(paired),
        **now.about,
    }
    facts = {"now": now, "before": before, "allowed": allowed, "change": results}
    if results.open:
        return Found(UNDECIDED, "", figures, facts)
    fix = f"kinacc check-results --against {accepted.folder.parent} lists what changed"
    return Found(FAILED if results.least > allowed else PASSED, fix, figures, facts)


def _campaign(gate: Gate, tables: RunTables, tolerance_mm: float | None) -> Found:
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
        return Found(FAILED, fix, facts={"judged": None, "remarks": summary.remarks})
    bound = status.of_all
    figures = {
        "tolerance_mm": allowed,
        "campaign": status.folder,
        "readings": status.readings,
        "lower_mm": bound.lower_mm,
        "bound_mm": bound.upper_mm,
        "confidence": bound.confidence,
    }
    facts = {"judged": judged_as, "remarks": [*summary.remarks, *summary.doubts]}
    verdict = {ACCEPT: PASSED, REJECT: FAILED}.get(judged_as.verdict, UNDECIDED)
    if bound.confidence < (gate["confidence"] or 0.0) - 1e-9:
        verdict, facts["too_unsure"] = FAILED, True
    return Found(verdict, f"kinacc campaign status {place}", figures, facts)


def _claims(gate: Gate, tables: RunTables) -> Found:
    table = tables["claims"].set_index("claim")
    excepted, fix = gate["except"], f"kinacc show {tables.folder} claims"
    if unknown := [item for item in excepted if item not in table.index]:
        return Found(FAILED, did_you_mean(unknown[0], table.index) or fix, {}, {"unknown": unknown})
    # Sentences that chose a reading of the paper are no evidence.
    verdict = table["verdict"][~table["used_to_choose"].astype(bool)]
    state = verdict.mask(verdict.index.isin(excepted), verdict + ", though excepted")
    lists = {text: list(names) for text, names in state.index.groupby(state).items()}
    agree, remaining = int((verdict == "agrees").sum()), len(lists.get("differs", ()))
    figures = {"claims": len(verdict), "agree": agree, "differ": int((verdict == "differs").sum())}
    figures["differ_not_excepted"] = remaining
    return Found(FAILED if remaining else PASSED, fix, figures, {"lists": lists})


def _suspicions(gate: Gate, tables: RunTables) -> Found:
    measurements = tables["measurements"]
    if "row" not in measurements or measurements["row"].isna().all():
        return Found(PASSED, "", {"suspicions": 0})
    table = tables["data_check"]
    table = table[table["level"] != FINDING_LEVELS[-1]]
    known = table["accepted"].fillna("").astype(bool)
    remaining = table if gate["suspicions"] == "none" else table[~known]
    left = list(remaining["finding"] + ": " + remaining["what"])
    figures = {"suspicions": len(table), "accepted": int(known.sum())}
    fix = "correct the file, or give a reason in data_check.accept and set suspicions: known"
    return Found(FAILED if left else PASSED, fix, figures, {"left": left})


def _history(tables: RunTables) -> Found:
    table = tables["history"]
    last = table.iloc[-1]
    names = ("moved_mm", "chance_mm", "beyond_mm", "probability")
    figures = {name: float(last[name]) for name in names} | {"lines": len(table)}
    verdicts = {FIRST: PASSED, HOLDS: PASSED, RECALIBRATE: FAILED}
    verdict = verdicts.get(str(last["verdict"]), UNDECIDED)
    fix = "" if verdict == UNDECIDED else "calibrate the arm anew, or find out what moved"
    facts = {"says": f"{last['series']}: {history_sentence(table)}"}
    return Found(verdict, fix, figures, facts)

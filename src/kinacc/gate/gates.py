"""What became of every gate of a configuration: tables of a run in, outcomes out."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.assess.conformity import ACCEPT, REJECT
from kinacc.assess.conformity import UNDECIDED as OPEN
from kinacc.config.gate_rules import LIMITS, limit_key, limited
from kinacc.config.values import nearest
from kinacc.deployment.history_words import sentence
from kinacc.errors import InputError, first_few
from kinacc.gate.outcome import FAILED, PASSED, UNDECIDED, WARNED, Outcome
from kinacc.gate.run_tables import RunTables
from kinacc.gate.values import Compared, Figure, change_of, figure
from kinacc.tables.allowed import FINDING_LEVELS, LEFT_OUT
from kinacc.tables.history_tables import FIRST, HOLDS, RECALIBRATE

Gate = Mapping[str, Any]
_ROUNDING = 1e-9
_MORE = "measure more poses; undecided: warn says that what cannot be told fails nothing"
_DECIDED = {ACCEPT: PASSED, REJECT: FAILED, OPEN: UNDECIDED}
_OF_HISTORY = {FIRST: PASSED, HOLDS: PASSED, RECALIBRATE: FAILED}
# What a configuration calls a verdict, and the verdict.
_MEANT = {"fail": FAILED, "warn": WARNED, "pass": UNDECIDED}


def judged(
    results: Path,
    configurations: Mapping[str, Mapping[str, Any]],
    accepted: Path | None,
    broken: Collection[str] = (),
) -> tuple[Outcome, ...]:
    """The outcome of every gate of every data set, in the order of the configuration.

    ``configurations``: full settings by data set, whose results stand in folders of their names
    below ``results``, as those of the accepted run do below ``accepted`` (None without one). Gates
    of data sets that are ``broken``, whose results do not hold, are not looked at.
    """
    found = []
    for name, full in configurations.items():
        tables = RunTables(results / name)
        for gate in full["gates"]:
            if name in broken:
                says = "not looked at: the results do not hold"
                found.append(_outcome(gate, name, UNDECIDED, says, f"first mend results of {name}"))
            else:
                found.append(
                    of_gate(gate, name, tables, full["tolerance"], _beside(accepted, name))
                )
    return tuple(found)


def _beside(accepted: Path | None, dataset: str) -> RunTables | None:
    return None if accepted is None else RunTables(accepted / dataset)


def of_gate(
    gate: Gate,
    dataset: str,
    tables: RunTables,
    tolerance: Mapping[str, Any],
    accepted: RunTables | None,
) -> Outcome:
    """What became of one gate; a table that it needs and is not there is a failure."""
    try:
        found = _KINDS[gate["kind"]](gate, dataset, tables, tolerance, accepted)
    except InputError as error:
        first = error.problems[0]
        says = f"{first.where} {first.what}"
        found = _outcome(gate, dataset, FAILED, says, first.fix)
    verdict, fix = found.verdict, found.fix
    if verdict == UNDECIDED:
        verdict, fix = _MEANT[gate["undecided"]], fix or _MORE
    if verdict == FAILED:
        verdict = _MEANT[gate["on_fail"]]
    return replace(found, verdict=verdict, fix=fix)


def _outcome(
    gate: Gate,
    dataset: str,
    verdict: str,
    says: str,
    fix: str = "",
    figures: Mapping[str, Any] | None = None,
) -> Outcome:
    kind = "change" if gate["kind"] == "against" else gate["kind"]
    fix = "" if verdict == PASSED else fix
    return Outcome(dataset, gate["name"], kind, verdict, says, fix, figures or {})


def _value(
    gate: Gate, dataset: str, tables: RunTables, tolerance: Mapping[str, Any], _: object
) -> Outcome:
    word, limit, own = limited(gate, tolerance)
    found = figure(gate["value"], tables, gate)
    whose = "" if own else " by the tolerance of the configuration"
    asked = f"{word.replace('_', ' ')} {found.worded(limit)} is allowed{whose}"
    if word == LIMITS[1]:
        asked = f"at least {found.worded(limit)} is asked for"
    figures = {
        f"value{found.key}": found.size,
        f"{word}{found.key}": limit,
        "of": found.called,
        **found.about,
    }
    held = found.size <= limit if word == LIMITS[0] else found.size >= limit
    says = f"{found.called} is {found.worded(found.size)}; {asked}"
    if found.open and (held or found.size != found.size):
        says = f"undecided: {found.called} cannot be told: {found.open}; {asked}"
        return _outcome(gate, dataset, UNDECIDED, says, "", figures)
    fix = f"off by {found.worded(abs(found.size - limit))}"
    return _outcome(gate, dataset, PASSED if held else FAILED, says, fix, figures)


def _change(
    gate: Gate,
    dataset: str,
    tables: RunTables,
    _: Mapping[str, Any],
    accepted: RunTables | None,
) -> Outcome:
    if accepted is None or not accepted.folder.is_dir():
        says = f"there is no accepted run of {dataset} to hold it against"
        fix = 'accept one: kinacc check-results RESULTS --accept FOLDER --reason ".."'
        return _outcome(gate, dataset, FAILED, says, fix)
    now, before = figure(gate["value"], tables, gate), figure(gate["value"], accepted, gate)
    asked = gate["beyond_chance"]
    found = change_of(gate["value"], tables, accepted, gate, asked)
    allowed = gate[limit_key("allow", gate)]
    figures = {
        f"value{now.key}": now.size,
        f"accepted{now.key}": before.size,
        f"worse_by{now.key}": found.difference,
        f"worse_by_at_least{now.key}": found.least,
        f"allowed{now.key}": allowed,
        "beyond_chance": asked,
        "of": now.called,
        "paired": int(found.paired),
        "accepted_rows": before.about["rows"],
        **now.about,
    }
    worse = "worse" if found.difference >= 0.0 else "better"
    by = "as" if found.difference == 0.0 else f"{now.worded(abs(found.difference))} {worse} than"
    says = (
        f"{now.called} is {now.worded(now.size)}, {by} the accepted run's "
        f"{before.worded(before.size)}; {now.worded(allowed)} worse is allowed"
    )
    if found.open:
        return _outcome(gate, dataset, UNDECIDED, f"undecided: {says}; {found.open}", "", figures)
    if found.difference and found.least != found.difference:
        says += f"; with {100.0 * asked:g} % confidence {_at_least(now, found)}, {found.drawn}"
    failed = found.least > allowed
    fix = f"kinacc check-results --against {accepted.folder.parent} lists what changed"
    return _outcome(gate, dataset, FAILED if failed else PASSED, says, fix, figures)


def _at_least(now: Figure, found: Compared) -> str:
    if found.least > 0.0:
        return f"it is at least {now.worded(found.least)} worse"
    return f"it may as well be {now.worded(-found.least)} better"


def _campaign(
    gate: Gate, dataset: str, tables: RunTables, tolerance: Mapping[str, Any], _: object
) -> Outcome:
    from kinacc.campaign.folder import open_
    from kinacc.report.summary import BOUND, summarise

    place = Path(gate["campaign"])
    open_(place)  # says what is wrong with it
    summary = summarise(tables.folder, campaigns=[place])
    known = summary.largest_error
    if known is None:
        fix = f"begin one on it: kinacc campaign start FOLDER --calibration {tables.folder}"
        return _outcome(gate, dataset, FAILED, "; ".join(summary.remarks), fix)
    allowed = tolerance["mm"] if gate["tolerance_mm"] is None else gate["tolerance_mm"]
    judged_as = summary.verdict(BOUND, allowed)
    assert judged_as is not None  # a tolerance is given
    figures = {"tolerance_mm": allowed, "campaign": known.campaign, "readings": known.readings}
    says = f"campaign {place}: {judged_as.verdict}, {judged_as.reason}"
    fix = f"kinacc campaign status {place}"
    if np.isfinite(known.upper_mm):
        figures |= {name: getattr(known, name) for name in ("lower_mm", "confidence")}
        figures["bound_mm"] = known.upper_mm
        says += (
            f"; the largest error is at most {known.upper_mm:.3f} mm with "
            f"{known.confidence:.0%} confidence, {allowed:g} mm allowed"
        )
        if gate["confidence"] is not None and known.confidence < gate["confidence"] - _ROUNDING:
            says = (
                f"campaign {place} bounds with {known.confidence:.0%} confidence, and "
                f"{gate['confidence']:.0%} is asked for"
            )
            fix = "begin a campaign with that confidence, or ask for what this one has"
            return _outcome(gate, dataset, FAILED, says, fix, figures)
    says = "; ".join([says, *summary.remarks, *known.against])
    return _outcome(gate, dataset, _DECIDED[judged_as.verdict], says, fix, figures)


def _claims(gate: Gate, dataset: str, tables: RunTables, *_: object) -> Outcome:
    table = tables["claims"]
    # Sentences that chose a reading of the paper are no evidence.
    rows = zip(table["claim"], table["verdict"], table["used_to_choose"], strict=True)
    verdict = {str(claim): str(said) for claim, said, chose in rows if not chose}
    known = [str(each) for each in table["claim"]]
    excepted = gate["except"]
    unknown = [each for each in excepted if each not in known]
    if unknown:
        close = [near for each in unknown if (near := nearest(each, tuple(known)))]
        fix = f"did you mean {first_few(close)}?" if close else "kinacc show RESULTS claims has all"
        says = f"except names {first_few(unknown)}, which no claim is called"
        return _outcome(gate, dataset, FAILED, says, fix)
    differ = [each for each in verdict if verdict[each] == "differs"]
    left = [each for each in differ if each not in excepted]
    without = [each for each in verdict if verdict[each] not in ("agrees", "differs")]
    count = sum(each == "agrees" for each in verdict.values())
    says = f"{count} of {len(verdict)} claims agree"
    if left:
        says += f"; these differ and are not excepted: {first_few(left)}"
    if differ and not left:
        says += f"; those that differ are excepted: {first_few(differ)}"
    if without:
        says += f"; not comparable: {first_few(without)}"
    if agree := [each for each in excepted if verdict.get(each) == "agrees"]:
        says += f"; excepted, though they agree: {first_few(agree)}"
    figures = {"claims": len(verdict), "agree": count, "differ": len(differ)}
    figures |= {"differ_not_excepted": len(left)}
    fix = f"kinacc show {tables.folder} claims says what was found"
    return _outcome(gate, dataset, FAILED if left else PASSED, says, fix, figures)


def _suspicions(gate: Gate, dataset: str, tables: RunTables, *_: object) -> Outcome:
    rows = np.asarray(tables["measurements"].get("row", [np.nan]), dtype=float)
    if not np.isfinite(rows).any():
        says = "the measurements are of a synthetic arm: there is no file to suspect"
        return _outcome(gate, dataset, PASSED, says, figures={"suspicions": 0})
    table = tables["data_check"]
    found = [
        (str(kind), str(what), reason)
        for kind, level, what, reason in zip(
            *(table[each] for each in ("finding", "level", "what", "accepted")), strict=True
        )
        if kind != LEFT_OUT and level != FINDING_LEVELS[-1]
    ]
    known = [each for each in found if each[2]]
    left = found if gate["suspicions"] == "none" else [each for each in found if not each[2]]
    figures = {"suspicions": len(found), "accepted": len(known)}
    if not found:
        return _outcome(gate, dataset, PASSED, "the check found nothing suspicious", "", figures)
    told = first_few([f"{kind}: {what}" for kind, what, _ in left], 3)
    said = "suspicion" if len(left) == 1 else "suspicions"
    says = f"{len(left)} {said}: {told}" if left else f"{len(known)} suspicions, all accepted"
    fix = "mend the file, or say in data_check.accept why to go on"
    if known and left:
        fix += "; suspicions: known lets pass what is accepted there"
    return _outcome(gate, dataset, FAILED if left else PASSED, says, fix, figures)


def _history(gate: Gate, dataset: str, tables: RunTables, *_: object) -> Outcome:
    table = tables["history"]
    last = {name: values[-1] for name, values in table.items()}
    verdict = str(last["verdict"])
    numbers = ("moved_mm", "chance_mm", "beyond_mm", "probability")
    figures = {name: float(last[name]) for name in numbers} | {"lines": len(table["verdict"])}
    says = f"{last['series']}: {sentence(table)}"
    becomes = _OF_HISTORY.get(verdict, UNDECIDED)
    fix = "" if becomes == UNDECIDED else "calibrate the arm anew, or find out what moved"
    return _outcome(gate, dataset, becomes, says, fix, figures)


_KINDS = {
    "value": _value,
    "against": _change,
    "campaign": _campaign,
    "claims": _claims,
    "suspicions": _suspicions,
    "history": _history,
}

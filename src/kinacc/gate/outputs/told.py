"""Verdicts in the order and the words that every output has: failed first, grouped by cause."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import PurePath

from kinacc.errors import and_more, as_seen
from kinacc.gate.outcome import (
    FAILED,
    PASSED,
    UNDECIDED,
    UNEXPLAINED,
    WARNED,
    Cause,
    Difference,
    Outcome,
    Verdicts,
)

ORDER = (FAILED, UNDECIDED, WARNED, PASSED)
MOST_DIFFERENCES, MOST_PASSED = 8, 40
_LONGEST_VALUE = 80


def line(text: str) -> str:
    """Text from anywhere on one line that steers neither a terminal nor a build server.

    Servers take commands out of what is printed: ``::`` where a line begins, ``##[`` and ``##vso[``
    anywhere.
    """
    text = text.encode("utf-8", "backslashreplace").decode()  # names of files may be no characters
    text = as_seen(" ".join(text.split())).replace("::", ": :").replace("##", "# #")
    return "".join(each if each.isprintable() else "\ufffd" for each in text)


def ordered(outcomes: Iterable[Outcome]) -> list[Outcome]:
    """Failed first, then undecided, warned and passed; each in the order in which they came."""
    return sorted(outcomes, key=lambda each: ORDER.index(each.verdict))


def counts(verdicts: Verdicts) -> dict[str, int]:
    """How many outcomes have each verdict, none left out."""
    found = Counter(each.verdict for each in verdicts.outcomes)
    return {verdict: found[verdict] for verdict in ORDER}


def headline(verdicts: Verdicts) -> str:
    """All of it in one sentence."""
    found = counts(verdicts)
    total = len(verdicts.outcomes)
    told = ", ".join(f"{count} {verdict}" for verdict, count in found.items() if count)
    gates = f"{total} gate{'' if total == 1 else 's'}"
    return (
        f"{verdicts.results}: {FAILED if found[FAILED] else PASSED} ({told or 'none'} of {gates})"
    )


def title(outcome: Outcome) -> str:
    """Which gate of which data set."""
    return ", ".join(filter(None, [outcome.dataset, outcome.name]))


def said(outcome: Outcome) -> str:
    """What the gate says, for a place where the verdict stands before it."""
    return outcome.says.removeprefix(f"{outcome.verdict}: ")


def file_of(outcome: Outcome, verdicts: Verdicts) -> str:
    """The file to open: the outcome's own, else the first artefact that differs, else results."""
    if outcome.file or not outcome.differences:
        return outcome.file or verdicts.results
    first = outcome.differences[0]
    name = PurePath(first.artefact)
    ending = "" if name.suffix else ".parquet"
    return f"{verdicts.results}/{first.dataset}/{name}{ending}"


def cause_in_words(cause: Cause) -> str:
    """What changed, and from what to what."""
    if cause.kind == UNEXPLAINED:
        return f"unexplained: {cause.where}" if cause.where else "unexplained"
    was, now = _short(cause.before), _short(cause.after)
    change = f", {was} to {now}" if was and now else f", now {now}" if now else ""
    return f"{cause.kind} changed: {cause.where}{change}"


def difference_in_words(difference: Difference) -> str:
    """What differs, by how much, of how many rows."""
    where = ".".join(filter(None, [difference.artefact, difference.column]))
    told = f"{where}: {difference.what}"
    if difference.largest is not None:
        allowed = "" if difference.allowed is None else f" ({difference.allowed:g} allowed)"
        unit = "" if difference.unit == "1" else f" {difference.unit}".rstrip()
        told += f"; largest {difference.largest:.3g}{unit}{allowed}"
    if difference.rows:
        told += f"; {difference.rows} of {difference.of} rows"
        told += f", the first: {difference.first}" if difference.first else ""
    return told


def by_cause(differences: Sequence[Difference]) -> list[tuple[str, list[str]]]:
    """Differences under what explains them, unexplained first; at most a few of each."""
    groups: dict[tuple[Cause, ...], list[Difference]] = {}
    for each in differences:
        groups.setdefault(each.causes, []).append(each)
    told = []
    for causes, found in sorted(groups.items(), key=lambda each: each[1][0].explained):
        head = "; ".join(map(cause_in_words, causes))
        lines = [difference_in_words(each) for each in found[:MOST_DIFFERENCES]]
        if rest := and_more(len(found) - MOST_DIFFERENCES):
            lines.append(rest.strip())
        told.append((head or "unexplained: nothing that it was made from has changed", lines))
    return told


def _short(value: str) -> str:
    return value if len(value) <= _LONGEST_VALUE else f"{value[:_LONGEST_VALUE]} .."

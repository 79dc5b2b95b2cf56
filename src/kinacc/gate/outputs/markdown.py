"""What the gate says as Markdown: for a job's summary on GitHub, or a note on GitLab."""

from __future__ import annotations

import re
from collections.abc import Iterator

from kinacc.config.names import in_markdown
from kinacc.errors import as_seen
from kinacc.gate.outcome import PASSED, Outcome, Verdicts
from kinacc.gate.outputs import told

_MOST_CHARACTERS = 300_000  # GitHub takes 1 MiB, GitLab a million characters
_MENTION = re.compile(r"([@#!])(?=\w)")


def as_markdown(verdicts: Verdicts) -> str:
    """A table of gates, differences by cause, and the first screen of every data set's report."""
    lines = [f"## kinacc gate: {_text(told.headline(verdicts))}", "", *_table(verdicts)]
    differing = [each for each in told.ordered(verdicts.outcomes) if each.differences]
    if differing:
        lines += ["### Differences from the accepted run", ""]
        for each in differing:
            lines += [*_differences(each), ""]
    if verdicts.digest:
        lines += [f"Digest of all records: `{verdicts.digest}`", ""]
    size, left_out = sum(map(len, lines)), []
    for dataset, screen in verdicts.first_screens.items():
        block = _folded(dataset, screen, len(verdicts.first_screens) == 1)
        size += sum(map(len, block))
        if size > _MOST_CHARACTERS:
            left_out.append(dataset)
        else:
            lines += block
    if left_out:
        lines.append(f"First screens of {len(left_out)} more data sets are too long for a summary.")
    return "\n".join(lines).rstrip("\n") + "\n"


def _table(verdicts: Verdicts) -> Iterator[str]:
    yield "| verdict | data set | gate | what was found |"
    yield "|---|---|---|---|"
    passed = 0
    for each in told.ordered(verdicts.outcomes):
        passed += each.verdict == PASSED
        if passed > told.MOST_PASSED:
            continue
        verdict = each.verdict if each.verdict == PASSED else f"**{each.verdict}**"
        said = _text(told.said(each))
        if each.fix and each.verdict != PASSED:
            said += f"<br>What to do: {_text(each.fix)}"
        yield f"| {verdict} | {_text(each.dataset)} | {_text(each.name)} | {said} |"
    if passed > told.MOST_PASSED:
        yield f"| {PASSED} | | | and {passed - told.MOST_PASSED} more |"
    yield ""


def _differences(outcome: Outcome) -> Iterator[str]:
    for cause, differences in told.by_cause(outcome.differences):
        yield f"- {_text(told.title(outcome))}: **{_text(cause)}**"
        yield from (f"  - {_text(each)}" for each in differences)


def _folded(dataset: str, screen: str, is_open: bool) -> list[str]:
    """Plain text as it is, between fences longer than any in it."""
    fence = "`" * max(3, 1 + max(map(len, re.findall("`+", screen)), default=0))
    text = as_seen(screen).replace("\t", " ").replace("##", "# #").replace("::", ": :")
    return [
        f"<details{' open' if is_open else ''}>",
        f"<summary>{_html(dataset)}: what its report says first</summary>",
        "",
        f"{fence}text",
        *text.splitlines(),
        fence,
        "",
        "</details>",
        "",
    ]


def _text(text: str) -> str:
    """Text that is shown as it is, in a cell, and that tells nobody that they were mentioned."""
    return _MENTION.sub("\\1\u2060", in_markdown(told.line(text)))


def _html(text: str) -> str:
    return _MENTION.sub("\\1\u2060", told.line(text)).replace("&", "&amp;").replace("<", "&lt;")

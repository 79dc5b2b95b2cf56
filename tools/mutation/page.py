"""What was found, row by row, and the page about it: docs/mutants.md."""

from __future__ import annotations

import csv
import math
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

from mutation.places import ROOMS, ROOT, SEED, room_of

RESULTS = ROOT / "tests" / "mutation" / "results.csv"
EQUIVALENT = ROOT / "tests" / "mutation" / "equivalent.csv"
TARGET = ROOT / "docs" / "mutants.md"
NAMED = ("module", "function", "text", "nth", "at", "operator", "before", "after")
WANTED = 1000
SURVIVED = "survived"
BEGUN = """ So far {count} of {wanted} were tried; lines of modules with compiled kernels,
which take longest, come last."""
COLUMNS = (*NAMED, "verdict", "by", "first")
Rows = Mapping[tuple, Mapping[str, str]]
PAGE = """\
# Do the tests notice faults?

<!-- Written by `python tools/mutate.py page` from tests/mutation/*.csv. -->

A fault is planted in one line of kinacc: `<` becomes `<=`, a sign is lost, two arguments change
places. The tests that reach the line are run; if none fails, nobody would have noticed. This is
done for lines drawn by seed {seed} from all lines of the rooms below that can have a fault, one
fault a line.{progress}

**{killed} of {count} faults are noticed: {share:.1f} %.** {equivalent} of the {survived} others
change nothing that a user could see, as the reasons below say one by one; without them it is
**{without:.1f} %**. The remaining {open} are listed too.

Tests were added where faults had shown holes, so these lines are now better held than others are.
When they were first tried, with quick tests alone, {first} of {count} were noticed: {begun:.1f} %,
with 95 % confidence {low:.1f} to {high:.1f} % of all such lines, those without effect among them.

## How it is done

<!-- not run: takes an hour and more -->
```sh
python tools/mutate.py cover      # which test reaches which line
python tools/mutate.py run 1000   # faults in their fixed order; goes on where it was stopped
python tools/mutate.py again      # survivors, now with every test that reaches them
python tools/mutate.py page       # this page
```

- Only tests of behaviour count. Tests that hold code to its hash, bytes to bytes or pages to
  their sources are not run, nor are linters; those that start other processes notice nothing, as
  a fault exists in the memory of one process alone.
- Compiled kernels are compiled anew with their fault; what numba kept is not used for them.
- A fault is noticed when a test fails, when a test ends in a crash ({crashes}), or when tests take
  longer than twice their time and 15 s ({timeouts}).
- Messages, annotations and decorators get no faults.

| room | faults | noticed | without effect | share of the rest |
|---|---:|---:|---:|---:|
{rooms}

| kind of fault | faults | noticed | without effect | share of the rest |
|---|---:|---:|---:|---:|
{operators}

## Faults that change nothing

{equal}
## Faults that no test notices

{left}"""


def read(path: Path = RESULTS) -> dict[tuple, dict[str, str]]:
    """Verdicts so far, by what names a fault; of several of one fault the last."""
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        return {tuple(row[name] for name in NAMED): row for row in csv.DictReader(file)}


def append(row: Mapping[str, str], path: Path = RESULTS) -> None:
    """One verdict more."""
    new = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        if new:
            writer.writeheader()
        writer.writerow(row)


def keep(names: Iterable[tuple], path: Path = RESULTS) -> None:
    """Write the verdicts again in the order of ``names``; what is not among them goes."""
    rows = read(path)
    path.unlink()
    for name in names:
        if name in rows:
            append(rows[name], path)


def equivalents() -> dict[tuple, str]:
    """Faults that change nothing a user can see, with the reason."""
    if not EQUIVALENT.exists():
        return {}
    with EQUIVALENT.open(newline="") as file:
        return {tuple(row[name] for name in NAMED): row["reason"] for row in csv.DictReader(file)}


def interval(hits: int, count: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share, in per cent."""
    z, share = 1.959964, hits / count
    middle = (share + z * z / (2 * count)) / (1 + z * z / count)
    half = z * math.sqrt(share * (1 - share) / count + (z / (2 * count)) ** 2) / (1 + z * z / count)
    return 100 * (middle - half), 100 * (middle + half)


def page(rows: Rows, reasons: Mapping[tuple, str]) -> str:
    """The page's text."""
    equal = {name: reasons[name] for name in rows if survived(rows[name]) and name in reasons}
    left = [name for name in rows if survived(rows[name]) and name not in reasons]
    killed = len(rows) - len(equal) - len(left)
    first = sum(row["first"] != SURVIVED for row in rows.values())
    low, high = interval(first, len(rows))
    verdicts = Counter(row["verdict"] for row in rows.values())
    return PAGE.format(
        count=len(rows),
        progress="" if len(rows) >= WANTED else BEGUN.format(count=len(rows), wanted=WANTED),
        seed=SEED,
        killed=killed,
        share=100 * killed / len(rows),
        first=first,
        begun=100 * first / len(rows),
        low=low,
        high=high,
        survived=len(equal) + len(left),
        equivalent=len(equal),
        open=len(left),
        without=100 * killed / (len(rows) - len(equal)),
        crashes=verdicts["crash"],
        timeouts=verdicts["timeout"],
        rooms=_shares(rows, equal, {name: room_of(name[0]) for name in rows}, list(ROOMS)),
        operators=_shares(rows, equal, {name: name[5] for name in rows}),
        equal="".join(f"{_line(name)}\n  {reason}\n" for name, reason in equal.items()),
        left="".join(f"{_line(name)}\n" for name in left),
    )


def survived(row: Mapping[str, str]) -> bool:
    """Whether no test noticed the fault."""
    return row["verdict"] == SURVIVED


def _shares(rows: Rows, equal: Mapping, kinds: Mapping[tuple, str], order: list | None = None):
    lines = []
    for kind in order or sorted(set(kinds.values())):
        own = [name for name in rows if kinds[name] == kind]
        if not own:
            continue
        killed = sum(not survived(rows[name]) for name in own)
        same = sum(name in equal for name in own)
        share = f"{100 * killed / (len(own) - same):.0f} %" if len(own) > same else ""
        lines.append(f"| {kind} | {len(own)} | {killed} | {same} | {share} |")
    return "\n".join(lines)


def _line(name: tuple) -> str:
    """One fault as a line of a list."""
    module, function, text, _, _, _, before, after = name
    place = module.removeprefix("kinacc.") + (f", {function}" if function else "")
    where = "" if before == text else f" in {_code(text)}"
    return f"- {place}: {_code(before)} becomes {_code(after)}{where}"


def _code(words: str) -> str:
    """Source between as many backticks as it needs."""
    return f"`` {words} ``" if "`" in words else f"`{words}`"

"""Do the tests notice faults? Plants them one at a time and runs the tests that reach them.

    python tools/mutate.py cover       which test reaches which lines; once, some minutes
    python tools/mutate.py run 1000    the first 1,000 faults; goes on where it stopped
    python tools/mutate.py again       survivors once more, with every test that reaches them
    python tools/mutate.py show TEXT   faults with verdicts whose line or function has the text
    python tools/mutate.py confirm     tests that noticed a fault, run alone on sound code
    python tools/mutate.py page        docs/mutants.md, from tests/mutation/
    python tools/mutate.py try MODULE --tests "FILE .." --count 5
                                       some faults of one module against some tests, nothing kept

Results go to tests/mutation/results.csv row by row. Rows whose line has been edited since count no
longer: `run` tries what stands there now.
"""

from __future__ import annotations

import argparse
import os
import pickle
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from mutation import page, reach, trial
from mutation.places import ROOT, Mutant, path_of, room_of, sequence

REACH = ROOT / ".cache" / "mutation" / "reach.pickle"
# Seconds of tests, under the tracer, that one process runs: at first, then, at last. Kernels are
# compiled anew in each, so they have one process for all.
BATCHES_S = (4.0, 16.0)
COMPILED_S = (12.0,)
EVERY_S = 30.0


def batches(
    mutant: Mutant, selection: reach.Selection, sizes: tuple[float, ...]
) -> list[tuple[list[str], float]]:
    """Tests in the order they are tried, (tests, seconds) for each process; too slow ones not."""
    rows = selection.ordered(selection.tests(mutant), mutant)
    found: list[tuple[list[str], float]] = []
    for size in sizes:
        tests: list[str] = []
        spent = 0.0
        while rows and (spent + rows[0][2] <= size or not tests):
            _, own, seconds = rows.pop(0)
            if seconds > size:
                own, seconds = shortened(own, size, selection)
            tests += own
            spent += seconds
        if tests:
            found.append((tests, spent))
    return found


def shortened(tests: list[str], size: float, selection: reach.Selection) -> tuple[list[str], float]:
    """The quick ones of a file's tests, as many as fit; at least one."""
    kept: list[str] = []
    spent = 0.0
    for test in tests:
        cost = selection.reach.seconds[test]
        cost += sum(selection.reach.set_ups[name] for name in selection.reach.shared[test])
        if kept and spent + selection.reach.seconds[test] > size:
            break
        spent += selection.reach.seconds[test] if kept else cost
        kept.append(test)
    return kept, spent


def judge(
    mutant: Mutant, selection: reach.Selection, every: bool = False, log: Path | None = None
) -> dict[str, str]:
    """The row of one fault; with ``every`` slow tests get their turn too."""
    verdict, by = "survived", "no test reaches it"
    compiles = compiled(mutant)
    sizes = COMPILED_S if compiles else BATCHES_S
    for tests, seconds in batches(mutant, selection, (*sizes, EVERY_S) if every else sizes):
        verdict, by = trial.attempt(mutant, tests, trial.limit(seconds, compiles), log)
        if verdict != "survived":
            break
    return dict(zip(page.COLUMNS, (*mutant.name, verdict, by, verdict), strict=True))


def compiled(mutant: Mutant) -> bool:
    """Whether its module has kernels, which every trial of it compiles anew: some ten seconds."""
    return any(word in path_of(mutant.module).read_text() for word in ("@compiled", "@njit"))


def run(arguments: argparse.Namespace, selection: reach.Selection) -> None:
    """Judge what has no verdict yet; those of compiled kernels last, as they take longest."""
    done = page.read()
    wanted = [each for each in sequence()[: arguments.count] if each.name not in done]
    if arguments.room:
        wanted = [each for each in wanted if room_of(each.module) == arguments.room]
    wanted.sort(key=compiled)
    print(f"{arguments.count - len(wanted)} done, {len(wanted)} to go", flush=True)
    for mutant in wanted:
        if arguments.until and time.strftime("%H:%M") >= arguments.until:
            break
        began = trial.now()
        row = judge(mutant, selection)
        page.append(row)
        told(mutant, row, trial.now() - began)


def again(arguments: argparse.Namespace, selection: reach.Selection) -> None:
    """Judge survivors of the first faults once more, with every test that reaches them."""
    done, known = page.read(), page.equivalents()
    for mutant in sequence()[: arguments.count]:
        row = done.get(mutant.name)
        if arguments.room and room_of(mutant.module) != arguments.room:
            continue
        if row is None or row["verdict"] != "survived" or mutant.name in known:
            continue
        began = trial.now()
        row = judge(mutant, selection, every=True) | {"first": row["first"]}
        if row["verdict"] != "survived":
            page.append(row)
        told(mutant, row, trial.now() - began)


def confirm(arguments: argparse.Namespace, selection: reach.Selection) -> None:
    """Tests that noticed a fault must not fail without one, run as they were, without others."""
    seconds = selection.reach.seconds
    by = {row["by"] for row in page.read().values() if row["by"] in seconds}
    tests = sorted(by)
    for begin in range(0, len(tests), 30):
        part = tests[begin : begin + 30]
        verdict, failed = trial.attempt(None, part, trial.limit(300.0, True))
        print(f"{len(part)} tests: {'sound' if verdict == 'survived' else verdict} {failed}")


def told(mutant: Mutant, row: dict[str, str], seconds: float) -> None:
    """One line about one fault."""
    place = f"{path_of(mutant.module).relative_to(ROOT)}:{mutant.line}"
    print(f"{row['verdict']:9}{seconds:6.1f} s  {place}  {mutant.before}  ->  {mutant.after}"
          f"   {row['by']}", flush=True)  # fmt: skip


def show(arguments: argparse.Namespace) -> None:
    """Faults of the sequence, with verdicts, whose module, function or line holds a text."""
    done = page.read()
    for mutant in sequence()[: arguments.count]:
        row = done.get(mutant.name)
        if row is not None and any(
            arguments.text in word for word in (*mutant.name, row["verdict"])
        ):
            told(mutant, row, 0.0)


def paged(arguments: argparse.Namespace) -> None:
    """Bring the verdicts into their order, without what is no longer in the source; the page."""
    page.keep(mutant.name for mutant in sequence()[: arguments.count])
    page.TARGET.write_text(page.page(page.read(), page.equivalents()))


def try_(arguments: argparse.Namespace) -> None:
    """Some faults of one module against some tests."""
    with tempfile.TemporaryDirectory(prefix="kinacc-mutants-") as folder:
        target = Path(folder) / "reach.pickle"
        command = [sys.executable, __file__, "cover", "--reach", str(target)]
        subprocess.run([*command, "--tests", arguments.tests], check=True, stdout=subprocess.PIPE)
        kept = pickle.loads(target.read_bytes())
    trial.load(kept.others)
    selection = reach.Selection(kept)
    for mutant in sequence(within=(arguments.text,))[: arguments.count]:
        began = trial.now()
        told(mutant, judge(mutant, selection), trial.now() - began)


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("what", choices=("cover", "run", "again", "confirm", "show", "try", "page"))
    parser.add_argument("text", nargs="?", default="")
    parser.add_argument("--tests", default="", help="files or folders below tests/, one text")
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--room", default="")
    parser.add_argument("--until", default="", help="clock time to stop at, HH:MM")
    parser.add_argument("--reach", type=Path, default=REACH)
    arguments = parser.parse_args()
    if arguments.what == "run" and arguments.text:
        arguments.count = int(arguments.text)
    os.chdir(ROOT)
    if arguments.what == "cover":
        found = reach.measure(arguments.reach, tuple(arguments.tests.split()) or reach.TESTS)
        print(f"{len(found.lines)} tests; failed: {found.failed or 'none'}")
    elif arguments.what in ("page", "show", "try"):
        {"page": paged, "show": show, "try": try_}[arguments.what](arguments)
    else:
        kept = pickle.loads(arguments.reach.read_bytes())
        trial.load(kept.others)
        {"run": run, "again": again, "confirm": confirm}[arguments.what](
            arguments, reach.Selection(kept)
        )


if __name__ == "__main__":
    main()

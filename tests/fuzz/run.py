"""Fuzz what reads files: ``python tests/fuzz/run.py --inputs 100000``, or ``--minutes 60``.

Every input is made from a target's name, a seed and a number, and can be made again from them.
Findings are written to ``tests/fuzz/found`` as texts that ``findings/`` keeps and a test reads.
Exit code 1 where there is one.
"""

from __future__ import annotations

import argparse
import json
import os
import selectors
import signal
import subprocess
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1] / "src"), str(HERE.parent), str(HERE.parents[1] / "tools")]

FINDINGS = ("crash", "hang", "memory", "wrote")
_SILENT_S = 600  # of a worker; an input has 5 s of processor time
_BATCH, _SLICES = 25_000, 20


@dataclass
class Tally:
    """What came of the inputs of a target."""

    outcomes: Counter = field(default_factory=Counter)
    parsed: int = 0
    seconds: float = 0.0
    slowest: float = 0.0

    def add(self, said: dict) -> None:
        """Count what came of an input."""
        self.outcomes[said["outcome"]] += 1
        self.parsed += said["parsed"]
        self.seconds += said["seconds"]
        self.slowest = max(self.slowest, said["seconds"])

    @property
    def inputs(self) -> int:
        """How many there were."""
        return sum(self.outcomes.values())


@dataclass(frozen=True)
class Finding:
    """An input that a reader fell over."""

    target: str
    seed: int
    number: int
    outcome: str
    where: str

    @property
    def kind(self) -> str:
        """Findings of a kind are one fault."""
        return f"{self.target}: {self.outcome} {self.where.split(':')[0]}"


def outcomes(
    work: list[list], bug: str = "", coverage: str = ""
) -> Iterator[tuple[tuple[str, int, int], dict]]:
    """What came of each input of a plan of work; a worker that dies or is silent is begun anew."""
    work = [list(each) for each in work]
    while work:
        env = {
            **os.environ,
            "OPENBLAS_NUM_THREADS": "1",
            "OMP_NUM_THREADS": "1",
            "OMP_THREAD_LIMIT": "1",
        }
        with subprocess.Popen(
            [sys.executable, str(HERE / "worker.py")],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            text=True, env=env,
        ) as worker:  # fmt: skip
            try:
                plan = {"work": work, "bug": bug, "coverage": coverage}
                worker.stdin.write(json.dumps(plan) + "\n")
                worker.stdin.flush()
                current, done = None, False
                for line in _lines(worker):
                    said = json.loads(line)
                    if "done" in said:
                        done = True
                    elif "begins" in said:
                        current = tuple(said["begins"])
                    else:
                        yield current, said
                        work = _after(work, current)
                        current = None
            finally:
                if not coverage:  # which is written at the end
                    worker.kill()
            if done:
                return
            if current is None:
                raise SystemExit(f"the worker ended early:\n{worker.stderr.read()[-3000:]}")
        yield current, {"outcome": "crash", "where": "the process ended", "seconds": 0, "parsed": 1}
        work = _after(work, current)


def _lines(worker: subprocess.Popen) -> Iterator[str]:
    """Lines of a worker until it ends or says nothing for too long."""
    with selectors.DefaultSelector() as selector:
        os.set_blocking(worker.stdout.fileno(), False)
        selector.register(worker.stdout, selectors.EVENT_READ)
        held = b""
        while True:
            if not selector.select(_SILENT_S):
                return
            more = os.read(worker.stdout.fileno(), 1 << 16)
            if not more:
                return
            *whole, held = (held + more).split(b"\n")
            yield from (line.decode() for line in whole if line)


def _after(work: list[list], done: tuple[str, int, int]) -> list[list]:
    name, seed, number = done
    left = []
    for each in work:
        if each[0] == name and each[1] == seed and each[2] <= number < each[3]:
            if number + 1 < each[3]:
                left.append([name, seed, number + 1, each[3]])
        else:
            left.append(each)
    return left


def shares(names: list[str], inputs: int) -> dict[str, int]:
    """Inputs of each target, which has one at least where there are a thousand."""
    from fuzz.targets import TARGETS

    total = sum(TARGETS[name].share for name in names)
    counts = {name: round(inputs * TARGETS[name].share / total) for name in names}
    return {name: count or int(inputs >= 1000) for name, count in counts.items()}


def keep(finding: Finding, folder: Path) -> Path:
    """Write the input of a finding as a text to keep."""
    from fuzz.seeds import without_what_is_beside
    from fuzz.targets import TARGETS

    case = TARGETS[finding.target].case(finding.target, finding.seed, finding.number)
    case = without_what_is_beside(case)
    name = f"{finding.target}-{finding.seed}-{finding.number}.json".replace(" ", "_")
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_text(case.to_json(finding.target, f"{finding.outcome}: {finding.where}"))
    return path


def fuzz(
    names: list[str], inputs: int, seed: int, until: float, coverage: str, first: int = 0
) -> tuple[dict[str, Tally], list[Finding]]:
    """Go through inputs, all targets by turns, until the number or the time is reached, or Ctrl-C.

    Each batch has a process of its own.
    """
    tallies: dict[str, Tally] = defaultdict(Tally)
    found: list[Finding] = []
    kinds: Counter = Counter()
    counts = shares(names, inputs)
    batches = max(1, -(-inputs // _BATCH))
    steps = [Fraction(step, batches * _SLICES) for step in range(batches * _SLICES + 1)]
    with suppress(KeyboardInterrupt):
        for batch in range(batches):
            work = [
                [name, seed, first + int(count * begin), first + int(count * end)]
                for begin, end in pairwise(steps[batch * _SLICES : (batch + 1) * _SLICES + 1])
                for name, count in counts.items()
                if int(count * end) > int(count * begin)
            ]
            for (name, _, number), said in outcomes(work, coverage=coverage):
                tally = tallies[name]
                tally.add(said)
                if said["outcome"] in FINDINGS:
                    finding = Finding(name, seed, number, said["outcome"], said["where"])
                    found.append(finding)
                    kinds[finding.kind] += 1
                    if kinds[finding.kind] <= 3:
                        print(f"{keep(finding, HERE / 'found')}: {finding.where}", flush=True)
                if time.time() > until:
                    return tallies, found
    return tallies, found


def table(tallies: dict[str, Tally]) -> str:
    """What came of the inputs, target by target."""
    lines = [
        f"{'target':28s} {'inputs':>7s} {'accepted':>9s} {'refused':>8s} {'parsed':>7s} "
        f"{'findings':>9s} {'slowest':>9s} {'mean':>8s}"
    ]
    total = Tally()
    for name, each in [*tallies.items(), ("all", total)]:
        if each is not total:
            total.outcomes += each.outcomes
            total.parsed += each.parsed
            total.seconds += each.seconds
            total.slowest = max(total.slowest, each.slowest)
        count = max(each.inputs, 1)
        findings = sum(each.outcomes[kind] for kind in FINDINGS)
        lines.append(
            f"{name:28s} {each.inputs:7d} {each.outcomes['accepted']:9d} "
            f"{each.outcomes['refused']:8d} {100 * each.parsed / count:6.1f}% {findings:9d} "
            f"{each.slowest:7.2f} s {1e3 * each.seconds / count:5.1f} ms"
        )
    return "\n".join(lines)


def replay(path: Path) -> None:
    """Read a kept input in this process, so that what it raises is seen whole."""
    import tempfile

    from fuzz.case import Case
    from fuzz.seeds import with_what_is_beside
    from fuzz.targets import TARGETS

    target, case = Case.of_json(path.read_text())
    case = with_what_is_beside(case)
    with tempfile.TemporaryDirectory() as folder:
        case.write(Path(folder))
        os.chdir(folder)
        TARGETS[target].read(Path(folder), case.options)
        os.chdir("/")


def main() -> None:
    """The command line."""
    from fuzz.targets import TARGETS

    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument(
        "--inputs", type=int, default=0, help="how many [100000 where no time is given]"
    )
    parser.add_argument("--minutes", type=float, default=0.0, help="for how long")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--first", type=int, default=0, help="number of the first input of each target"
    )
    parser.add_argument("--target", action="append", choices=list(TARGETS), help="only this one")
    parser.add_argument(
        "--coverage", default="", metavar="FILE", help="write coverage data (needs coverage.py)"
    )
    parser.add_argument("--replay", metavar="FILE", help="read a kept input, without limits")
    parser.add_argument(
        "--bugs",
        action="store_true",
        help="put faults of the past back, one by one, and look for them",
    )
    parser.add_argument("--bug", action="append", default=[], help="only this one of --bugs")
    given = parser.parse_args()
    if given.replay:
        replay(Path(given.replay))
        return
    if given.bugs or given.bug:
        from fuzz import bugs

        raise SystemExit(bugs.hunt(given.inputs or 3000, given.seed, given.bug))
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    until = time.time() + 60 * given.minutes if given.minutes else float("inf")
    inputs = given.inputs or (100_000_000 if given.minutes else 100_000)
    tallies, found = fuzz(
        given.target or list(TARGETS), inputs, given.seed, until, given.coverage, given.first
    )
    print(table(tallies))
    for kind, count in Counter(each.kind for each in found).most_common():
        print(f"{count:5d} {kind}")
    raise SystemExit(1 if found else 0)


if __name__ == "__main__":
    main()

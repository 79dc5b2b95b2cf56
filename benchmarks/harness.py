"""Measure kinacc beside what one would have used otherwise: interleaved, after all have agreed.

A topic is a file ``benchmarks/works/<topic>.py`` with ``works(smoke) -> list[Work]``; ``smoke``
asks for sizes that take moments. Its docstring says the question and works out the physical
limit of each work.

What holds for every work:

- contenders take turns, one sample each in every round, and begin one place further on each
  round; a ratio is the median of the rounds' own ratios, so that what slows the machine slows
  all alike
- outputs are compared before anything is timed (``Work.agree``); that run is the warm-up as
  well, and compiles what is compiled
- the garbage collector is off during a sample, BLAS has one thread (``ONE_THREAD``)
- CPU time is what counts, of this process and of processes it has waited for; a work about
  threads asks for the wall clock (``Work.clock``). Both are in the results
- a work with ``Work.today`` is run by the kinacc of a named commit as well. Then both kinaccs
  run in a process of their own each, started alike, and take their turns among the other
  contenders
"""

from __future__ import annotations

import gc
import os
import pickle
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

ROOT = Path(__file__).resolve().parents[1]
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP", "MKL")}
SAMPLE_S = 0.02  # a sample repeats its run until it takes about this long
ROUNDS = (3, 25)  # fewest and most
TODAY = "today"
LIMIT = "limit"


@dataclass(frozen=True)
class Contender:
    """One way to do a work: ``run`` gives the outputs all others give, all preallocated or none.

    The kinacc of a work with ``today`` needs no ``run``: it is what ``today`` makes.
    """

    name: str
    version: str
    run: Callable[[], object] | None = None


@dataclass(frozen=True)
class Work:
    """A work and those who do it; ``contenders[0]`` is kinacc.

    ``count`` is the number of ``unit`` (poses, solutions, fits) in one run. ``agree`` gets the
    outputs of all contenders in their order, the one of ``today`` last, and raises where they
    differ. ``wanted`` says by the name of a contender how many times faster than it kinacc has
    to be: 8 for an eighth of its time, 1/3.5 for at most 3.5 of its time. Besides contenders it
    may name ``today`` and ``limit``, which is ``limit_ns`` a unit. A name without contender is
    a competitor that is not installed.

    ``today`` makes the run of kinacc by whichever kinacc is imported: a function of the topic's
    own module, called as ``today(smoke)``. The module is then imported with the kinacc of an
    older commit too, so what that one lacks is imported inside functions; outputs are pickled,
    so they are arrays and numbers, not records of kinacc. kinacc's row is then timed in a
    process like today's.
    """

    name: str
    unit: str
    count: int
    contenders: tuple[Contender, ...]
    agree: Callable[[Sequence[object]], None]
    wanted: Mapping[str, float] = field(default_factory=dict)
    limit_ns: float | None = None
    limit: str = ""
    today: Callable[[bool], Callable[[], object]] | None = None
    clock: Literal["cpu", "wall"] = "cpu"
    seconds: float = 6.0  # rounds go on for about this long, within ROUNDS


@dataclass(frozen=True)
class Sample:
    """Time of one run, in nanoseconds."""

    wall_ns: float
    cpu_ns: float


@dataclass(frozen=True)
class Result:
    """A contender's row: times in nanoseconds a unit, medians over rounds with quartiles.

    ``ratio`` is its time over kinacc's. Where it was left out, ``left_out`` says why and
    numbers are None.
    """

    work: str
    unit: str
    count: int
    contender: str
    version: str
    clock: str
    rounds: int | None = None
    runs_in_a_round: int | None = None
    warm_up_runs: int | None = None
    ns: float | None = None
    ns_low: float | None = None
    ns_high: float | None = None
    wall_ns: float | None = None
    cpu_ns: float | None = None
    ratio: float | None = None
    ratio_low: float | None = None
    ratio_high: float | None = None
    wanted: float | None = None
    met: bool | None = None
    limit: str = ""
    left_out: str = ""


def timed(run: Callable[[], object], times: int = 1) -> Sample:
    """Mean time of a run among so many in a row."""
    gc.collect()
    gc.disable()
    try:
        cpu, wall = _cpu_ns(), time.perf_counter_ns()
        for _ in range(times):
            run()
        return Sample((time.perf_counter_ns() - wall) / times, (_cpu_ns() - cpu) / times)
    finally:
        gc.enable()


def _cpu_ns() -> float:
    """CPU time of this process and of the processes it has waited for."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time_ns() + 1e9 * (children.ru_utime + children.ru_stime)


class _Here:
    """A contender in this process."""

    def __init__(self, name: str, version: str, run: Callable[[], object]):
        self.name, self.version, self._run = name, version, run

    def output(self) -> object:
        return self._run()

    def sample(self, times: int) -> Sample:
        return timed(self._run, times)


class Elsewhere:
    """kinacc of one tree in a process of its own, as ``worker.py`` answers for it.

    It goes from work to work of a topic, so that what they share is prepared once.
    """

    def __init__(self, name: str, version: str, tree: Path):
        self.name, self.version = name, version
        answers, other_end = os.pipe()
        environment = {**os.environ, **ONE_THREAD, "PYTHONPATH": str(tree / "src")}
        self._process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("worker.py")), str(other_end)],
            stdin=subprocess.PIPE, stdout=sys.stderr, pass_fds=[other_end],
            env=environment, cwd=tree,
        )  # fmt: skip
        os.close(other_end)
        self._answers = os.fdopen(answers, "rb")

    def _ask(self, *question: object) -> object:
        try:
            pickle.dump(question, self._process.stdin)
            self._process.stdin.flush()
            well, answer = pickle.load(self._answers)
        except (EOFError, BrokenPipeError):
            raise RuntimeError(f"the process of {self.name} {self.version} ended") from None
        if not well:
            raise RuntimeError(f"{self.name} {self.version}: {answer}")
        return answer

    def prepare(self, work: Work, smoke: bool) -> None:
        """Have the run of a work made."""
        self._ask("prepare", work.today.__module__, work.today.__qualname__, smoke)

    def output(self) -> object:
        return self._ask("output")

    def sample(self, times: int) -> Sample:
        return Sample(*self._ask("sample", times))

    def close(self) -> None:
        self._process.stdin.close()
        self._process.wait()
        self._answers.close()


def measure(work: Work, processes: Sequence[Elsewhere], smoke: bool) -> list[Result]:
    """All rows of a work. Raises what ``agree`` raises.

    ``processes`` are kinacc's and today's; without them, as in smoke size, all runs stay here.
    """
    first, *others = work.contenders
    sides: list[_Here | Elsewhere] = [_Here(each.name, each.version, each.run) for each in others]
    if work.today is None or not processes:
        run = work.today(smoke) if work.today else first.run
        sides.insert(0, _Here(first.name, first.version, run))
    else:
        for process in processes:
            process.prepare(work, smoke)
        sides = [processes[0], *sides, *processes[1:]]
    known = {LIMIT, TODAY, *(side.name for side in sides)}
    absent = [_absent(work, name, "not installed") for name in work.wanted if name not in known]
    if work.today is not None and not processes:
        why = "not run in smoke size" if smoke else "that commit is not in this repository"
        absent.append(_absent(work, TODAY, why))
    return [*_rows(work, sides, smoke), *absent]


def _rows(work: Work, sides: Sequence[_Here | Elsewhere], smoke: bool) -> list[Result]:
    samples, runs = (_once if smoke else _in_turns)(work, sides)
    rows = [
        _row(work, side, own, samples[0], (len(own), *counts))
        for side, own, counts in zip(sides, samples, runs, strict=True)
    ]
    return rows if work.limit_ns is None else [*rows, _limit(work, samples[0])]


def _once(
    work: Work, sides: Sequence[_Here | Elsewhere]
) -> tuple[list[list[Sample]], list[tuple[int, int]]]:
    """One run each, whose outputs are those compared."""
    outputs: list[object] = []
    samples = [[timed(lambda side=side: outputs.append(side.output()))] for side in sides]
    work.agree(outputs)
    return samples, [(1, 0)] * len(sides)


def _in_turns(
    work: Work, sides: Sequence[_Here | Elsewhere]
) -> tuple[list[list[Sample]], list[tuple[int, int]]]:
    """Samples of all rounds by side, and runs in each and before them."""
    work.agree([side.output() for side in sides])
    tried = [_enough(side) for side in sides]
    # Where a single run is enough for all, trying was the first round.
    counts = all(times == done == 1 for times, done, _ in tried)
    samples = [[last] if counts else [] for _, _, last in tried]
    fewest, most = ROUNDS
    rounds = round(work.seconds / sum(times * last.wall_ns / 1e9 for times, _, last in tried))
    for number in range(counts, min(most, max(fewest, rounds))):
        for place in range(len(sides)):
            turn = (place + number) % len(sides)
            samples[turn].append(sides[turn].sample(tried[turn][0]))
    return samples, [(times, 1 if counts else 1 + done) for times, done, _ in tried]


def _enough(side: _Here | Elsewhere) -> tuple[int, int, Sample]:
    """How many runs make a sample, how many have been tried, and what one of the last took."""
    times, done = 1, 0
    while True:
        sample = side.sample(times)
        done += times
        lasted_s = times * sample.wall_ns / 1e9
        if lasted_s > SAMPLE_S / 4:
            return max(1, round(SAMPLE_S * times / lasted_s)), done, sample
        times *= 4


def _row(
    work: Work,
    side: _Here | Elsewhere,
    own: Sequence[Sample],
    kinacc: Sequence[Sample],
    runs: tuple[int, int, int],
) -> Result:
    taken = [_clock(work, each) / work.count for each in own]
    ratios = [_clock(work, a) / _clock(work, b) for a, b in zip(own, kinacc, strict=True)]
    low, high = _quartiles(taken)
    ratio_low, ratio_high = _quartiles(ratios)
    wanted = work.wanted.get(side.name)
    ratio = statistics.median(ratios)
    return Result(
        work.name, work.unit, work.count, side.name, side.version, work.clock, *runs,
        ns=statistics.median(taken), ns_low=low, ns_high=high,
        wall_ns=statistics.median(each.wall_ns for each in own) / work.count,
        cpu_ns=statistics.median(each.cpu_ns for each in own) / work.count,
        ratio=ratio, ratio_low=ratio_low, ratio_high=ratio_high,
        wanted=wanted, met=None if wanted is None else ratio >= wanted, limit=work.limit,
    )  # fmt: skip


def _limit(work: Work, kinacc: Sequence[Sample]) -> Result:
    """The physical limit as a row among the others."""
    ratio = work.limit_ns * work.count / statistics.median(_clock(work, each) for each in kinacc)
    wanted = work.wanted.get(LIMIT)
    return Result(
        work.name, work.unit, work.count, LIMIT, "", work.clock, ns=work.limit_ns, ratio=ratio,
        wanted=wanted, met=None if wanted is None else ratio >= wanted, limit=work.limit,
    )  # fmt: skip


def _absent(work: Work, name: str, why: str) -> Result:
    return Result(
        work.name, work.unit, work.count, name, "", work.clock,
        wanted=work.wanted.get(name), limit=work.limit, left_out=why,
    )  # fmt: skip


def _clock(work: Work, sample: Sample) -> float:
    return sample.cpu_ns if work.clock == "cpu" else sample.wall_ns


def _quartiles(values: Sequence[float]) -> tuple[float, float]:
    if len(values) == 1:
        return values[0], values[0]
    low, _, high = statistics.quantiles(values, method="inclusive")
    return low, high

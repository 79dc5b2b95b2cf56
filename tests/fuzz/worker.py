"""A process that reads inputs under limits of time and memory, and says how each ended.

Started by ``run.py`` with a plan as JSON on standard input; every line it writes is an outcome, a
line before it names the input that begins, so that one that hangs or ends the process is known.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import io
import json
import os
import resource
import shutil
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Iterator
from pathlib import Path
from time import process_time
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1] / "src"), str(HERE.parent), str(HERE.parents[1] / "tools")]

MOST_SECONDS, MOST_BYTES = 5.0, 1 << 30
_FINDING_KINDS = ("crash", "hang", "memory", "wrote")


class HangError(BaseException):
    """More than the seconds of an input were used; no ``except Exception`` takes it for another."""


class Writes:
    """Files opened to be written, renamed or removed while an input is read, outside one folder."""

    def __init__(self) -> None:
        self.on, self.allowed, self.seen = False, "", []
        sys.addaudithook(self._hook)

    def _hook(self, event: str, args: tuple) -> None:
        if not self.on:
            return
        if event == "open":
            path, mode, flags = args
            writing = (flags or 0) & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC)
            if not writing and not set(mode or "") & set("wax+"):
                return
        elif event not in (
            "os.mkdir",
            "os.rename",
            "os.remove",
            "os.symlink",
            "os.link",
            "os.truncate",
        ):
            return
        path = os.fspath(args[0]) if not isinstance(args[0], int) else ""
        path = os.path.abspath(os.fsdecode(path)) if path else ""
        usual = path.startswith(("/dev/", "/proc/")) or path.endswith((".nbi", ".nbc", ".pyc"))
        usual = usual or "__pycache__" in path
        if path and not usual and not (self.allowed and path.startswith(self.allowed)):
            self.seen.append(f"{event} {path}")


class Counter:
    """Whether a function was reached since it was last asked."""

    def __init__(self, dotted: str) -> None:
        self.reached = False
        module_name, _, name = dotted.rpartition(".")
        module = importlib.import_module(module_name)
        inner = getattr(module, name)

        def reaching(*args: Any, **named: Any) -> Any:
            self.reached = True
            return inner(*args, **named)

        setattr(module, name, reaching)


def _limit_memory() -> None:
    """Let the process grow by what one input may take, from what it has now."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    size = pages * resource.getpagesize() + MOST_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (size, resource.getrlimit(resource.RLIMIT_AS)[1]))


def _resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def _peak() -> int:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM"):
            return int(line.split()[1]) * 1024
    return 0


@contextlib.contextmanager
def _limited(seconds: float) -> Iterator[None]:
    def end(*_: object) -> None:
        raise HangError

    before = signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def _where(error: BaseException) -> str:
    """Exception and the innermost place of the package in it, by which findings are told apart."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [each for each in frames if "/kinacc/" in each.filename] or frames[-1:]
    place = f"{own[-1].filename.rpartition('/kinacc/')[2]}:{own[-1].name}" if own else ""
    return f"{type(error).__name__} in {place}"


class Runner:
    """Reads inputs of targets, in a folder that each finds empty."""

    def __init__(self) -> None:
        from fuzz import targets

        self.targets = targets.TARGETS
        self.counters: dict[str, Counter] = {}
        self.writes = Writes()
        base = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
        self.folder = Path(tempfile.mkdtemp(prefix="kinacc-fuzz-", dir=base))
        self.limited = False

    def close(self) -> None:
        """Take away the folder."""
        os.chdir("/")
        shutil.rmtree(self.folder, ignore_errors=True)

    def warm(self, name: str) -> None:
        """Import and compile what a target needs, before limits hold."""
        target = self.targets[name]
        for dotted in target.past.split():
            if dotted not in self.counters:
                self.counters[dotted] = Counter(dotted)
        case = target.case(name, 0, 0)
        self.read(name, case)

    def read(self, name: str, case: Any) -> dict[str, Any]:
        """How the reader of a target takes an input: outcome, where, seconds, whether parsed."""
        from kinacc.errors import KinaccError

        target = self.targets[name]
        work = self.folder / "in"
        shutil.rmtree(work, ignore_errors=True)
        work.mkdir()
        case.write(work)
        os.chdir(work)
        there = sorted(case.files)
        counters = [self.counters[each] for each in target.past.split() if each in self.counters]
        for counter in counters:
            counter.reached = False
        self.writes.seen.clear()
        self.writes.allowed = str(work / target.writes) if target.writes else ""
        Path("/proc/self/clear_refs").write_text("5")
        before, start = _resident(), process_time()
        outcome, where = "accepted", ""
        try:
            with (
                _limited(MOST_SECONDS),
                warnings.catch_warnings(),
                contextlib.redirect_stderr(io.StringIO()),
                contextlib.redirect_stdout(io.StringIO()),
            ):
                warnings.simplefilter("ignore")
                self.writes.on = True
                target.read(work, case.options)
        except KinaccError as error:
            outcome = "refused"
            str(error)
        except HangError as error:
            outcome, where = "hang", _where(error)
        except MemoryError as error:
            outcome, where = "memory", _where(error)
        except (Exception, SystemExit, RecursionError) as error:
            outcome, where = "crash", f"{_where(error)}: {str(error)[:200]}"
        finally:
            self.writes.on = False
        used = process_time() - start
        grown = _peak() - before
        if outcome in ("accepted", "refused"):
            left = sorted(str(path.relative_to(work)) for path in work.rglob("*") if path.is_file())
            left = [
                each for each in left if not target.writes or not each.startswith(target.writes)
            ]
            if self.writes.seen or left != there:
                outcome, where = "wrote", self.writes.seen[0] if self.writes.seen else str(left)
            elif grown > MOST_BYTES:
                outcome, where = "memory", f"{grown >> 20} MB"
            elif used > MOST_SECONDS:
                outcome, where = "hang", f"{used:.1f} s"
        parsed = outcome == "accepted" or any(each.reached for each in counters)
        return {"outcome": outcome, "where": where, "seconds": round(used, 4), "parsed": parsed}


def main() -> None:
    """Go through a plan: ``{"bug", "coverage", "work": [[target, seed, first, last], ..]}``."""
    plan = json.loads(sys.stdin.readline())
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    if plan.get("bug"):
        from fuzz import bugs

        bugs.put_back(plan["bug"])
    covered = None
    if plan.get("coverage"):
        import coverage

        covered = coverage.Coverage(
            data_file=plan["coverage"], data_suffix=True, branch=True, source_pkgs=["kinacc"]
        )
        covered.start()
    runner = Runner()
    try:
        names = list(dict.fromkeys(name for name, *_ in plan["work"]))
        for name in names:
            runner.warm(name)
        if not covered:
            _limit_memory()
        for name, seed, first, last in plan["work"]:
            for number in range(first, last):
                answers.write(json.dumps({"begins": [name, seed, number]}) + "\n")
                case = runner.targets[name].case(name, seed, number)
                answers.write(json.dumps(runner.read(name, case)) + "\n")
                if number % 500 == 499:
                    gc.collect()
        answers.write(json.dumps({"done": True}) + "\n")
    finally:
        if covered:
            covered.stop()
            covered.save()
        runner.close()


if __name__ == "__main__":
    main()

"""One planted fault and the tests that reach it, in a process of its own.

The fault exists in memory alone: modules are imported from the source as it stands, but for the
one module whose changed tree is compiled instead, so no hash of code sees it. The process is forked
from one that has loaded what is not kinacc's.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import importlib.abc
import importlib.machinery
import json
import os
import resource
import select
import shutil
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from mutation.places import ROOT, SOURCE, Mutant, path_of, planted

MEMORY_BYTES = 8 << 30
# CPU seconds a trial may take: to begin with, for kernels that are compiled anew, and for every
# second its tests took under the tracer. Beyond that the fault counts as one that never ends.
BEGIN_S, COMPILE_S, PER_SECOND = 15.0, 45.0, 2.0


class _Planted(importlib.machinery.SourceFileLoader):
    """Gives the code of the changed tree; source and path stay those on disk."""

    def __init__(self, mutant: Mutant):
        super().__init__(mutant.module, str(path_of(mutant.module)))
        self.mutant = mutant

    def get_code(self, fullname):
        return compile(planted(self.mutant), self.path, "exec", dont_inherit=True)


class _Finder(importlib.abc.MetaPathFinder):
    def __init__(self, mutant: Mutant):
        self.mutant = mutant

    def find_spec(self, fullname, path=None, target=None):
        if fullname != self.mutant.module:
            return None
        spec = importlib.machinery.PathFinder.find_spec(fullname, path, target)
        spec.loader = _Planted(self.mutant)
        return spec


class _Watch:
    """A pytest plugin: the order asked for, and the first test that fails."""

    def __init__(self, tests: Sequence[str], tell: Callable[[str, str], None]):
        self.place = {test: number for number, test in enumerate(tests)}
        self.tell = tell

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items):
        items[:] = [item for item in items if item.nodeid in self.place]
        items.sort(key=lambda item: self.place[item.nodeid])

    def pytest_collectreport(self, report):
        if report.failed:
            self.tell("killed", report.nodeid)

    def pytest_runtest_logreport(self, report):
        if report.failed:
            self.tell("killed", report.nodeid)


def load(others: Sequence[str]) -> None:
    """Import what is not kinacc's, once for all trials."""
    for name in others:
        with contextlib.suppress(Exception):
            importlib.import_module(name)
    ours = [name for name in sys.modules if name.partition(".")[0] == "kinacc"]
    assert not ours, ours
    gc.collect()
    gc.freeze()


def _without_kept_code(module: str) -> None:
    """Have numba compile the module's kernels anew: what it kept is of the sound source."""
    from numba import njit

    from kinacc import compiled

    kept = compiled._compiled

    def compile_(function, error_model):
        if function.__module__ == module:
            return njit(nogil=True, error_model=error_model)(function)
        return kept(function, error_model)

    compiled._compiled = compile_


def _run(
    mutant: Mutant | None, tests: Sequence[str], folder: Path, out: int, limit_s: float
) -> None:
    """In the child: import, run, tell the first failure through ``out``."""
    told = False

    def tell(verdict: str, by: str) -> None:
        nonlocal told
        if not told:
            os.write(out, json.dumps([verdict, by]).encode())
        told = True

    os.setsid()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (round(limit_s), round(limit_s) + 5))
    log = os.open(folder / "log", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(log, 1)
    os.dup2(log, 2)
    os.chdir(ROOT)
    sys.path.insert(0, str(SOURCE))
    if mutant is not None:
        sys.meta_path.insert(0, _Finder(mutant))
        _without_kept_code(mutant.module)
    options = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", f"--basetemp={folder}/t"]
    files = list(dict.fromkeys(test.partition("::")[0] for test in tests))
    code = pytest.main([*options, *files], plugins=[_Watch(tests, tell)])
    if code == pytest.ExitCode.OK:
        tell("survived", "")
    tell("killed", "at import")


def attempt(
    mutant: Mutant | None, tests: Sequence[str], limit_s: float, log: Path | None = None
) -> tuple[str, str]:
    """(killed, survived, timeout or crash; the test that noticed), in ``limit_s`` CPU seconds."""
    folder = Path(tempfile.mkdtemp(prefix="kinacc-mutant-"))
    reads, writes = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.close(reads)
            _run(mutant, tests, folder, writes, limit_s)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(0)
    os.close(writes)
    told = ""
    try:
        # Waits of the tests themselves end by the clock.
        ready, _, _ = select.select([reads], [], [], 120.0 + 10.0 * limit_s)
        told = os.read(reads, 65536).decode() if ready else ""
        if ready and not told:
            _, status = os.waitpid(child, 0)
            ready = (
                [] if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGXCPU else ready
            )
    finally:
        for kill in (os.killpg, os.kill):
            with contextlib.suppress(ProcessLookupError):
                kill(child, signal.SIGKILL)
        with contextlib.suppress(ChildProcessError):
            os.waitpid(child, 0)
        os.close(reads)
        if log is not None and (folder / "log").exists():
            shutil.copy(folder / "log", log)
        shutil.rmtree(folder, ignore_errors=True)
    if not told:
        return ("crash" if ready else "timeout"), ""
    verdict, by = json.loads(told)
    return verdict, by


def limit(seconds: float, compiles: bool) -> float:
    """CPU seconds that tests of so many seconds may take with a fault in place."""
    return BEGIN_S + COMPILE_S * compiles + PER_SECOND * seconds


def now() -> float:
    """CPU seconds of this process and of those it has waited for."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system

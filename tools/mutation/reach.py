"""Which test executes which lines, and with it which tests may notice a planted fault."""

from __future__ import annotations

import ast
import pickle
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import pytest

from mutation.places import ROOT, SOURCE, Mutant, path_of

# Tests of behaviour. Left out: what holds code to hashes of code or bytes to bytes, documents,
# styles of source, and what runs kinacc in other processes, which a planted fault does not enter.
TESTS = (
    *("kinematics", "calibration", "assess", "artifacts", "workflow", "study", "synthetic"),
    *("deployment", "campaign", "checks", "oracles", "versions"),
    *("cli/test_answer_at_the_end.py", "cli/test_show.py"),
    *(
        "test_accuracy_map.py",
        "test_accuracy_map_oracle.py",
        "test_gamma.py",
        "test_gamma_oracle.py",
    ),
    *("test_geometry_oracle.py", "test_histories.py", "test_inverse.py", "test_inverse_oracle.py"),
    *("test_models_oracle.py", "test_operating_points.py", "test_region.py"),
    *("test_region_oracle.py", "test_study.py", "test_study_oracle.py"),
)
LEFT_OUT = (
    "campaign/test_marks.py",
    "campaign/test_documentation.py",
    "campaign/test_campaign_commands.py",
    "workflow/test_stopping.py",
    "workflow/test_stages_on_a_cluster.py",
)
Line = tuple[str, int]


@dataclass
class Reach:
    """What each test of a run executed: lines, seconds, and the shared set-ups it stands on."""

    lines: dict[str, set[Line]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    shared: dict[str, tuple[str, ...]] = field(default_factory=dict)
    set_ups: dict[str, float] = field(default_factory=dict)
    failed: list[str] = field(default_factory=list)
    others: list[str] = field(default_factory=list)


class Tracer:
    """A pytest plugin that fills a ``Reach``.

    What a fixture of a module or session executes counts for every test that asks for it.
    """

    def __init__(self) -> None:
        self.reach = Reach()
        self.now: set[Line] = set()
        self.spent = 0.0
        self.kept: dict[object, tuple[str, set[Line]]] = {}
        self.inside = f"{SOURCE}/kinacc/"

    def _call(self, frame, event, arg):
        path = frame.f_code.co_filename
        if not path.startswith(self.inside) or frame.f_code.co_name == "<module>":
            return None
        now = self.now

        def each_line(frame, event, arg):
            if event == "line":
                now.add((path, frame.f_lineno))
            return each_line

        now.add((path, frame.f_lineno))
        return each_line

    @pytest.hookimpl(hookwrapper=True)
    def pytest_fixture_setup(self, fixturedef, request):
        if fixturedef.scope == "function":
            yield
            return
        outer, self.now = self.now, set()
        started = time.process_time()
        yield
        spent = time.process_time() - started
        self.spent += spent
        name = f"{request.node.nodeid}::{fixturedef.argname}"
        self.reach.set_ups[name] = self.reach.set_ups.get(name, 0.0) + spent
        held = self.kept.setdefault(fixturedef, (name, set()))[1]
        held |= self.now
        outer |= self.now
        self.now = outer
        # The tracer of running frames holds the old set: begin a new one for them.

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item):
        self.now, self.spent = set(), 0.0
        lines = self.now
        started = time.process_time()
        sys.settrace(self._call)
        yield
        sys.settrace(None)
        wide = [self.kept[each] for each in self._defs(item) if each in self.kept]
        lines |= self.now
        self.reach.lines[item.nodeid] = lines.union(*(held for _, held in wide))
        self.reach.seconds[item.nodeid] = time.process_time() - started - self.spent
        self.reach.shared[item.nodeid] = tuple(name for name, _ in wide)

    @staticmethod
    def _defs(item) -> Iterator[object]:
        for defs in item._fixtureinfo.name2fixturedefs.values():
            yield from defs

    def pytest_runtest_logreport(self, report):
        if report.failed:
            self.reach.failed.append(report.nodeid)


def chosen(tests: tuple[str, ...] = TESTS) -> list[str]:
    """The files and folders of tests that are there, those left out as options."""
    there = [str(ROOT / "tests" / name) for name in tests if (ROOT / "tests" / name).exists()]
    return [*there, *(f"--ignore={ROOT / 'tests' / name}" for name in LEFT_OUT)]


def measure(target: Path, tests: tuple[str, ...] = TESTS) -> Reach:
    """Run tests once under a tracer of lines; what each reached joins what ``target`` holds."""
    tracer = Tracer()
    pytest.main(["-q", "-p", "no:cacheprovider", *chosen(tests)], plugins=[tracer])
    tracer.reach.others = sorted(
        name
        for name, module in list(sys.modules.items())
        if "site-packages" in (getattr(module, "__file__", None) or "")
        and not name.startswith(("kinacc", "_pytest.", "xdist", "snakemake"))
    )
    known = pickle.loads(target.read_bytes()) if target.exists() else Reach()
    for name in ("lines", "seconds", "shared", "set_ups"):
        getattr(known, name).update(getattr(tracer.reach, name))
    known.failed = tracer.reach.failed
    known.others = sorted({*known.others, *tracer.reach.others})
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_bytes(pickle.dumps(known))
    return known


class Selection:
    """Which tests may notice a fault: those that execute its line, or use what it defines."""

    def __init__(self, reach: Reach):
        self.reach = reach
        self.by_line: dict[Line, set[str]] = defaultdict(set)
        for test, lines in reach.lines.items():
            for line in lines:
                self.by_line[line].add(test)

    def tests(self, mutant: Mutant) -> set[str]:
        """Tests that reach the fault.

        Lines of compiled functions and of modules themselves are seen by no tracer. There the
        tests count that execute a line with the name of what the fault stands in, or of what is
        defined by it in turn.
        """
        path = str(path_of(mutant.module))
        seen = region(path, mutant.line)
        if seen is None:
            return set(self.by_line.get((path, mutant.line), ()))
        found: set[str] = set()
        names, done = {seen}, set()
        while names:
            name = names.pop()
            done.add(name)
            for file, line, defined in mentions().get(name, ()):
                if defined is None:
                    found |= self.by_line.get((file, line), set())
                elif defined not in done:
                    names.add(defined)
        return found

    def ordered(self, tests: set[str], mutant: Mutant) -> list[tuple[str, list[str], float]]:
        """The tests by file, (file, tests, seconds): the module's own first, then quick files."""
        files: dict[str, list[str]] = defaultdict(list)
        for test in sorted(tests):
            files[test.partition("::")[0]].append(test)
        word = mutant.module.rpartition(".")[2]
        rows = []
        for file, own in files.items():
            own.sort(key=lambda test: self.reach.seconds[test])
            set_ups = {name for test in own for name in self.reach.shared[test]}
            seconds = sum(self.reach.seconds[test] for test in own)
            seconds += sum(self.reach.set_ups[name] for name in set_ups)
            rows.append((file, own, seconds))
        return sorted(rows, key=lambda row: (word not in row[0] or row[2] > 3.0, row[2]))


def is_compiled(node: ast.AST) -> bool:
    """Whether a function is one that numba compiles."""
    words = [ast.unparse(each) for each in getattr(node, "decorator_list", [])]
    return any(word.startswith(("compiled", "njit")) for word in words)


@cache
def regions(path: str) -> dict[int, str | None]:
    """For each line the name that stands for it where no tracer sees it, else None."""
    tree = ast.parse(Path(path).read_text())
    found: dict[int, str | None] = {}

    def visit(node: ast.AST, name: str | None) -> None:
        for child in ast.iter_child_nodes(node):
            inner = name
            if isinstance(child, ast.FunctionDef):
                head = range(child.lineno, child.body[0].lineno)
                # Defaults are read once: whoever runs the function is affected.
                found.update(dict.fromkeys(head, child.name))
                body = range(child.body[0].lineno, child.end_lineno + 1)
                inner = child.name if is_compiled(child) else None
                found.update(dict.fromkeys(body, inner))
            elif isinstance(child, ast.ClassDef):
                inner = child.name
                found.update(dict.fromkeys(range(child.lineno, child.end_lineno + 1), inner))
            elif isinstance(child, ast.Assign | ast.AnnAssign) and name is None and node is tree:
                targets = getattr(child, "targets", [getattr(child, "target", None)])
                words = [each.id for each in ast.walk(targets[0]) if isinstance(each, ast.Name)]
                lines = range(child.lineno, child.end_lineno + 1)
                found.update(dict.fromkeys(lines, words[0] if words else ""))
                continue
            visit(child, inner)

    visit(tree, None)
    return found


def region(path: str, line: int) -> str | None:
    """The name that stands for a line no tracer sees; None where it does see it."""
    return regions(path).get(line, "")


@cache
def mentions() -> dict[str, set[tuple[str, int, str | None]]]:
    """Where each name is used: (file, line, what is defined there where no tracer sees it)."""
    found: dict[str, set] = defaultdict(set)
    for file in sorted((SOURCE / "kinacc").rglob("*.py")):
        path = str(file)
        for node in ast.walk(ast.parse(file.read_text())):
            name = getattr(node, "id", getattr(node, "attr", None))
            if isinstance(name, str) and isinstance(node, ast.Name | ast.Attribute):
                found[name].add((path, node.lineno, region(path, node.lineno)))
            elif isinstance(node, ast.FunctionDef) and not is_compiled(node):
                for line in range(node.body[0].lineno, node.end_lineno + 1):
                    found[node.name].add((path, line, None))
    return found

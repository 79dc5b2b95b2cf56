"""How do time and memory grow with the size of a problem?

CPU time of stages of the paper's arm, in memory, and the peak memory of a process of their own,
against one size at a time. The exponent is the slope of log time over log size between the two
largest: 1 is linear, at most 1.15 with the noise of a machine; smaller sizes show what costs the
same at any size. Imports and compilation come before. Memory of a thousand more is the slope from
the smallest to the largest. Not linear by nature is the Chebyshev order: a Gram matrix of n
unknowns has n^2 entries, its inverse n^3 products. Limit: a look at every unit once, an exponent
of 1.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

LINEAR = 1.15


class Problem(NamedTuple):
    """``run(size)`` prepares one and gives the size it really has and what is to be timed."""

    work: str
    against: str
    sizes: tuple[float, ...]
    smoke: tuple[float, ...]
    run: Callable[[float], tuple[float, Callable[[], object]]]
    linear: bool = True


def measure(smoke: bool) -> list[dict[str, str | float | bool | None]]:
    """A row for each size of each problem."""
    rows = []
    for problem in PROBLEMS:
        found = [
            _here(problem, size) if smoke else _elsewhere(problem, size)
            for size in (problem.smoke if smoke else problem.sizes)
        ]
        sizes, times, peaks = np.array(found).T
        exponent = float(np.diff(np.log(times[-2:]))[0] / np.diff(np.log(sizes[-2:]))[0])
        a_thousand = 1000.0 * float((peaks[-1] - peaks[0]) / (sizes[-1] - sizes[0]))
        rows += [
            {
                "work": problem.work,
                "against": problem.against,
                "size": size,
                "cpu_s": cpu,
                "peak_mb": peak,
                "exponent": exponent,
                "mb_a_thousand": a_thousand,
                "wanted": LINEAR if problem.linear else None,
                "met": exponent <= LINEAR if problem.linear else None,
            }
            for size, cpu, peak in found
        ]
        if not smoke:
            print(
                f"  {problem.work} against {problem.against}: exponent {exponent:.2f}", flush=True
            )
    return rows


def _here(problem: Problem, size: float) -> tuple[float, float, float]:
    """Size, CPU time in s and peak memory of this process in MB."""
    real, run = problem.run(size)
    begin = time.process_time()
    run()
    cpu = max(time.process_time() - begin, 1e-6)
    return real, cpu, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def _elsewhere(problem: Problem, size: float) -> tuple[float, float, float]:
    """The same in a process of its own."""
    import project

    above = Path(__file__).resolve().parents[1]
    given = project.environment()
    given["PYTHONPATH"] = os.pathsep.join([str(above), given["PYTHONPATH"]])
    place = str(PROBLEMS.index(problem))
    done = subprocess.run(
        [sys.executable, str(Path(__file__).resolve()), place, str(size)],
        env=given, capture_output=True, text=True,
    )  # fmt: skip
    if done.returncode:
        raise RuntimeError(f"{problem.work}, {problem.against} {size}: {done.stderr}")
    return tuple(json.loads(done.stdout.splitlines()[-1]))


def _settings(**changes: object) -> Mapping:
    """Settings of the paper's arm with other values by path, whose points are written as __."""
    import project

    from kinacc.workflow.contradictions import load

    found = load([project.tree() / "config.yaml"])["mh180"]
    for path, value in changes.items():
        *sections, key = path.split("__")
        place = found
        for section in sections:
            place = place[section]
        place[key] = value
    return found


def _stage(name: str, before: tuple[str, ...], **changes: object) -> Callable[[], object]:
    """One stage, after those it needs."""
    from kinacc.workflow.in_memory import RUNS

    settings = _settings(**changes)
    tables: dict = {}
    for each in before:
        tables |= RUNS[each](tables, settings)
    return lambda: RUNS[name](tables, settings)


_FITTED = ("measurements", "vec", "dh")


def _fit(name: str, before: tuple[str, ...]) -> Callable[[float], tuple[float, Callable]]:
    def run(poses: float) -> tuple[float, Callable[[], object]]:
        return poses, _stage(name, before, measurements__synthetic__poses=int(poses))

    return run


def _order(order: float) -> tuple[float, Callable[[], object]]:
    changes = {"measurements__synthetic__poses": 2000, "calibration__vec__order": int(order)}
    return order, _stage("vec", ("measurements",), **changes)


def _chosen(poses: float) -> tuple[float, Callable[[], object]]:
    from works.orders import chooser, wavy

    return poses, chooser(wavy("irb120", int(poses)), "irb120", 12)


def _map(grid_mm: float) -> tuple[float, Callable[[], object]]:
    run = _stage("accuracy_map", _FITTED, map__grid_mm=grid_mm)
    return float((np.floor(900.0 / grid_mm) + 1) * (np.floor(500.0 / grid_mm) + 1) * 5), run


def _points(points: float) -> tuple[float, Callable[[], object]]:
    return points, _stage("assessment_points", _FITTED, evaluation__points=int(points))


def _study(repetitions: float) -> tuple[float, Callable[[], object]]:
    before = (*_FITTED, "assessment_points")
    return repetitions, _stage("study_chunk", before, study__repetitions=int(repetitions))


def _data_sets(count: float) -> tuple[float, Callable[[], object]]:
    import project
    from kinacc.workflow.plan import planned

    path = project.folder() / "many.yaml"
    one = "{robot: mh180, measurements: {source: synthetic}}"
    lines = [f"  arm{number}: {one}" for number in range(int(count))]
    path.write_text("\n".join(["datasets:", *lines, ""]))
    return count, lambda: planned([path])


PROBLEMS = (
    Problem("VEC fit of order 5", "poses", (400, 1600, 6400, 25600), (60, 80),
            _fit("vec", ("measurements",))),
    Problem("VEC fit, 2,000 poses", "order", (2, 4, 8, 16), (1, 2), _order, linear=False),
    Problem("DH fit", "poses", (400, 1600, 6400, 25600), (60, 80), _fit("dh", _FITTED[:2])),
    Problem("residual tables", "poses", (400, 1600, 6400, 12800), (60, 80),
            _fit("residuals", _FITTED)),
    Problem("order auto, up to 12", "poses", (500, 2000, 8000, 16000), (60, 80), _chosen),
    Problem("accuracy map", "grid cells", (25.0, 12.5, 6.25), (300.0, 200.0), _map),
    Problem("assessment points", "points", (200, 800, 3200), (8, 16), _points),
    Problem("study", "repetitions", (50, 100, 200), (1, 2), _study),
    Problem("plan of the workflow", "data sets", (10, 100, 1000), (1, 2), _data_sets),
)  # fmt: skip

if __name__ == "__main__":
    asked = PROBLEMS[int(sys.argv[1])]
    _here(asked, asked.smoke[0])  # imports and compiles
    print(json.dumps(_here(asked, float(sys.argv[2]))))

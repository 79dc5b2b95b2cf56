"""What `kinacc.workflow.cost` says of work beforehand, against what it takes.

    python benchmarks/costs.py

Processor time of stages of the paper's arm and of commands at three sizes, each in a process of its
own, and its peak memory, beside the estimates; the ratios should lie within a factor of three.
Imports and compilation come before, and are in none of the estimates.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

import project
from works.growth import _settings, _stage

_FITTED = ("measurements", "vec", "dh")
_FEW = {"measurements__synthetic__poses": 60}
# Stage, what it needs, and what changes at its three sizes.
STAGES = {
    "vec": (("measurements",), [{"measurements__synthetic__poses": n} for n in (400, 6400, 25600)]),
    "vec ": (("measurements",), [{"calibration__vec__order": n} for n in (2, 10, 40)]),
    "dh": (_FITTED[:2], [{"measurements__synthetic__poses": n} for n in (1600, 6400, 25600)]),
    "residuals": (_FITTED, [{"measurements__synthetic__poses": n} for n in (400, 1600, 6400)]),
    "accuracy_map": (_FITTED, [{"map__grid_mm": n} for n in (25.0, 10.0, 5.0)]),
    "study_chunk": (
        (*_FITTED, "assessment_points"),
        [
            {**_FEW, "study__repetitions": r, "study__measurements": m, "evaluation__points": p}
            for r, m, p in ((100, 200, 200), (20, 800, 800), (1, 5000, 2000))
        ],
    ),
}
COMMANDS = {
    "plan-campaign": [{"poses": n, "repetitions": 30} for n in (50, 200, 600)],
    "plan-poses": [{"drawn": n, "poses": 40} for n in (1000, 4000, 16000)],
}


def measured(work: str, changes: dict) -> tuple[float, float, float, float]:
    """Estimated and measured seconds, estimated and measured bytes, in this process."""
    if work in COMMANDS:
        run, estimate = _command(work, changes)
    else:
        before = STAGES[work][0]
        name = work.strip()
        small = {"map__grid_mm": 300.0, "study__repetitions": 1, "calibration__vec__order": 1}
        _stage(name, before, **_FEW, **small)()  # imports and compiles
        run = _stage(name, before, **changes)
        from kinacc.workflow.cost import of_stage

        estimate = of_stage(name, _settings(**changes))
    begun = time.process_time()
    run()
    seconds = time.process_time() - begun
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    return estimate.seconds, seconds, estimate.bytes, peak


def _command(work: str, changes: dict):
    from click.testing import CliRunner

    from kinacc.cli.group import main
    from kinacc.workflow import cost

    def run(**options: int) -> None:
        words = [word for name, value in options.items() for word in (f"--{name}", str(value))]
        begin = ["ur10"] if work == "plan-poses" else ["--noise-mm", "0.05"]
        done = CliRunner().invoke(main, [work, *begin, *words])
        if done.exit_code:
            raise RuntimeError(done.output)

    if work == "plan-poses":
        run(drawn=60, poses=12)
        return lambda: run(**changes), cost.of_chosen_poses(changes["drawn"], changes["poses"])
    from kinacc.cli.campaign_plans import DEFAULT_ERRORS, SHARES

    run(poses=10, repetitions=2)
    budgets = [round(share * changes["poses"]) for share in SHARES]
    given = changes["poses"], budgets, len(DEFAULT_ERRORS), changes["repetitions"]
    return lambda: run(**changes), cost.of_campaigns(*given)


def main() -> None:
    """Print a row for each size."""
    print(f"{'work':34s} {'estimated':>10s} {'taken':>10s} {'ratio':>6s}", end="")
    print(f" {'estimated':>10s} {'taken':>10s} {'ratio':>6s}")
    given = project.environment()
    given["PYTHONPATH"] = os.pathsep.join([str(Path(__file__).parent), given["PYTHONPATH"]])
    every = {**{name: sizes for name, (_, sizes) in STAGES.items()}, **COMMANDS}
    for work, sizes in every.items():
        for changes in sizes:
            done = subprocess.run(
                [sys.executable, __file__, work, json.dumps(changes)],
                env=given, capture_output=True, text=True, check=False,
            )  # fmt: skip
            if done.returncode:
                raise SystemExit(done.stderr)
            said, taken, said_b, taken_b = json.loads(done.stdout.splitlines()[-1])
            about = ", ".join(f"{key.split('__')[-1]} {value}" for key, value in changes.items())
            print(f"{work.strip():13s} {about:20s} {said:8.2f} s {taken:8.2f} s", end="")
            print(f" {said / taken:6.2f} {said_b / 1e6:7.0f} MB {taken_b / 1e6:7.0f} MB", end="")
            print(f" {said_b / taken_b:6.2f}", flush=True)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        print(json.dumps(measured(sys.argv[1], json.loads(sys.argv[2]))))
    else:
        main()

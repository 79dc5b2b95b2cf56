"""What the fits reach on measured arms: held-out errors, time and memory, by data set.

    python benchmarks/reach.py benchmarks/reach.yaml ur10_a fanuc
    python benchmarks/reach.py benchmarks/reach.yaml ur10_a --set calibration.vec.order=4

Runs measurements, VEC, DH and residuals in this process, as the workflow does. Start it in the
project's folder; the files are described in examples/.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time

import numpy as np
import yaml
from kinacc.workflow.plan import planned

from kinacc.workflow.in_memory import RUNS

STAGES = ("measurements", "vec", "dh", "residuals")


def main(arguments: list[str]) -> None:
    """Run every data set named and print its figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("config")
    parser.add_argument("datasets", nargs="*")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    given = parser.parse_args(arguments)
    plan = planned([given.config])
    for dataset in given.datasets or plan.datasets:
        run(plan, dataset, dict(each.split("=", 1) for each in given.set))


def run(plan, dataset: str, changes: dict[str, str]) -> None:
    """Stages of one data set, with ``changes`` of settings by dotted key."""
    tables: dict = {}
    for name in STAGES:
        settings = plan.settings(name, dataset)
        for path, value in changes.items():
            change(settings, path.split("."), yaml.safe_load(value))
        begin = time.perf_counter()
        tables |= RUNS[name](tables, settings)
        print(f"{dataset:12} {name:13} {time.perf_counter() - begin:8.2f} s", flush=True)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{dataset:12} largest memory so far {peak:.0f} MiB")
    show(dataset, tables)


def change(settings: dict, path: list[str], value) -> None:
    """Set one value where the stage has its section."""
    for key in path[:-1]:
        if key not in settings:
            return
        settings = settings[key]
    settings[path[-1]] = value


def show(dataset: str, tables: dict) -> None:
    """Position errors of rows that trained and of rows held out, mean of folds and pooled."""
    table = tables["residuals"]
    for comparison in ("nominal_vs_measured", "dh_vs_measured", "vec_vs_measured"):
        rows = (table["comparison"] == comparison) & (table["quantity"] == "position")
        pooled, out = np.isnan(table["fold"]), table["subset"] == "validation"
        of_folds = table["rms"][rows & out & ~pooled]
        one = {name: table[name][rows & out & pooled] for name in ("rms", "mean", "max")}
        train = table["rms"][rows & ~out & pooled].item()
        print(
            f"{dataset:12} {comparison:20} train rms {train:.4f}; held out: rms "
            f"{one['rms'].item():.4f}, mean of {len(of_folds)} folds {of_folds.mean():.4f}, mean "
            f"{one['mean'].item():.4f}, max {one['max'].item():.3f} mm"
        )
    choice = tables["model_selection"]
    chosen = choice["model"][choice["selected"] == 1].item()
    orders = tables["vec_orders"]
    order = orders["order"][(orders["chosen"] == 1) & np.isnan(orders["fold"])].item()
    print(f"{dataset:12} selected: {chosen}; VEC of order {order}")


if __name__ == "__main__":
    main(sys.argv[1:])

"""Reruns with nothing changed but machine, cores, chunks, order and place: none of them is told."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from worlds import ROOT, SETTINGS, World, rerun, write_world


@dataclass(frozen=True)
class Rerun:
    """One rerun; ``environment`` are variables of a process of its own, none: of this one."""

    name: str
    action: str
    given: Mapping[str, object] = field(default_factory=dict)
    environment: Mapping[str, str] | None = None
    family: str = "nothing changed"


def everything(seed: int = 61) -> list[Rerun]:
    """The 100 reruns, the same for the same seed."""
    draw = np.random.default_rng(seed)
    found = [
        *(_fresh(f"other folder: {name}", place=name) for name in PLACES),
        *_elsewhere(draw),
        *(_fresh(f"chunks: {n}", chunks=n) for n in (1, 3, 4, 7, 2)),
        *(Rerun(f"chunks in place: {n}", "chunks", {"chunks": n}) for n in (1, 3, 4, 5)),
        *(_fresh(f"order {n}", order=n) for n in range(16)),
        *_lost(draw),
        *(Rerun(f"restored {n}", "restored", {"draw": n}) for n in range(8)),
        *(Rerun(f"configuration: {name}", "written", {"how": name}) for name in WRITTEN),
        *(Rerun(f"snakemake -c{n}", "snakemake", {"cores": n}, {}) for n in (1, 2)),
    ]
    return found


PLACES = ("plain", "two words", "données", "deep/er/and/deeper", "x" * 60, "-dash", "a+b=c", "ж")
WRITTEN = ("a remark", "other order of keys", "values of the defaults said", "numbers otherwise")


def _fresh(name: str, environment: Mapping[str, str] | None = None, **given: object) -> Rerun:
    return Rerun(name, "fresh", given, environment)


def _elsewhere(draw: np.random.Generator) -> Iterator[Rerun]:
    zones = ("Asia/Tokyo", "America/Lima", "Pacific/Kiritimati", "UTC")
    for number in range(26):
        environment = {
            "TZ": str(draw.choice(zones)),
            "LC_ALL": str(draw.choice(["C", "C.UTF-8", "POSIX"])),
            "PYTHONHASHSEED": str(draw.integers(1000)),
            "OPENBLAS_NUM_THREADS": str(draw.integers(1, 3)),
            "OMP_NUM_THREADS": str(draw.integers(1, 3)),
            "NUMBA_NUM_THREADS": str(draw.integers(1, 3)),
            "HOME": f"/tmp/home-{number}",
        }
        said = " ".join(f"{k}={v}" for k, v in environment.items() if k in ("TZ", "LC_ALL"))
        threads = environment["OPENBLAS_NUM_THREADS"]
        yield _fresh(f"machine {number}: {said}, {threads} threads of BLAS", environment)


STAGES = ("vec", "dh", "residuals", "summary", "assessment_points", "study_chunk", "histories")


def _lost(draw: np.random.Generator) -> Iterator[Rerun]:
    for number in range(27):
        chosen = sorted(set(draw.choice(STAGES, 3).tolist()))
        datasets = [("own",), ("mh180",), ("own", "mh180")][number % 3]
        given = {"stages": chosen, "datasets": datasets, "draw": number}
        yield Rerun(f"made again {number}: {', '.join(chosen)}", "lost", given)


def carried_out(one: Rerun, base: World, work: Path) -> World:
    """Rerun without a change; the world whose gate is asked."""
    return ACTIONS[one.action](base, work, **one.given)


def fresh(
    base: World, work: Path, place: str = "again", chunks: int = 0, order: int | None = None
) -> World:
    """A study of the same inputs in a folder where nothing is yet."""
    world = write_world(work / place, settings=SETTINGS)
    if chunks:
        world.configure({"study": {"chunks": chunks}})
    rerun(world.plan(), draw=None if order is None else np.random.default_rng(order))
    shutil.copytree(base.accepted, world.accepted)
    return world


def chunks(base: World, work: Path, chunks: int) -> World:
    """Another number of chunks, where those of before lie about."""
    world = base.copied(work / "again")
    world.configure({"study": {"chunks": chunks}})
    rerun(world.plan())
    return world


def lost(base: World, work: Path, stages: list[str], datasets: list[str], draw: int) -> World:
    """Some stages are made again, because what they left was lost."""
    world = base.copied(work / "again")
    plan = world.plan()
    for dataset in datasets:
        for stage in stages:
            for part in plan.part_names(stage, dataset):
                for path in (
                    *plan.outputs(stage, dataset, part).values(),
                    plan.record(stage, dataset, part),
                ):
                    os.remove(path)
    rerun(plan, draw=np.random.default_rng(draw))
    return world


def restored(base: World, work: Path, draw: int) -> World:
    """Results as a build server's cache restores them: all times are new, in any order."""
    world, generator = base.copied(work / "again"), np.random.default_rng(draw)
    for path in sorted(world.folder.rglob("*")):
        when = 1.7e9 + float(generator.uniform(0.0, 1e7))
        os.utime(path, (when, when))
    rerun(world.plan())
    return world


def written(base: World, work: Path, how: str) -> World:
    """The same configuration in other words."""
    import yaml

    world = base.copied(work / "again")
    path = world.folder / "small.yaml"
    values = yaml.safe_load(path.read_text())
    if how == "a remark":
        path.write_text("# seen again\n" + path.read_text())
    elif how == "other order of keys":
        path.write_text(yaml.safe_dump(dict(reversed(values.items())), sort_keys=False))
    elif how == "values of the defaults said":
        world.configure({"study": {"alpha": 0.6}, "calibration": {"vec": {"prior": "stated"}}})
    else:
        path.write_text(path.read_text().replace("seed: 20\n", "seed: 0x14\n"))
    rerun(world.plan())
    return world


def snakemake(base: World, work: Path, cores: int) -> World:
    """The workflow itself, on so many cores."""
    world = write_world(work / "again", settings=SETTINGS)
    command = [sys.executable, "-m", "snakemake", "-s", str(ROOT / "Snakefile"), "-q", "all"]
    command += ["-c", str(cores), "--configfile", *map(str, world.configs)]
    done = subprocess.run(command, cwd=world.folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stdout + done.stderr)
    shutil.copytree(base.accepted, world.accepted)
    return world


ACTIONS = {each.__name__: each for each in (fresh, chunks, lost, restored, written, snakemake)}

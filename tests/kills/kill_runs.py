"""Kill runs at every phase, start the same command again, compare with a run left undisturbed.

python tests/kills/kill_runs.py [--kills 30] [--seed 1] [--work NAME ...] [--folder FOLDER]

Prints a line for each kill, and leaves with exit code 1 where one left a trace. Each case is
SIGKILL of the whole process group, at an event of a file (see at_a_point/sitecustomize.py) or
after some time, which falls into parsing and planning.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Set
from contextlib import nullcontext
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parent / "slurm")]
TIMED = "seconds"  # an event that is a time after the start
_LOCKS = (".lock", ".lock-jobs")
_CONFIGS = ("--configfile", "config.yaml", "small.yaml")
_EACH_CONFIG = ("--config", "config.yaml", "--config", "small.yaml")
SNAKEMAKE = (sys.executable, "-m", "snakemake", "--nocolor", "--quiet", "all")
KINACC = (sys.executable, "-m", "kinacc")


@dataclass(frozen=True)
class Work:
    """A command whose runs are killed, in a project that ``prepare`` has made ready."""

    command: tuple[str, ...]
    prepare: Callable[[Path], None] = lambda project: None
    cluster: bool = False


WORKS: Mapping[str, Work] = {
    "study": Work((*SNAKEMAKE, "-c2", *_CONFIGS)),
    "cached": Work((*SNAKEMAKE, "-c2", "--cache", *_CONFIGS, "--", "own_dh")),
    "calibrate": Work((*KINACC, "calibrate", "-c", "2", *_CONFIGS[1:])),
    "slurm": Work((), cluster=True),
}


@dataclass(frozen=True)
class Place:
    """A project with folders of its own for all that its runs leave elsewhere."""

    project: Path
    more: Mapping[str, str] = field(default_factory=dict)

    @property
    def beside(self) -> Path:
        return self.project.with_name(f"{self.project.name} beside")

    def environment(self) -> dict[str, str]:
        folders = {
            "TMPDIR": "temporary",
            "SNAKEMAKE_OUTPUT_CACHE": "shared cache",
            "XDG_CACHE_HOME": "caches",
            "KILL_COUNTS": "counts",
        }
        for name in folders.values():
            (self.beside / name).mkdir(parents=True, exist_ok=True)
        paths = [HERE / "at_a_point", self.project / "src", *filter(None, sys.path[2:])]
        one = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        own = {name: str(self.beside / folder) for name, folder in folders.items()}
        return os.environ | one | own | {"PYTHONPATH": os.pathsep.join(map(str, paths))} | self.more

    def counts(self) -> dict[str, int]:
        """How often each event has happened."""
        return {path.name: path.stat().st_size for path in (self.beside / "counts").iterdir()}

    def reset_counts(self) -> None:
        for path in (self.beside / "counts").iterdir():
            path.unlink()

    def digests(self) -> dict[str, str]:
        """Every file of the results, by its bytes."""
        results = self.project / "results"
        return {
            path.relative_to(results).as_posix(): sha256(path.read_bytes()).hexdigest()
            for path in sorted(results.rglob("*"))
            if path.is_file()
        }

    def known(self) -> set[str]:
        """Files whose settings and code Snakemake knows, by the names that it gives them."""
        metadata = self.project / ".snakemake" / "metadata"
        return {path.name for path in metadata.rglob("*") if path.is_file()}

    def left(self) -> list[str]:
        """Temporary files and folders anywhere, and what Snakemake holds for incomplete."""
        own = self.project / ".snakemake"
        found = [*self.project.rglob("*.partial"), *own.glob("scripts/*"), *own.glob("shell_tmp*")]
        found += (path for path in own.glob("incomplete/**/*") if path.is_file())
        found += (self.beside / "temporary").iterdir()
        found += (self.beside / "caches").glob("**/snakemake-runtime-cache/*")
        found += (p for p in (self.beside / "shared cache").iterdir() if p.is_dir())
        found += (p for p in (self.project / "results" / n for n in _LOCKS) if _size(p))
        return sorted(str(path) for path in found)


def _size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


def started(place: Place, command: tuple[str, ...], at: str = "") -> subprocess.Popen:
    """A command in a process group of its own, which ends all of it at an event."""
    return subprocess.Popen(
        command,
        cwd=place.project,
        env=place.environment() | {"KILL_AT": at},
        stdout=subprocess.DEVNULL,
        stderr=(place.beside / "said").open("a"),
        start_new_session=True,
    )


def killed(place: Place, command: tuple[str, ...], at: str) -> bool:
    """Whether a run was killed before it ended by itself."""
    event, _, number = at.partition(" ")
    run = started(place, command, at)
    if event == TIMED:
        time.sleep(float(number))
        if run.poll() is None:
            os.killpg(run.pid, signal.SIGKILL)
    return run.wait() == -signal.SIGKILL


def faults(
    place: Place, command: tuple[str, ...], wanted: Mapping[str, str], known: Set[str] = frozenset()
) -> list[str]:
    """What is wrong after the same command was started again."""
    code = started(place, command).wait()
    if code:
        return [f"exit code {code}: {(place.beside / 'said').read_text()[-2000:]}"]
    there = place.digests()
    differ = [name for name in {*there, *wanted} if there.get(name) != wanted.get(name)]
    found = [f"differs: {name}" for name in sorted(differ)] + place.left()
    unknown = known - place.known()
    return found + [f"Snakemake does not know how {len(unknown)} files were made"] * bool(unknown)


def cases(counts: Mapping[str, int], took_s: float, kills: int, seed: int) -> Iterator[str]:
    """Phases in turn, each at a random event of its kind."""
    chance = random.Random(seed)
    phases = [*sorted(name for name in counts if counts[name]), TIMED]
    for number in range(kills):
        phase = phases[number % len(phases)]
        if phase == TIMED:
            yield f"{phase} {chance.uniform(0.05, 0.5 * took_s):.2f}"
        else:
            yield f"{phase} {chance.randint(1, counts[phase])}"


def new_project(folder: Path) -> Place:
    """The small configuration of the paper and a measured arm."""
    from whole_project import ROOT, SMALL, _copy, write_poses

    _copy(ROOT, folder)
    (folder / "small.yaml").write_text(SMALL)
    write_poses(folder / "own data" / "poses.csv")
    return Place(folder)


def copied(place: Place, folder: Path) -> Place:
    """A project as it is, with nothing of what runs leave elsewhere."""
    shutil.rmtree(folder, ignore_errors=True)
    new = Place(folder)
    shutil.rmtree(new.beside, ignore_errors=True)
    shutil.copytree(place.project, folder, symlinks=True)
    return new


def kill_all(name: str, kills: int, seed: int, folder: Path) -> int:
    """Kill runs of one work; the number of kills that left a trace."""
    work = WORKS[name]
    place = new_project(folder / name / "begun")
    work.prepare(place.project)
    with _cluster(work, folder) as cluster:
        command, more = work.command, {}
        if cluster is not None:
            command, more = cluster
        undisturbed = Place(copied(place, folder / name / "undisturbed").project, more)
        for _ in range(2):  # the first compiles
            shutil.rmtree(undisturbed.project)
            shutil.copytree(place.project, undisturbed.project, symlinks=True)
            shutil.rmtree(undisturbed.beside, ignore_errors=True)
            undisturbed.environment()
            begun = time.monotonic()
            assert started(undisturbed, command).wait() == 0, undisturbed.beside / "said"
            took_s = time.monotonic() - begun
            _keep_compiled(undisturbed, place)
        assert not undisturbed.left(), undisturbed.left()
        wanted, counts = undisturbed.digests(), undisturbed.counts()
        print(f"{name}: undisturbed {took_s:.0f} s, {counts}", flush=True)
        bad = 0
        for number, at in enumerate(cases(counts, took_s, kills, seed), 1):
            here = Place(copied(place, folder / name / "killed").project, more)
            here.environment()
            was = killed(here, command, at)
            here.reset_counts()
            found = faults(here, command, wanted, undisturbed.known())
            bad += bool(found)
            told = "; ".join(found) if found else "as if undisturbed"
            print(f"{name} {number}: {at}{'' if was else ' (it had ended)'}: {told}", flush=True)
    return bad


def _keep_compiled(source: Place, target: Place) -> None:
    shutil.copytree(source.project / "src", target.project / "src", dirs_exist_ok=True)


def _cluster(work: Work, folder: Path):
    """A Slurm of this machine alone: the command and environment of runs on it; None without."""
    if not work.cluster:
        return nullcontext()
    from on_slurm import on_slurm

    return on_slurm(folder, _CONFIGS)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--kills", type=int, default=30, help="of each work")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--work", nargs="+", choices=WORKS, default=["study"])
    parser.add_argument("--folder", type=Path)
    given = parser.parse_args()
    folder = given.folder or Path(tempfile.mkdtemp(prefix="kills-"))
    bad = {name: kill_all(name, given.kills, given.seed, folder) for name in given.work}
    for name, count in bad.items():
        print(f"{name}: {given.kills} kills, {count} left a trace")
    if given.folder is None:
        shutil.rmtree(folder)
    raise SystemExit(any(bad.values()))


if __name__ == "__main__":
    main()

"""A calibration on a disk that fills at moments of it, and the same command again with more room.

    unshare -m .venv/bin/python tests/faults/filling.py [--moments 8] [--stages]

It has to end in a line that names the disk, leave nothing half-written, and the second run has to
make what an undisturbed one makes, byte for byte. ``--stages``: by ``kinacc run``, one after
another, instead of ``kinacc calibrate``.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parents[1])]

import machine  # noqa: E402
import matrix  # noqa: E402
import world  # noqa: E402

_STAGES = ("measurements", "data_check", "vec", "dh")
_INPUTS = ("poses.csv", "own.yaml", "own.robot.yaml")


def calibrated(here: Path, by_stages: bool) -> matrix.Ended:
    """How a calibration ends in a folder."""
    if not by_stages:
        return matrix.started(("calibrate", "own.yaml", "-c1"), machine.Fault(), here)
    ended = matrix.Ended(0, "", "")
    for stage in _STAGES:
        if ended.code == 0:
            ended = matrix.forked(("run", stage, "--config", "own.yaml"), machine.Fault(), here)
    return ended


def made(here: Path) -> dict[str, bytes]:
    """Everything a calibration leaves, without logs and locks."""
    found = matrix.contents(here)
    return {
        name: content
        for name, content in found.items()
        if name.startswith("results/")
        and "/logs/" not in name
        and Path(name).name not in matrix.LOCKS
    }


def complaints(ended: matrix.Ended, here: Path) -> list[str]:
    """What is not as promised of a run that came to the end of its disk."""
    said = ended.stdout + ended.stderr
    found = [f"says {mark!r}" for mark in matrix.NOT_SAID if mark in said]
    if ended.code == 0 or "no space left on device" not in said.lower():
        found.append("does not say that there is no space left")
    found += [f"leaves {name}" for name in matrix.contents(here) if name.endswith(".partial")]
    found += [f"leaves {name} empty" for name, content in made(here).items() if not content]
    return [f"{each}; exit code {ended.code}: {said[-1500:]}" for each in found]


def main() -> int:
    """Fill the disk at every moment; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--moments", type=int, default=8)
    parser.add_argument("--stages", action="store_true", help="By kinacc run.")
    given = parser.parse_args()
    base = Path(tempfile.mkdtemp(prefix="kinacc-filling-"))
    wrong: list[str] = []
    try:
        (base / "world").mkdir()
        os.chdir(base / "world")
        world.inputs(base / "world")
        for name in ("undisturbed", "disk"):
            machine.mount_disk(base / name)
            for each in _INPUTS:
                shutil.copy(base / "world" / each, base / name)
        at_first = _used(base / "undisturbed")
        ended = calibrated(base / "undisturbed", given.stages)
        if ended.code:
            raise SystemExit(f"an undisturbed run fails: {ended}")
        wanted = made(base / "undisturbed")
        grows = _used(base / "undisturbed") - at_first
        for moment in range(given.moments):
            here = base / "disk"
            for each in here.iterdir():
                if each.name not in _INPUTS:
                    shutil.rmtree(each) if each.is_dir() else each.unlink()
            machine.filled(int(grows * (moment + 0.5) / given.moments))(here)
            found = complaints(calibrated(here, given.stages), here)
            machine.emptied(here)
            again = calibrated(here, given.stages)
            now = made(here)
            other = [name for name in {**wanted, **now} if now.get(name) != wanted.get(name)]
            if again.code or other:
                found.append(f"makes other {', '.join(other)} afterwards, exit code {again.code}")
            wrong += [f"disk that fills at {moment} of {given.moments}: {each}" for each in found]
    finally:
        os.chdir("/")
        for name in ("undisturbed", "disk"):
            subprocess.run(["umount", "-l", str(base / name)], check=False, capture_output=True)
        shutil.rmtree(base, ignore_errors=True)
    print(*wrong, f"{given.moments} moments, {len(wrong)} not as promised", sep="\n")
    return bool(wrong)


def _used(here: Path) -> int:
    told = os.statvfs(here)
    return (told.f_blocks - told.f_bfree) * told.f_frsize


if __name__ == "__main__":
    raise SystemExit(main())

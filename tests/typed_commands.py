"""Commands as a person types them into a shell, by the package as a wheel holds it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import preloaded
from shared_data import ROOT


@dataclass(frozen=True)
class Shell:
    """A shell whose ``kinacc``, ``python`` and ``snakemake`` are those of an installed wheel."""

    folder: Path
    installed: Path

    def __call__(self, text: str, folder: Path, **more: str) -> tuple[int, str, Path]:
        """Exit code of a text typed in a folder, what it printed, and the folder it ends in.

        ``more`` are variables of the environment, such as HOME.
        """
        ended = self.folder / "ended in"
        done = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", f"trap 'pwd > \"{ended}\"' EXIT\n{text}"],
            cwd=folder,
            env=os.environ
            | {
                "PATH": f"{preloaded.commands()}:{os.environ['PATH']}",
                "PYTHONPATH": str(self.installed),
            }
            | more,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        return done.returncode, done.stdout, Path(ended.read_text().strip())


def installed(folder: Path) -> Path:
    """The contents of a wheel of the package, as pip leaves them."""
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    site, source = folder / "site", ROOT / "src"
    shutil.unpack_archive(wheel, site, "zip")
    for path in source.rglob("*.py"):
        shutil.copystat(path, site / path.relative_to(source))
    for path in source.rglob("__pycache__"):  # all is compiled already: found by time of file
        shutil.copytree(path, site / path.relative_to(source), dirs_exist_ok=True)
    return site

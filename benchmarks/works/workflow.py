"""What does the workflow cost beside its work?

CPU time of whole runs with two cores, everything set up before; wall-clock times are in the
results too. The other contender is plain Snakemake with the same scheduler and one rule whose
only input is there already: its own start, about 1 s. Limit: that start, and the work of the
stages in one process that has imported everything. Twenty jobs in processes of their own have
to start Python with numpy twenty times, 0.1 s each, which is two further starts of Snakemake.

The paper: all 19 stages from nothing. A new file: 400 measured poses, from nothing to Fig. 4.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

import project
from harness import Contender, Work

PLAIN = 'rule all:\n    input: "there"\n'
MEASURED = """\
datasets:
  arm:
    robot: mh180
    measurements: {source: file, file: {path: poses.csv, orientation: {kind: quaternion}}}
    evaluation: {space: measured}
"""


def paper(smoke: bool) -> Callable[[], list[str]]:
    """The paper's study in an empty folder; which files it leaves."""

    def run() -> list[str]:
        cwd = project.folder()
        project.snakemake("--cores", 2, "--no-hooks", cwd=cwd)
        return _left(cwd / "results")

    return run


def new_file(smoke: bool) -> Callable[[], list[str]]:
    """A measured file in an empty folder, and Fig. 4 of it; which files it leaves."""
    poses, target = (60, "measurements.parquet") if smoke else (400, "figures/fig4.pdf")

    def run() -> list[str]:
        cwd = project.folder()
        (cwd / "poses.csv").write_bytes(measured.read_bytes())
        (cwd / "arm.yaml").write_text(MEASURED)
        project.snakemake(
            "--cores", 2, "--configfile", "arm.yaml", "--", f"results/arm/{target}", cwd=cwd
        )
        return _left(cwd / "results")

    measured = project.folder() / "poses.csv"
    project.measured_file(measured, poses, seed=0)
    return run


def plain() -> Callable[[], list[str]]:
    """Snakemake with nothing to do."""
    cwd = project.folder()
    (cwd / "Snakefile").write_text(PLAIN)
    (cwd / "there").touch()
    words = ("-m", "snakemake", "--cores", 2, "--scheduler", "greedy")
    return lambda: project.python(*words, cwd=cwd).split()


def works(smoke: bool) -> list[Work]:
    """The paper and a new file; in smoke size the file to its first stage."""
    import kinacc

    other = Contender("plain Snakemake", version("snakemake"), plain())
    return [
        Work(
            name, "run", 1, (Contender("kinacc", kinacc.__version__), other), _agree,
            {other.name: 1 / 7}, today=make, seconds=30.0,
            limit="a start of Snakemake, a start of Python with numpy for each job, their work",
        )
        for name, make in (("new file to Fig. 4", new_file), ("paper, snakemake -c2", paper))
        if not (smoke and make is paper)
    ]  # fmt: skip


def _left(results: Path) -> list[str]:
    """Tables and pictures by name."""
    kept = (path for path in results.rglob("*.*") if path.suffix in (".parquet", ".pdf", ".html"))
    return sorted(path.relative_to(results).as_posix() for path in kept)


def _agree(outputs: Sequence[list[str]]) -> None:
    """Both kinaccs leave the same files, Fig. 4 or a table among them."""
    first, _, *today = outputs
    if not first or any(first != each for each in today):
        raise ValueError(f"files differ: {outputs}")

"""Starting the workflow from any folder: Snakemake as a process with the right options."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

# Installed, the rules stand in the package; in a clone beside src/.
_INSTALLED = Path(__file__).parent / "snakemake"
SNAKEFILE = (_INSTALLED if _INSTALLED.is_dir() else Path(__file__).parents[3]) / "Snakefile"
# Of BLAS, which reads it when numpy is first imported: more threads change the last bits of a sum.
ONE_THREAD = dict.fromkeys(
    ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS"), "1"
)
_PROFILE = SNAKEFILE.parent / "profiles" / "default"


def job_environment(workflow: str) -> dict[str, str]:
    """Variables of every job: one thread, and in a clone its sources, for a Python of conda."""
    source = os.path.join(workflow, "src")
    if not os.path.isdir(source):
        return ONE_THREAD
    paths = [source, *filter(None, [os.environ.get("PYTHONPATH")])]
    return ONE_THREAD | {"PYTHONPATH": os.pathsep.join(paths)}


def run_workflow(target: str, configs: Sequence[str], cores: int, more: Sequence[str] = ()) -> int:
    """Exit code of Snakemake after it made a target of the workflow.

    ``more`` are options of the user for Snakemake; without any it prints only what goes wrong and
    the progress of stages. Ctrl-C and SIGTERM end Snakemake and its jobs.
    """
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(SNAKEFILE)]
    command += ["--cores", str(cores), "--configfile", *configs]
    if "--workflow-profile" not in more:
        command += ["--workflow-profile", str(_PROFILE)]
    command += more or ["--quiet", "all"]
    command += ["--no-hooks", "--", target]

    # A group of its own: Ctrl-C reaches this process alone, which passes it on.
    with subprocess.Popen(command, process_group=0) as started:
        try:
            return started.wait()
        except KeyboardInterrupt:
            # Jobs of a cluster have to be cancelled. Here, killed at any moment, a run can go on.
            elsewhere = any(word.startswith(("--profile", "--executor", "-e")) for word in more)
            os.killpg(started.pid, signal.SIGINT if elsewhere else signal.SIGKILL)
            started.wait()
            raise

"""Starting the workflow from any folder: Snakemake as a process with the right options."""

from __future__ import annotations

import os
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
# Snakemake, whose group of processes ends as its standard input is closed: also where the process
# that started it is killed, or is stopped before it has the number of this one.
_SNAKEMAKE = """\
import os, runpy, signal, threading
stop = lambda: (os.read(0, 1), os.killpg(0, signal.{signal}))
threading.Thread(target=stop, daemon=True).start()
runpy.run_module("snakemake", run_name="__main__", alter_sys=True)
"""
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
    the progress of stages. However this process ends, Snakemake and its jobs end with it.
    """
    # Jobs of a cluster have to be cancelled. Here, killed at any moment, a run can go on.
    elsewhere = any(word.startswith(("--profile", "--executor", "-e")) for word in more)
    program = _SNAKEMAKE.format(signal="SIGINT" if elsewhere else "SIGKILL")
    command = [sys.executable, "-c", program, "--snakefile", str(SNAKEFILE)]
    command += ["--cores", str(cores), "--configfile", *configs]
    if "--workflow-profile" not in more:
        command += ["--workflow-profile", str(_PROFILE)]
    command += more or ["--quiet", "all"]
    command += ["--no-hooks", "--", target]

    # A group of its own: Ctrl-C reaches this process alone.
    with subprocess.Popen(command, stdin=subprocess.PIPE, process_group=0) as started:
        try:
            return started.wait()
        finally:
            started.communicate()  # closes the standard input, and waits

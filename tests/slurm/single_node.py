"""A real Slurm on this machine alone: its controller and one node, reachable from nowhere else."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path

import pytest
from whole_project import ROOT, Project

ABSENT = "Slurm absent: "
PLUGINS = ROOT / ".venv" / "cluster"  # where `make test` puts requirements/cluster.txt
_DAEMONS = ("slurmctld", "slurmd")
_PATIENCE_S = 150.0

# Without Munge and without a database: one user, one machine. Jobs that ended stay in `squeue`.
_CONF = """\
ClusterName=kinacc
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmUser=root
SlurmdUser=root
AuthType=auth/none
CredType=cred/none
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SwitchType=switch/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SlurmdParameters=config_overrides
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
ReturnToService=2
MinJobAge=86400
BatchStartTimeout=1
MessageTimeout=5
KillWait=5
NodeName={host} NodeAddr=127.0.0.1 CPUs=2 RealMemory=8000
PartitionName=all Nodes=ALL Default=YES MaxTime=60
"""
_OPTIONS = (
    *("--profile", "profiles/slurm", "--slurm-no-account", "--slurm-status-command", "squeue"),
    *("--slurm-init-seconds-before-status-checks", "1", "--latency-wait", "5", "--nocolor"),
)


class Cluster:
    """Its daemons, which can be killed as by a fault of the machine."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        for name in ("state", "spool"):
            (folder / name).mkdir()
        self.conf = folder / "slurm.conf"
        host = socket.gethostname().partition(".")[0]
        self.conf.write_text(_CONF.format(host=host, ports=_free_ports(2), folder=folder))
        self.daemons: dict[str, subprocess.Popen] = {}
        for name in _DAEMONS:
            self.start(name)
        wait_for(lambda: "idle" in self.ask("sinfo", "-h", "-o", "%T"), "an idle node")

    def start(self, name: str) -> None:
        """Start a daemon, in the foreground of a session of its own."""
        with (self.folder / f"{name}.log").open("a") as log:
            self.daemons[name] = subprocess.Popen(
                [name, "-D", "-f", self.conf],
                cwd=self.folder,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def kill(self, name: str) -> None:
        """End a daemon at once, and nothing that it started."""
        self.daemons[name].kill()
        self.daemons[name].wait()

    def kill_a_job(self, number: str) -> None:
        """End a job's processes with the slurmstepd that watches them, which tells nobody."""
        found = self._family(f"slurmstepd: [{number}.")
        assert found, f"job {number} has no process"
        _kill(found)
        # The controller compares jobs with nodes every few minutes, and when a daemon starts.
        time.sleep(7.5)  # BatchStartTimeout and MessageTimeout: until then a job may not have begun
        self.kill("slurmd")
        self.start("slurmd")

    def ask(self, *command: str) -> str:
        """What a command of Slurm prints."""
        done = subprocess.run(
            command, env=self.environment(), capture_output=True, text=True, check=False
        )
        return done.stdout

    def running(self) -> list[str]:
        """Numbers of the jobs that run."""
        return self.ask("squeue", "-h", "-t", "RUNNING", "-o", "%i").split()

    def environment(self) -> dict[str, str]:
        return os.environ | {"SLURM_CONF": str(self.conf)}

    @contextmanager
    def snakemake(self, project: Project, *targets: str) -> Iterator[Run]:
        """A project's workflow under way on it."""
        command = [sys.executable, "-m", "snakemake", *_OPTIONS]
        run = Run(
            [*command, "--configfile", "config.yaml", "small.yaml", "--", *targets],
            project.folder,
            self.environment()
            | {"PYTHONPATH": os.pathsep.join([str(project.folder / "src"), *sys.path])},
        )
        try:
            yield run
        finally:
            run.end()

    def stop(self) -> None:
        """End everything that was started."""
        self.ask("scancel", "--full", "--signal=KILL", "--state=RUNNING")
        self.ask("scancel", "--state=PENDING")
        with suppress(AssertionError):
            wait_for(lambda: not self.running(), "the end of all jobs", 10.0)
        for name in reversed(_DAEMONS):
            self.daemons[name].terminate()
            try:
                self.daemons[name].wait(10.0)
            except subprocess.TimeoutExpired:
                self.kill(name)
        _kill(self._family("slurmstepd: ["))

    def _family(self, words: str) -> list[int]:
        """Its processes whose command begins with words, and all that they started."""
        parents: dict[int, int] = {}
        found: list[int] = []
        for folder in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                stat = folder.joinpath("stat").read_text()
                parents[int(folder.name)] = int(stat.rpartition(")")[2].split()[1])
                command, cwd = folder.joinpath("cmdline").read_text(), folder.joinpath("cwd")
                if command.startswith(words) and cwd.resolve() == self.folder:
                    found.append(int(folder.name))
        for parent in found:  # which grows
            found += [each for each, its in parents.items() if its == parent]
        return found


class Run:
    """A workflow that was started, with what it prints."""

    def __init__(self, command: list[str], folder: Path, environment: dict[str, str]) -> None:
        self.path = folder / "said.txt"
        with self.path.open("w") as said:
            self.process = subprocess.Popen(
                command, cwd=folder, env=environment, stdout=said, stderr=said
            )

    def until(self, seen: Callable[[], object], what: str) -> None:
        """Wait for something to happen while the workflow runs."""
        wait_for(lambda: seen() or self.process.poll() is not None, what)
        assert self.process.poll() is None, f"it ended before {what}:\n{self.said()}"

    def finished(self) -> str:
        """What it has printed; fails unless it ends well."""
        assert self.process.wait(_PATIENCE_S) == 0, self.said()
        return self.said()

    def said(self) -> str:
        return self.path.read_text(errors="replace")

    def end(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()


def wait_for(seen: Callable[[], object], what: str, patience_s: float = _PATIENCE_S) -> None:
    until = time.monotonic() + patience_s
    while not seen():
        assert time.monotonic() < until, f"waited {patience_s} s for {what}"
        time.sleep(0.1)


def needed() -> None:
    """Skip the test where Slurm or Snakemake's plugin for it is not installed."""
    missing = [name for name in (*_DAEMONS, "sbatch") if shutil.which(name) is None]
    if missing:
        pytest.skip(f"{ABSENT}no {', '.join(missing)}: apt-get install slurm-wlm")
    if os.geteuid() != 0:
        pytest.skip(f"{ABSENT}its daemons need root")
    plugin_needed()


def plugin_needed(name: str = "slurm") -> None:
    """Skip the test where Snakemake's plugin for a cluster is not installed.

    They stand aside, because Snakemake imports all it finds, which costs every start 0.3 s.
    """
    if PLUGINS.is_dir() and str(PLUGINS) not in sys.path:
        sys.path.append(str(PLUGINS))
    if find_spec(f"snakemake_executor_plugin_{name}") is None:
        pytest.skip(f"{ABSENT}no plugin {name} in .venv/cluster, which make test fills")


def _free_ports(count: int) -> list[int]:
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return ports


def _kill(processes: Iterable[int]) -> None:
    for process in processes:
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)

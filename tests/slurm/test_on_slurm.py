"""The small study on a real Slurm: one node, on this machine, reachable from nowhere else."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import time
from contextlib import ExitStack

import pytest
from whole_project import ROOT, finished, project

__all__ = ["finished", "project"]

PLUGINS = ROOT / ".venv" / "cluster"  # `make test` installs requirements/cluster.txt there
ABSENT = "Slurm absent: its tests need root, Debian's slurm-wlm and .venv/cluster (make test)"
# Without Munge and a database of accounts; `squeue` lists jobs that have ended for a day.
CONF = """\
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
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SlurmdParameters=config_overrides
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
ReturnToService=2
MinJobAge=86400
NodeName={host} NodeAddr=127.0.0.1 CPUs=2 RealMemory=8000
PartitionName=all Nodes=ALL Default=YES MaxTime=60
"""
SNAKEMAKE = (
    *(sys.executable, "-m", "snakemake", "--profile", "profiles/slurm", "--nocolor"),
    *("--slurm-no-account", "--slurm-status-command", "squeue"),
    *("--slurm-init-seconds-before-status-checks", "1", "--latency-wait", "5"),
)


@pytest.fixture
def cluster(tmp_path):
    """Environment of commands that use the cluster."""
    programs = all(shutil.which(name) for name in ("slurmctld", "slurmd", "sbatch"))
    if not (programs and PLUGINS.is_dir() and os.geteuid() == 0):
        pytest.fail(ABSENT) if os.environ.get("CI") else pytest.skip(ABSENT)
    folder = tmp_path / "cluster"
    for name in ("state", "spool", "bin"):
        (folder / name).mkdir(parents=True)
    host = socket.gethostname().partition(".")[0]
    conf = folder / "slurm.conf"
    conf.write_text(CONF.format(host=host, ports=_free_ports(), folder=folder))
    # In a job, Snakemake's plugin removes SLURM_CONF from the environment of `srun`.
    srun = folder / "bin" / "srun"
    srun.write_text(f'#!/bin/sh\nSLURM_CONF="{conf}" exec {shutil.which("srun")} "$@"\n')
    srun.chmod(0o755)
    environment = os.environ | {
        "SLURM_CONF": str(conf),
        "PATH": f"{srun.parent}:{os.environ['PATH']}",
    }
    with ExitStack() as stack:
        for name in ("slurmctld", "slurmd"):
            log = stack.enter_context((folder / f"{name}.log").open("w"))
            daemon = subprocess.Popen([name, "-D", "-f", conf], stdout=log, stderr=log)
            stack.callback(daemon.wait, 30)
            stack.callback(daemon.terminate)
        for _ in range(300):
            if "idle" in told(environment, "sinfo", "-h", "-o", "%T"):
                break
            time.sleep(0.1)
        else:
            pytest.fail("no node became idle in 30 s")
        yield environment
        told(environment, "scancel", "--full", "--user=root")


def _free_ports() -> list[int]:
    with ExitStack() as stack:
        opened = [stack.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in range(2)]
        return [each.getsockname()[1] for each in opened]


def told(environment: dict[str, str], *command: str) -> str:
    """Output of a command of Slurm."""
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    return done.stdout


def test_each_data_set_is_one_job_and_its_results_are_those_of_this_machine(
    finished, project, cluster
):
    shutil.rmtree(project.folder / "results")
    done = subprocess.run(
        [*SNAKEMAKE, "--configfile", "config.yaml", "small.yaml"],
        cwd=project.folder,
        env=cluster | {"PYTHONPATH": f"{project.folder / 'src'}:{PLUGINS}"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout
    assert project.digests() == finished.digests()
    states = told(cluster, "squeue", "--states=all", "--noheader", "--format=%T").split()
    assert states == ["COMPLETED"] * 2

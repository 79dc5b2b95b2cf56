"""Runs on a real Slurm of this machine alone, for kill_runs.py."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from single_node import _OPTIONS as OPTIONS
from single_node import PLUGINS, Cluster


@contextmanager
def on_slurm(folder: Path, configs: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], dict]]:
    """The command of a run on a cluster that is there for the block, and its environment."""
    place = folder / "cluster"
    place.mkdir(parents=True)
    cluster = Cluster(place)
    # Snakemake's plugin for Slurm stands apart, since Snakemake imports all that it finds.
    paths = [str(PLUGINS)] if PLUGINS.is_dir() else []
    sys.path += paths
    try:
        command = (sys.executable, "-m", "snakemake", *OPTIONS, *configs)
        yield (*command, "--", "calibration"), {"SLURM_CONF": os.fspath(cluster.conf)}
    finally:
        cluster.stop()

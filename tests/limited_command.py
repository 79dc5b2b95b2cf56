"""A command in a process of its own, held to memory and time, forked from one that imported it."""

import gc
import multiprocessing
import os
import resource
import sys

COMMANDS = ("campaign_plan", "campaign_start", "data", "init", "plan_poses")
FORKED = multiprocessing.get_context("forkserver")
FORKED.set_forkserver_preload(
    [*(f"kinacc.cli.{name}" for name in COMMANDS), "kinacc.checks.described", "openpyxl"]
)


def run(words, folder, log, seconds, most_bytes):
    """Run a command in ``folder`` and leave; ``log`` gets its standard error."""
    gc.freeze()  # a collection would copy every page of what the process was forked with
    resource.setrlimit(resource.RLIMIT_AS, (most_bytes, most_bytes))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    os.chdir(folder)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(os.open(log, os.O_WRONLY | os.O_CREAT), 2)
    sys.argv = ["kinacc", *words]
    from kinacc.cli.process import main

    main()

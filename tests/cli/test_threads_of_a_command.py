"""A shell or a container that asks for many threads: what a command prints has the same digits."""

from __future__ import annotations

import os
import subprocess
import sys

PROGRAM = """
import sys
from kinacc.cli import main
sys.argv[1:] = ["no command"]  # whose modules would be imported after this
try:
    main()
finally:
    import numpy, scipy.linalg
    from threadpoolctl import threadpool_info
    blas = [each for each in threadpool_info() if each["user_api"] == "blas"]
    print("threads", *{each["num_threads"] for each in blas})
"""


def test_a_command_computes_on_one_thread_of_blas_whatever_the_shell_says():
    asked = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "2")
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env=os.environ | asked,
        capture_output=True,
        text=True,
    )
    assert done.stdout.splitlines()[-1:] == ["threads 1"], done.stderr

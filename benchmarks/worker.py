"""The process that runs works by the kinacc on its PYTHONPATH, as harness.py asks.

It is started with the pipe for answers. Questions come pickled on standard input: ("prepare",
module of the topic, function that makes the run, smoke), ("output",), or ("sample", how many
runs).
"""

from __future__ import annotations

import importlib
import os
import pickle
import sys
import traceback
from collections.abc import Callable

from harness import timed


def main(answers: str) -> None:
    """Answer until standard input ends: True and the answer, or False and what went wrong."""
    run: Callable[[], object] | None = None
    with os.fdopen(int(answers), "wb") as out:
        while True:
            try:
                kind, *rest = pickle.load(sys.stdin.buffer)
            except EOFError:
                return
            answer: object = None
            try:
                if kind == "prepare":
                    module, function, smoke = rest
                    run = None
                    run = getattr(importlib.import_module(module), function)(smoke)
                elif kind == "output":
                    answer = run()
                else:
                    sample = timed(run, *rest)
                    answer = (sample.wall_ns, sample.cpu_ns)
                told = True, answer
            except Exception:
                told = False, traceback.format_exc()
            pickle.dump(told, out)
            out.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])

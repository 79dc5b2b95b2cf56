"""The process that runs one work by the kinacc on its PYTHONPATH, as harness.py asks.

It is started with the topic's module, its function that makes the run, smoke (0 or 1) and the
pipe for answers. Questions come pickled on standard input: "output", or how many runs a sample
has.
"""

from __future__ import annotations

import importlib
import os
import pickle
import sys

from harness import timed


def main(module: str, function: str, smoke: str, answers: str) -> None:
    """Answer until standard input ends."""
    run = getattr(importlib.import_module(module), function)(smoke == "1")
    with os.fdopen(int(answers), "wb") as out:
        while True:
            try:
                question = pickle.load(sys.stdin.buffer)
            except EOFError:
                return
            if question == "output":
                answer: object = run()
            else:
                sample = timed(run, question)
                answer = (sample.wall_ns, sample.cpu_ns)
            pickle.dump(answer, out)
            out.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])

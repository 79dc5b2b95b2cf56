"""Ctrl-C at random moments of every command: one line, exit code 130, nothing half-written.

    .venv/bin/python tests/faults/interrupts.py [--moments 20] [--seed 1] [--command NAME]

The moments are drawn evenly over what the command takes when nothing disturbs it.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parents[1])]

import matrix  # noqa: E402
import world  # noqa: E402


def interrupted(name: str, here: Path, after_s: float) -> tuple[str, list[str]]:
    """How a command ends that is interrupted after a time, and what is not as promised of that."""
    words, leaves = world.COMMANDS[name]
    before = matrix.contents(here)
    process = subprocess.Popen(
        [sys.executable, "-m", "kinacc", *words],
        cwd=here, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, start_new_session=True,
    )  # fmt: skip
    try:
        process.wait(after_s)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate()
    after = matrix.contents(here)
    code = process.returncode
    if code == 0:
        return "finished", [f"lacks {path}" for path in leaves if path not in after]
    if "Traceback" in err and "/kinacc/cli/group.py" not in err:
        return "while Python began", []
    # A library that ends Python code of its own leaves it to Python to end by the signal at last.
    found = [f"ends with {code}"] if code not in (130, -signal.SIGINT) else []
    found += [f"says {mark!r}" for mark in matrix.NOT_SAID if mark in out + err]
    found += [f"leaves {path}" for path in after if path.endswith(".partial") or not after[path]]
    found += [f"lost {path}" for path in before if path not in after]
    if not err.endswith("stopped\n") and code == 130:  # else all was done, and Python ended
        found.append("does not end in 'stopped'")
    return "stopped", [f"{each} after {after_s:.3f} s: {err[-3000:]}" for each in found]


def main() -> int:
    """Interrupt every command; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--moments", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--command", action="append", help="This command; may be repeated.")
    given = parser.parse_args()
    drawn = random.Random(given.seed)
    base = Path(tempfile.mkdtemp(prefix="kinacc-interrupts-"))
    ends: Counter[str] = Counter()
    wrong = 0
    try:
        (base / "world").mkdir()
        os.chdir(base / "world")
        world.build(base / "world")
        for name in given.command or world.COMMANDS:
            took_s = 0.0
            for number in range(given.moments + 1):
                shutil.copytree(base / "world", base / "here")
                begun = time.monotonic()
                after_s = drawn.uniform(0.0, took_s) if number else 600.0
                end, found = interrupted(name, base / "here", after_s)
                if number:
                    ends[end] += 1
                else:
                    took_s = time.monotonic() - begun
                wrong += bool(found)
                print(*(f"{name}: {each}" for each in found), sep="\n", end="\n" * bool(found))
                shutil.rmtree(base / "here")
    finally:
        os.chdir("/")
        shutil.rmtree(base, ignore_errors=True)
    print(f"{ends.total()} interrupted: {dict(ends)}; {wrong} not as promised, seed {given.seed}")
    return bool(wrong)


if __name__ == "__main__":
    raise SystemExit(main())

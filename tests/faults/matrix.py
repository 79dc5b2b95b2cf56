"""Every command under every fault of the machine: what it says, what it leaves, how it ends.

    unshare -m .venv/bin/python tests/faults/matrix.py [--smoke]

Prints what is not as promised, and one line with the figures. Exit code 1 where there is anything.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import traceback
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parents[1])]

import machine  # noqa: E402
import world  # noqa: E402

from kinacc.cli.process import main as kinacc  # noqa: E402

SMOKE_FAULTS = (
    *("full disk", "disk with 4 kB left", "read-only disk", "no more open files"),
    *("folders without permission to write", "files may not grow beyond 1 kB"),
    *("logs that cannot be written", "standard output on a full disk"),
    *("nobody reads standard output", "standard error on a full disk"),
)
SMOKE_COMMANDS = ("run several tables", "show", "summary", "predict", "export")
NOT_SAID = ("Traceback", "Exception ignored", "Error in sys.", "Fatal Python error", "Errno")
LOCKS = ("lock", ".lock", ".lock-jobs")
_MOST_LINES = 8


@dataclass(frozen=True)
class Ended:
    """How a command ended."""

    code: int
    stdout: str
    stderr: str


def complaints(name: str, fault: machine.Fault, here: Path) -> list[str]:
    """What is not as promised of one command under one fault, in words."""
    words, leaves = world.COMMANDS[name]
    before = contents(here)
    fault.before(here)
    try:
        ended = forked(words, fault, here) if not fault.anew else started(words, fault, here)
    finally:
        fault.after(here)
    after = contents(here)
    said = ended.stdout + ended.stderr
    found = [f"says {mark!r}" for mark in NOT_SAID if mark in said]
    odd = sorted(path for path in after if path.endswith(".partial") or not after[path])
    found += [f"leaves {path}" for path in odd]
    found += [f"lost {path}" for path in before if path not in after]
    if ended.code < 0 and -ended.code != signal.SIGPIPE:
        found.append(f"was ended by signal {-ended.code}")
    if ended.code == 0:
        found += [f"ends well without {path}" for path in leaves if path not in after]
    elif fault.harmless:
        found.append(f"ends with {ended.code}")
    else:
        # Where only the answer could not be printed, the work is done; a journal may have grown
        # by a line that nobody was told of.
        changed = [
            path
            for path in (() if fault.stdout else before)
            if after.get(path, before[path]) != before[path]
            and not (path.endswith(".jsonl") and after[path].startswith(before[path]))
        ]
        # A lock and a log may be begun.
        fresh = [path for path in after if path not in before and "logs/" not in path]
        if fault.stdout:
            fresh = []
        known = {path for path in fresh if Path(path).name in LOCKS}
        found += [f"fails and changes {path}" for path in changed if "logs/" not in path]
        found += [f"fails and leaves {path}" for path in fresh if path not in {*known, *leaves}]
        lines = [line for line in ended.stderr.splitlines() if line.strip()]
        if len(lines) > _MOST_LINES:
            found.append(f"says {len(lines)} lines")
        if fault.says and not any(reason in said.lower() for reason in fault.says):
            found.append(f"does not say {' or '.join(fault.says)}")
    told = f"exit code {ended.code}: {said.strip()[-1500:]}"
    return [f"{each}; {told}" for each in found]


def forked(words: tuple[str, ...], fault: machine.Fault, here: Path) -> Ended:
    """A command in a copy of this process, which has imported everything."""
    (out, out_end), (err, err_end) = os.pipe(), os.pipe()
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        os.chdir(here)
        os.close(out)
        os.close(err)
        for wanted, end, number in ((fault.stdout, out_end, 1), (fault.stderr, err_end, 2)):
            os.dup2(_stream(wanted) if wanted else end, number)
            os.close(end)
        fault.process()
        _become(words)
    os.close(out_end)
    os.close(err_end)
    texts: dict[int, bytes] = {}

    def drain(end: int) -> None:
        with open(end, "rb") as stream:
            texts[end] = stream.read()

    threads = [threading.Thread(target=drain, args=(end,)) for end in (out, err)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return Ended(code, texts[out].decode(errors="replace"), texts[err].decode(errors="replace"))


def _stream(wanted: str) -> int:
    if wanted == "nobody":
        read, write = os.pipe()
        os.close(read)
        return write
    return os.open(wanted, os.O_WRONLY)


def _become(words: tuple[str, ...]) -> NoReturn:
    """Carry out a command and end as Python would, without what waits above to be tidied up."""
    code = 1
    sys.argv = ["kinacc", *words]
    try:
        kinacc()
    except SystemExit as ended:
        code = ended.code or 0
    except BaseException:
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            try:
                stream.flush()
            except OSError as error:
                code = 120
                with suppress(OSError):
                    os.write(2, f"Exception ignored: {error}".encode())
        os._exit(code)


def started(words: tuple[str, ...], fault: machine.Fault, here: Path) -> Ended:
    """A command in a process of its own."""
    environment = {**os.environ, **fault.environment}
    environment = {name: value for name, value in environment.items() if value is not None}
    command = [sys.executable, "-m", "kinacc", *words]
    closed = "".join(
        f" {number}>&-" for number, how in ((1, fault.stdout), (2, fault.stderr)) if how == "closed"
    )
    if closed:
        command = ["sh", "-c", f'exec "$@"{closed}', "sh", *command]
    done = subprocess.run(
        command, cwd=here, env=environment, capture_output=True, check=False,
        stdin=subprocess.DEVNULL, preexec_fn=fault.process,
    )  # fmt: skip
    return Ended(
        done.returncode, done.stdout.decode(errors="replace"), done.stderr.decode(errors="replace")
    )


def contents(here: Path) -> dict[str, bytes]:
    """Content of every file by its name; marks what is empty and may be so."""
    found = {}
    for path in sorted(here.rglob("*")):
        name = path.relative_to(here).as_posix()
        if path.is_file() and not name.startswith(".ballast"):
            may_be_empty = "logs/" in name or path.name in LOCKS
            found[name] = path.read_bytes() or (b"empty" if may_be_empty else b"")
    return found


def main() -> int:
    """Run the matrix; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--smoke", action="store_true", help="Quick commands and faults alone.")
    parser.add_argument("--fault", action="append", help="This fault; may be repeated.")
    parser.add_argument("--command", action="append", help="This command; may be repeated.")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    faults = given.fault or (SMOKE_FAULTS if given.smoke else tuple(machine.FAULTS))
    names = given.command or (SMOKE_COMMANDS if given.smoke else tuple(world.COMMANDS))
    base = Path(tempfile.mkdtemp(prefix="kinacc-faults-"))
    found: dict[str, list[str]] = {}
    count = 0
    try:
        (base / "world").mkdir()
        os.chdir(base / "world")
        world.build(base / "world")
        here = base / "disk"
        machine.mount_disk(here)
        try:
            for fault in faults:
                for name in names:
                    for each in here.iterdir():
                        shutil.rmtree(each) if each.is_dir() else each.unlink()
                    shutil.copytree(base / "world", here, dirs_exist_ok=True)
                    count += 1
                    wrong = complaints(name, machine.FAULTS[fault], here)
                    if wrong:
                        found[f"{name}, {fault}"] = wrong
        finally:
            os.chdir("/")
            subprocess.run(["umount", "-l", str(here)], check=False)
    finally:
        shutil.rmtree(base, ignore_errors=True)
    if given.json:
        print(json.dumps({"cases": count, "found": found}))
    else:
        for case, wrong in found.items():
            print(f"{case}:", *wrong, sep="\n    ")
        print(f"{len(names)} commands under {len(faults)} faults: {count} runs, "
              f"{len(found)} not as promised")  # fmt: skip
    return bool(found)


if __name__ == "__main__":
    raise SystemExit(main())

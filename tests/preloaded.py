"""``python``, ``kinacc`` and ``snakemake`` that fork from a process with all packages imported.

Files, pipes, exit codes, the process group and its signals are those of a process of its own;
kinacc is imported from where such a process finds it.
"""

from __future__ import annotations

import atexit
import ctypes
import gc
import json
import os
import runpy
import shlex
import shutil
import signal
import socket
import socketserver
import subprocess
import sys
import tempfile
import traceback
from functools import cache
from importlib import import_module
from pathlib import Path

# The process that is started: it hands its streams over, and ends as the forked one does.
_CLIENT = """\
import json, os, signal, socket, sys
for number in (signal.SIGINT, signal.SIGTERM):
    signal.signal(number, signal.SIG_IGN)
with socket.socket(socket.AF_UNIX) as server:
    server.connect({address!r})
    socket.send_fds(server, [b"."], [0, 1, 2])
    start = [sys.argv[1:], os.getcwd(), dict(os.environ), os.getpgrp()]
    server.sendall(json.dumps(start).encode() + b"\\n")
    server.sendall(server.recv(1))
    os._exit(int(server.recv(8) or 70))
"""
_WORDS = {
    "python": "",
    "python3": "",
    "snakemake": "-m snakemake ${DRY_RUN:+--dry-run}",
    "kinacc": "-m kinacc",
}
_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}  # as the Makefile has it


@cache
def commands() -> Path:
    """A folder with the commands; the server behind them is ended with this process."""
    folder = Path(tempfile.mkdtemp(prefix="commands-"))
    address, client = str(folder / "socket"), folder / "client.py"
    client.write_text(_CLIENT.format(address=address))
    for name, words in _WORDS.items():
        path = folder / name
        start = shlex.join([sys.executable, "-I", "-S", str(client)])
        path.write_text(f'#!/bin/sh\nexec {start} {words} "$@"\n')
        path.chmod(0o755)
    server = subprocess.Popen(
        [sys.executable, __file__, address, str(folder / "python")],
        env=os.environ | _ONE_THREAD,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert server.stdout is not None
    assert server.stdout.readline() == "ready\n"
    for end in (lambda: shutil.rmtree(folder), server.wait, server.terminate):
        atexit.register(end)  # the last one first
    return folder


def python() -> str:
    """Path of the Python among the commands."""
    return str(commands() / "python")


def _serve(address: str, command: str) -> None:
    """Fork at each start, until the tests end."""
    ctypes.CDLL(None).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG, should they be killed
    _import_packages()
    gc.freeze()  # a collection in a forked process would copy every page of what it has imported

    class Start(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            _, streams, _, _ = socket.recv_fds(self.request, 1, 3)
            words, folder, environment, group = json.loads(self.rfile.readline())
            os.setpgid(0, group)
            self.request.sendall(b"g")
            if not self.rfile.read(1):
                return  # the group was killed before this process was one of it
            for number, stream in enumerate(streams):
                os.dup2(stream, number)
                os.close(stream)
            sys.stdin, sys.stdout = os.fdopen(0), os.fdopen(1, "w")
            sys.stderr = os.fdopen(2, "w", 1, errors="backslashreplace")
            os.chdir(folder)
            os.environ.clear()
            os.environ.update(environment)
            sys.executable = command
            self.request.sendall(str(_run(words)).encode())

    class Server(socketserver.ForkingMixIn, socketserver.UnixStreamServer):
        request_queue_size = 50

    with Server(address, Start) as server:
        print("ready", flush=True)
        server.serve_forever()


def _import_packages() -> None:
    """All that kinacc and Snakemake import, without kinacc itself."""
    import pkgutil

    import kinacc

    for module in pkgutil.walk_packages(kinacc.__path__, "kinacc."):
        if "__main__" not in module.name and ".snakemake." not in module.name:
            import_module(module.name)
    for name in ("cli", "dag", "executors.local", "script", "workflow"):
        import_module(f"snakemake.{name}")
    for name in [name for name in sys.modules if name.partition(".")[0] == "kinacc"]:
        del sys.modules[name]


def _run(words: list[str]) -> int:
    """Exit code of a Python with these words, its output flushed."""
    sys.path[:0] = filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))
    try:
        if words[0] == "-m":
            sys.path.insert(0, os.getcwd())
            sys.argv[:] = words[1:]
            runpy.run_module(words[1], run_name="__main__", alter_sys=True)
        elif words[0] == "-c":
            sys.argv[:] = ["-c", *words[2:]]
            exec(words[1], {"__name__": "__main__"})  # noqa: S102
        else:
            sys.argv[:] = words
            sys.path.insert(0, os.path.dirname(words[0]))
            runpy.run_path(words[0], run_name="__main__")
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
    except BaseException:
        traceback.print_exc()
        code = 1
    sys.stdout.flush()
    sys.stderr.flush()
    return code


if __name__ == "__main__":
    _serve(*sys.argv[1:])

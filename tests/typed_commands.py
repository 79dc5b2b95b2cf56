"""Commands as a person types them into a shell, by the package as a wheel holds it.

``kinacc`` on the path is a client of a process that has imported the package once and forks for
each command: a command costs what it does, not its start. Files, exit codes and pipes are those of
a process of its own.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import socket
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
_CLIENT = """\
import json, os, socket, sys
with socket.socket(socket.AF_UNIX) as server:
    server.connect({address!r})
    socket.send_fds(server, [b"."], [0, 1, 2])
    said = json.dumps([["kinacc", *sys.argv[1:]], os.getcwd(), dict(os.environ)])
    server.sendall(said.encode() + b"\\n")
    sys.exit(int(server.recv(8) or 70))
"""
_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}  # as the Makefile has it
_STARTS = '#!/bin/sh\nexec {python} {words} "$@"\n'
_WORDS = {"python": "", "python3": "", "snakemake": "-m snakemake ${DRY_RUN:+--dry-run}"}


@dataclass(frozen=True)
class Shell:
    """A shell whose ``kinacc``, ``python`` and ``snakemake`` are those of an installed wheel."""

    commands: Path
    installed: Path

    def __call__(self, text: str, folder: Path, **more: str) -> tuple[int, str, Path]:
        """Exit code of a text typed in a folder, what it printed, and the folder it ends in.

        ``more`` are variables of the environment, such as HOME.
        """
        ended = self.commands / f"folder-{os.getpid()}"
        done = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", f"trap 'pwd > \"{ended}\"' EXIT\n{text}"],
            cwd=folder,
            env=os.environ
            | _ONE_THREAD
            | {
                "PATH": f"{self.commands}:{os.environ['PATH']}",
                "PYTHONPATH": str(self.installed),
            }
            | more,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        return done.returncode, done.stdout, Path(ended.read_text().strip())


def installed(folder: Path) -> Path:
    """The contents of a wheel of the package, as pip leaves them."""
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    site = folder / "site"
    subprocess.run([*pip, "--target", str(site), str(wheel)], check=True)
    source = ROOT / "src"
    for path in source.rglob("*.py"):
        shutil.copystat(path, site / path.relative_to(source))
    for path in source.rglob("*.nb[ic]"):  # kernels are compiled already: found by time of file
        shutil.copy2(path, site / path.relative_to(source))
    return site


def started(folder: Path, site: Path) -> tuple[Shell, subprocess.Popen[str]]:
    """A shell, and the process behind its ``kinacc``, which is ended by whoever asked for it."""
    address = str(folder / "kinacc.socket")
    client = folder / "client.py"
    client.write_text(_CLIENT.format(address=address))
    python = shlex.quote(sys.executable)  # a path with a space cannot stand behind #!
    for name, words in {**_WORDS, "kinacc": f"-I {shlex.quote(str(client))}"}.items():
        _executable(folder / name, _STARTS.format(python=python, words=words))
    server = subprocess.Popen(
        [sys.executable, __file__, address],
        env=os.environ | _ONE_THREAD | {"PYTHONPATH": str(site)},
        stdout=subprocess.PIPE,
        text=True,
    )
    assert server.stdout is not None
    assert server.stdout.readline() == "ready\n"
    return Shell(folder, site), server


def _executable(path: Path, text: str) -> None:
    path.write_text(text)
    path.chmod(0o755)


def _serve(address: str) -> None:
    """Fork for each call, until the process is ended."""
    import socketserver

    _import_all()

    class Call(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            _, streams, _, _ = socket.recv_fds(self.request, 1, 3)
            words, folder, environment = json.loads(self.rfile.readline())
            for number, stream in enumerate(streams):
                os.dup2(stream, number)
                os.close(stream)
            code = _called(words, folder, environment)
            self.request.sendall(str(code).encode())

    class Server(socketserver.ForkingMixIn, socketserver.UnixStreamServer):
        max_children = 8

    with Server(address, Call) as server:
        print("ready", flush=True)
        server.serve_forever()


def _import_all() -> None:
    import pkgutil
    from importlib import import_module

    import kinacc

    for module in pkgutil.walk_packages(kinacc.__path__, "kinacc."):
        if "__main__" not in module.name and ".snakemake." not in module.name:
            import_module(module.name)


def _called(words: list[str], folder: str, environment: dict[str, str]) -> int:
    """Exit code of one command, its output flushed."""
    from kinacc.cli.group import main

    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv[:] = words
    try:
        main()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    else:
        code = 0
    sys.stdout.flush()
    sys.stderr.flush()
    return code


if __name__ == "__main__":
    _serve(sys.argv[1])

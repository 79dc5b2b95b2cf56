"""Counts what processes of a run do with files, and ends all of them at a chosen event.

Python imports this at its start where the folder is in PYTHONPATH. KILL_COUNTS names a folder for
the counts of events, KILL_AT an event and its number, "renamed 3".
"""

import fcntl
import os
import signal

_COUNTS, _AT = os.environ.get("KILL_COUNTS", ""), os.environ.get("KILL_AT", "")
_open, _replace, _rename, _remove = os.open, os.replace, os.rename, os.remove


def _happens(event):
    """Whether to end here."""
    handle = _open(os.path.join(_COUNTS, event), os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        os.write(handle, b".")
        return f"{event} {os.fstat(handle).st_size}" == _AT
    finally:
        os.close(handle)


def _kill():
    """End the run that was started first, and this process's own group: a job of a cluster."""
    os.killpg(int(os.environ["KILL_GROUP"]), signal.SIGKILL)
    os.killpg(0, signal.SIGKILL)


def _is_part(path):
    return os.fspath(path).endswith(".partial") and "/.run." not in os.fspath(path)


def open_(path, flags, *more, **named):
    handle = _open(path, flags, *more, **named)
    made = isinstance(path, (str, os.PathLike)) and flags & os.O_CREAT
    if made and _is_part(path) and _happens("begun"):
        _kill()
    return handle


def replace(source, target, **named):
    if not _is_part(source):
        return _replace(source, target, **named)
    if _happens("half"):
        os.truncate(source, os.path.getsize(source) // 2)
        _kill()
    if _happens("written"):
        _kill()
    _replace(source, target, **named)
    if _happens("renamed"):
        _kill()
    return None


def rename(source, target, **named):
    """What a shared cache is filled by."""
    if "kinacc-" in os.fspath(source) and _happens("cached"):
        _kill()
    return _rename(source, target, **named)


def remove(path, **named):
    """What Snakemake says by that a job is finished."""
    if "/incomplete/" in os.fspath(path) and _happens("finished"):
        _kill()
    return _remove(path, **named)


if _COUNTS:
    os.environ.setdefault("KILL_GROUP", str(os.getpgid(0)))
    os.open, os.replace, os.rename, os.remove = open_, replace, rename, remove

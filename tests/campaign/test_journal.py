"""The journal keeps what it confirmed: through kills, cut-off lines, edits and second writers."""

from __future__ import annotations

import errno
import multiprocessing
import os
import signal
import time
from pathlib import Path

import pytest

from kinacc.campaign import folder as journal
from kinacc.errors import InputError

SEED = "0123456789abcdef"


def written(path: Path, count: int) -> journal.Journal:
    for _ in range(count):
        known = journal.read_journal(path, SEED)
        journal.append(path, known, {"kind": "test", "number": len(known.entries)})
    return journal.read_journal(path, SEED)


def test_a_last_line_cut_anywhere_loses_only_itself(tmp_path):
    path = tmp_path / "j"
    written(path, 3)
    whole = path.read_bytes()
    end = len(b"\n".join(whole.split(b"\n")[:2])) + 1
    for size in range(end + 1, len(whole)):
        path.write_bytes(whole[:size])
        known = journal.read_journal(path, SEED)
        assert len(known.entries) == 2
        assert known.cut_off == size - end
        journal.append(path, known, {"kind": "test", "number": 2})
        assert path.read_bytes() == whole


@pytest.mark.parametrize("made", ["pipe", "folder"])
def test_a_journal_that_is_no_file_is_told_at_once(tmp_path, made):
    path = tmp_path / "j"
    os.mkfifo(path) if made == "pipe" else path.mkdir()
    with pytest.raises(InputError, match="cannot be read: is no file"):
        journal.read_journal(path, SEED)


def test_zeros_left_by_a_power_cut_are_no_line(tmp_path):
    path = tmp_path / "j"
    written(path, 2)
    whole = path.read_bytes()
    for tail in (b"\0" * 40, b'{"sum": "\0\0\0\0\0"}\n'):
        path.write_bytes(whole + tail)
        known = journal.read_journal(path, SEED)
        assert len(known.entries) == 2
        assert known.cut_off == len(tail)


@pytest.mark.parametrize("line", [0, 1, 2])
def test_a_line_that_was_changed_is_noticed(tmp_path, line):
    path = tmp_path / "j"
    written(path, 3)
    lines = path.read_bytes().split(b"\n")
    lines[line] = lines[line].replace(b'"number": ', b'"number": 1')
    path.write_bytes(b"\n".join(lines))
    with pytest.raises(InputError, match=f"line {line + 1}"):
        journal.read_journal(path, SEED)


def test_a_journal_of_an_earlier_version_goes_on(tmp_path):
    path = tmp_path / "j"
    path.write_text('{"chain": "0011223344556677", "entry": {"number": 0}, "head": "head.json"}\n')
    known = written(path, 1)
    assert [each["number"] for each in known.entries] == [0, 1]


def write_on(folder, confirmed):
    """Append entries for ever; the number of each that is confirmed goes to a pipe."""
    while True:
        with journal.locked(folder):
            known = journal.read_journal(folder / "j", SEED)
            journal.append(folder / "j", known, {"number": len(known.entries), "fill": "x" * 5000})
        os.write(confirmed, f"{len(known.entries)}\n".encode())


def test_nothing_confirmed_is_lost_when_the_writer_is_killed(tmp_path):
    for wait in (0.0, 0.01, 0.02, 0.05, 0.11):
        out, into = os.pipe()
        writer = multiprocessing.get_context("fork").Process(target=write_on, args=(tmp_path, into))
        writer.start()
        os.close(into)
        with open(out) as confirmed:
            first = confirmed.readline()
            time.sleep(wait)
            os.kill(writer.pid, signal.SIGKILL)
            last = int([first, *confirmed][-1])
        writer.join()
        known = journal.read_journal(tmp_path / "j", SEED)
        assert [each["number"] for each in known.entries][: last + 1] == list(range(last + 1))


def test_a_second_writer_waits_and_is_then_refused(tmp_path):
    begun = time.monotonic()
    with (
        journal.locked(tmp_path),
        pytest.raises(InputError, match="another process is writing"),
        journal.locked(tmp_path, patience_s=0.2),
    ):
        pass
    assert time.monotonic() - begun >= 0.2
    with journal.locked(tmp_path, patience_s=0.0):
        pass


def test_a_disk_that_does_not_take_a_line_is_told_and_nothing_before_is_lost(tmp_path, monkeypatch):
    path = tmp_path / "j"
    known = written(path, 2)

    def full(_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(journal.os, "fsync", full)
        with pytest.raises(InputError, match="no space left"):
            journal.append(path, known, {"kind": "test", "number": 2})
    assert [each["number"] for each in journal.read_journal(path, SEED).entries][:2] == [0, 1]
    journal.append(path, journal.read_journal(path, SEED), {"kind": "test", "number": 3})
    assert journal.read_journal(path, SEED).entries[-1]["number"] == 3

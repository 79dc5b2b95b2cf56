"""Benchmarks in smoke size: every topic runs and its outputs agree. No time is judged here."""

from __future__ import annotations

import dataclasses
import shutil
import subprocess
from types import SimpleNamespace

import document_benchmarks as page
import harness
import machine
import measured
import pytest
import run

ROOT = harness.ROOT
FACTS = {
    "cpu": "a processor", "cores": 2, "write_gb_per_s": 9.5, "python": "3.11", "numpy": "2.4",
    "commit": "abcdef0", "measured_on": "2026-01-02",
}  # fmt: skip


def work(*others: harness.Contender, **said) -> harness.Work:
    """A work of one unit whose contenders give the number 1."""
    given = {
        "name": "one", "unit": "number", "count": 1, "agree": equal,
        "contenders": (harness.Contender("kinacc", "0", lambda: 1), *others),
    }  # fmt: skip
    return harness.Work(**{**given, **said})


def equal(outputs):
    if set(outputs) != {1}:
        raise ValueError(f"{outputs}")


@pytest.mark.parametrize("topic", run.topics())
def test_a_topic_runs_its_outputs_agree_and_the_page_has_its_rows(topic, tmp_path):
    rows, wrong = run.measure(topic, True, ("", None))
    assert wrong == []
    assert rows
    measured.write(measured.table(rows, FACTS), topic, tmp_path)
    read = page.read(tmp_path)
    assert len(read[topic]) == len(rows)
    written = page.text(read)
    for row in rows:
        assert (
            row.work if isinstance(row, harness.Result) else next(iter(row.values()))
        ) in written
    assert page.picture(topic, read[topic]).axes


def test_contenders_take_turns_and_begin_one_place_further_on_each_round(monkeypatch):
    monkeypatch.setattr(harness, "ROUNDS", (3, 3))
    monkeypatch.setattr(harness, "SAMPLE_S", 0.0)
    called = []

    def named(name):
        return harness.Contender(name, "", lambda: called.append(name) or 1)

    harness.measure(work(named("b"), contenders=(named("kinacc"), named("b"))), [], False)
    assert called[-6:] == ["kinacc", "b", "b", "kinacc", "kinacc", "b"]


def test_nothing_is_timed_where_outputs_differ(monkeypatch):
    monkeypatch.setattr(harness, "timed", lambda *_: pytest.fail("timed"))
    with pytest.raises(ValueError, match=r"\[1, 2\]"):
        harness.measure(work(harness.Contender("other", "2", lambda: 2)), [], False)


def test_a_library_that_is_not_installed_is_named(tmp_path):
    rows = harness.measure(work(wanted={"other": 8.0}), [], True)
    assert [(row.contender, row.left_out) for row in rows[1:]] == [("other", "not installed")]
    measured.write(measured.table(rows, FACTS), "fits", tmp_path)
    assert "| one | other | not installed |" in page.text(page.read(tmp_path))


def test_a_wish_that_is_not_met_stands_out_on_the_page(tmp_path):
    other = harness.Contender("other", "3.1", lambda: 1)
    rows = harness.measure(work(other, wanted={"other": 1e9}), [], True)
    measured.write(measured.table(rows, FACTS), "fits", tmp_path)
    written = page.text(page.read(tmp_path))
    assert "Of 1 targets 0 are met. Not met: one beside other (Fits)." in written
    assert "**1000000000 x faster: not met**" in written


def test_an_earlier_commit_is_run_from_its_own_sources(tmp_path, monkeypatch):
    monkeypatch.setattr(harness, "ROUNDS", (2, 2))
    for name, answer in (("new", 1), ("old", 1.5)):
        (tmp_path / name / "src").mkdir(parents=True)
        text = f"def made(smoke):\n    return lambda: {answer}\n"
        (tmp_path / name / "src" / "of_this_test.py").write_text(text)
    seen = []
    made = SimpleNamespace(__module__="of_this_test", __qualname__="made")
    asked = work(agree=seen.extend, today=made, wanted={"today": 3.0})
    processes = [
        harness.Elsewhere("kinacc", "0", tmp_path / "new"),
        harness.Elsewhere("today", "abc", tmp_path / "old"),
    ]
    try:
        rows = harness.measure(asked, processes, False)
    finally:
        for process in processes:
            process.close()
    assert seen == [1, 1.5]
    assert [(row.contender, row.version, row.rounds) for row in rows] == [
        ("kinacc", "0", 2), ("today", "abc", 2),
    ]  # fmt: skip
    assert rows[1].wanted == 3.0


def test_the_sources_of_a_commit_are_laid_out_and_one_that_is_not_there_is_left_out(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(harness, "ROUNDS", (1, 1))
    monkeypatch.setattr(harness, "SAMPLE_S", 0.0)
    git = shutil.which("git")
    if git is None or subprocess.run([git, "rev-parse"], cwd=ROOT, capture_output=True).returncode:
        pytest.skip("not in a git repository")
    there, absent = tmp_path / "there", tmp_path / "absent"
    there.mkdir()
    absent.mkdir()
    assert (machine.sources_of("HEAD", there) / "src" / "kinacc" / "__init__.py").exists()
    assert machine.sources_of("0000000", absent) is None
    asked = dataclasses.replace(work(), today=lambda smoke: lambda: 1)
    rows = harness.measure(asked, [], False)
    assert [row.left_out for row in rows] == ["", "that commit is not in this repository"]


def test_the_page_is_written_from_the_results():
    written = (page.DOCS / "benchmarks.md").read_text(encoding="utf-8")
    assert written == page.text(page.read()), "run python tools/document_benchmarks.py"

"""Benchmarks in smoke size: every topic runs and its outputs agree. No time is judged here."""

from __future__ import annotations

from importlib import import_module

import harness
import pandas as pd
import pytest
import run


def work(*others: harness.Contender) -> harness.Work:
    """A work of one unit whose contenders give the number 1."""
    kinacc = harness.Contender("kinacc", "0", lambda: 1)
    return harness.Work("one", "number", 1, (kinacc, *others), equal)


def equal(outputs):
    if set(outputs) != {1}:
        raise ValueError(f"{outputs}")


@pytest.mark.parametrize("topic", run.TOPICS)
def test_a_topic_runs_its_outputs_agree_and_the_page_has_its_rows(topic):
    rows = []
    for each in import_module(f"works.{topic}").works(smoke=True):
        rows += harness.measure(each, smoke=True)
    table = pd.DataFrame(rows)
    table.attrs["on"] = "a machine"
    written = run.page({topic: table})
    assert rows
    assert all(row["work"] in written for row in rows if row["beside"] != "kinacc")


def test_contenders_take_turns_and_begin_one_place_further_on_each_round(monkeypatch):
    monkeypatch.setattr(harness, "ROUNDS", (3, 3))
    monkeypatch.setattr(harness, "SAMPLE_S", 0.0)
    called = []
    pair = [
        harness.Contender(name, "", lambda name=name: called.append(name) or 1) for name in "ab"
    ]
    harness.measure(harness.Work("one", "number", 1, pair, equal))
    assert called[-6:] == ["a", "b", "b", "a", "a", "b"]


def test_nothing_is_timed_where_outputs_differ(monkeypatch):
    monkeypatch.setattr(harness, "sample_s", lambda *_: pytest.fail("timed"))
    with pytest.raises(ValueError, match=r"\[1, 2\]"):
        harness.measure(work(harness.Contender("other", "2", lambda: 2)))


def test_the_page_is_written_from_the_results():
    written = (harness.ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    assert written == run.page(run.read()), "run make bench"
